// Reading typed values out of JSON objects: see reader.h.
#include "plant/reader.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

pb_status pb_reader_open(const cJSON *object, const char *pointer, const cJSON *models,
                         pb_reader *out, pb_error *err) {
  *out = (pb_reader){.own = object, .err = err};
  snprintf(out->own_pointer, sizeof out->own_pointer, "%s", pointer);
  if (!cJSON_IsObject(object)) return pb_fail(err, PB_ERR_SCHEMA, pointer, "expected an object");
  const cJSON *name = pb_json_member(object, "model");
  if (!name) return PB_OK;
  char where[256];
  pb_json_pointer(where, sizeof where, pointer, "model");
  if (!models) return pb_fail(err, PB_ERR_SCHEMA, where, "no model can be named here");
  if (!cJSON_IsString(name))
    return pb_fail(err, PB_ERR_SCHEMA, where, "expected the name of a model");
  const cJSON *model = pb_json_member(models, name->valuestring);
  if (!model)
    return pb_fail(err, PB_ERR_REFERENCE, where, "there is no model \"%s\"", name->valuestring);
  out->model = model;
  pb_json_pointer(out->model_pointer, sizeof out->model_pointer, "/models", name->valuestring);
  return PB_OK;
}

const cJSON *pb_reader_find(const pb_reader *r, const char *key, char *where) {
  const cJSON *value = pb_json_member(r->own, key);
  const char *base = r->own_pointer;
  if (!value && r->model) {
    value = pb_json_member(r->model, key);
    if (value) base = r->model_pointer;
  }
  pb_json_pointer(where, 256, base, key);
  return value;
}

static bool is_known(const char *key, const char *const *known, const pb_field *fields,
                     size_t count) {
  for (; known && *known; known++)
    if (!strcmp(key, *known)) return true;
  for (size_t i = 0; i < count; i++)
    if (!strcmp(key, fields[i].key)) return true;
  return false;
}

static pb_status check_object(const cJSON *object, const char *pointer, const char *const *known,
                              const pb_field *fields, size_t count, pb_error *err) {
  for (const cJSON *m = object ? object->child : NULL; m; m = m->next) {
    if (is_known(m->string, known, fields, count)) continue;
    char where[256];
    pb_json_pointer(where, sizeof where, pointer, m->string);
    char list[400] = "";
    size_t n = 0;
    for (size_t i = 0; i < count && n < sizeof list; i++)
      n += (size_t)snprintf(list + n, sizeof list - n, " %s", fields[i].key);
    for (const char *const *k = known; k && *k && n < sizeof list; k++)
      n += (size_t)snprintf(list + n, sizeof list - n, " %s", *k);
    return pb_fail(err, PB_ERR_SCHEMA, where, "unknown key; known here:%s", list);
  }
  return PB_OK;
}

pb_status pb_reader_known(const pb_reader *r, const char *const *known, const pb_field *fields,
                          size_t count) {
  pb_status st = check_object(r->own, r->own_pointer, known, fields, count, r->err);
  if (st) return st;
  return check_object(r->model, r->model_pointer, known, fields, count, r->err);
}

// No quantity in SI units comes near this, and products of a few numbers below it stay finite.
static pb_status check_size(double x, const char *where, pb_error *err) {
  if (fabs(x) <= 1e30) return PB_OK;
  return pb_fail(err, PB_ERR_SCHEMA, where, "expected a number up to 1e30 in size, not %g", x);
}

static pb_status check_range(pb_range range, double x, const char *where, pb_error *err) {
  switch (range) {
  case PB_ANY:
    return PB_OK;
  case PB_NON_NEGATIVE:
    if (x >= 0) return PB_OK;
    return pb_fail(err, PB_ERR_SCHEMA, where, "expected a number ≥ 0, not %g", x);
  case PB_POSITIVE:
    if (x > 0) return PB_OK;
    return pb_fail(err, PB_ERR_SCHEMA, where, "expected a number > 0, not %g", x);
  case PB_SIGN:
    if (x == 1 || x == -1) return PB_OK;
    return pb_fail(err, PB_ERR_SCHEMA, where, "expected 1 or -1, not %g", x);
  }
  return PB_OK;
}

pb_status pb_reader_number(const pb_reader *r, const pb_field *field, double *out) {
  char where[256];
  const cJSON *value = pb_reader_find(r, field->key, where);
  if (!value && field->required)
    return pb_fail(r->err, PB_ERR_SCHEMA, where, "missing; expected a number");
  if (!value) {
    *out = field->fallback;
    return PB_OK;
  }
  if (!cJSON_IsNumber(value)) return pb_fail(r->err, PB_ERR_SCHEMA, where, "expected a number");
  *out = value->valuedouble;
  pb_status st = check_size(*out, where, r->err);
  return st ? st : check_range(field->range, *out, where, r->err);
}

pb_status pb_reader_fields(const pb_reader *r, const pb_field *fields, size_t count, void *base,
                           bool partial) {
  for (size_t i = 0; i < count; i++) {
    pb_field field = fields[i];
    if (partial) field.required = false;
    double *out = (double *)(void *)((char *)base + field.offset);
    pb_status st = pb_reader_number(r, &field, out);
    if (st) return st;
  }
  return PB_OK;
}

pb_status pb_json_numbers(const cJSON *value, const char *where, size_t n, double *out,
                          pb_error *err) {
  if (!cJSON_IsArray(value) || (size_t)cJSON_GetArraySize(value) != n)
    return pb_fail(err, PB_ERR_SCHEMA, where, "expected an array of %zu numbers", n);
  size_t i = 0;
  for (const cJSON *m = value->child; m; m = m->next, i++) {
    char item[256], number[24];
    snprintf(number, sizeof number, "%zu", i);
    pb_json_pointer(item, sizeof item, where, number);
    if (!cJSON_IsNumber(m)) return pb_fail(err, PB_ERR_SCHEMA, item, "expected a number");
    out[i] = m->valuedouble;
    pb_status st = check_size(out[i], item, err);
    if (st) return st;
  }
  return PB_OK;
}

pb_status pb_json_index(const cJSON *value, const char *where, size_t low, size_t high, size_t *out,
                        pb_error *err) {
  bool ok = cJSON_IsNumber(value) && value->valuedouble == floor(value->valuedouble) &&
            value->valuedouble >= (double)low && value->valuedouble <= (double)high;
  if (!ok)
    return pb_fail(err, PB_ERR_SCHEMA, where, "expected a whole number from %zu to %zu", low, high);
  *out = (size_t)value->valuedouble;
  return PB_OK;
}

pb_status pb_reader_vector(const pb_reader *r, const char *key, bool required, double out[3],
                           bool *found) {
  char where[256];
  const cJSON *value = pb_reader_find(r, key, where);
  if (found) *found = value != NULL;
  if (!value && required)
    return pb_fail(r->err, PB_ERR_SCHEMA, where, "missing; expected an array of 3 numbers");
  return value ? pb_json_numbers(value, where, 3, out, r->err) : PB_OK;
}

pb_status pb_reader_direction(const pb_reader *r, const char *key, bool required, double out[3],
                              bool *found) {
  double v[3];
  bool there = false;
  pb_status st = pb_reader_vector(r, key, required, v, &there);
  if (found) *found = there;
  if (st || !there) return st;
  double scale = fmax(fabs(v[0]), fmax(fabs(v[1]), fabs(v[2])));
  if (!(scale > 0)) {
    char where[256];
    pb_reader_find(r, key, where);
    return pb_fail(r->err, PB_ERR_SCHEMA, where, "a zero vector has no direction");
  }
  for (int i = 0; i < 3; i++) v[i] /= scale;  // first, so that squares neither over- nor underflow
  double norm = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  for (int i = 0; i < 3; i++) out[i] = v[i] / norm;
  return PB_OK;
}

pb_status pb_reader_string(const pb_reader *r, const char *key, bool required, const char **out) {
  char where[256];
  *out = NULL;
  const cJSON *value = pb_reader_find(r, key, where);
  if (!value && !required) return PB_OK;
  if (!value || !cJSON_IsString(value) || !value->valuestring[0])
    return pb_fail(r->err, PB_ERR_SCHEMA, where, "%sexpected a non-empty string",
                   value ? "" : "missing; ");
  *out = value->valuestring;
  return PB_OK;
}
