// Reading a specification, and telling its limits: see gate.h.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "plant/reader.h"
#include "study/gate.h"

// Keys that a quantity has besides quantity, min and max.
static const struct facts {
  const char *name, *text, *unit;
  const char *key[4];
} quantities[PB_GATE_QUANTITIES] = {
    [PB_GATE_STIFFNESS] = {"stiffness", "stiffness", "N/m", {"axis"}},
    [PB_GATE_MODE] = {"mode", "mode", "Hz", {"number"}},
    [PB_GATE_STROKE] = {"stroke", "stroke", "m", {"range", "axis", "strut"}},
    [PB_GATE_ATTAINABLE] = {"attainable_damping", "attainable damping", "", {"number"}},
    [PB_GATE_DAMPING] = {"damping", "damping at the best stable gain", "", {NULL}},
    [PB_GATE_COUPLING] = {"coupling", "coupling", "", {"band", "damped"}},
    [PB_GATE_ORDER] = {"order", "order", "states", {NULL}},
    [PB_GATE_STRUTS] = {"force_along_struts", "force along struts, k l²/k_r", "", {NULL}},
};
static const char *const axes[6] = {"x", "y", "z", "rx", "ry", "rz"};

void pb_gate_limit_name(const pb_gate_limit *l, char *text, size_t size) {
  const char *name = quantities[l->quantity].text;
  if (l->quantity == PB_GATE_COUPLING)
    snprintf(text, size, "%s %g … %g Hz, %s", name, l->range[0], l->range[1],
             l->damped ? "damped" : "undamped");
  else if (l->axis >= 0)
    snprintf(text, size, "%s %s", name, axes[l->axis]);
  else if (l->quantity == PB_GATE_STROKE)
    snprintf(text, size, "%s of strut %zu", name, l->number);
  else if (l->quantity == PB_GATE_ATTAINABLE)
    snprintf(text, size, l->number ? "%s, mode %zu" : "%s, all modes", name, l->number);
  else if (l->number)
    snprintf(text, size, "%s %zu", name, l->number);
  else
    snprintf(text, size, "%s", name);
}

const char *pb_gate_limit_unit(const pb_gate_limit *l) {
  bool rotation = l->axis >= 3;
  if (rotation && l->quantity == PB_GATE_STIFFNESS) return "Nm/rad";
  if (rotation && l->quantity == PB_GATE_STROKE) return "rad";
  return quantities[l->quantity].unit;
}

static pb_status read_quantity(const pb_reader *r, pb_gate_quantity *out, pb_error *err) {
  char where[256];
  const char *text;
  pb_status status = pb_reader_string(r, "quantity", true, &text);
  if (status) return status;
  for (int q = 0; q < PB_GATE_QUANTITIES; q++) {
    if (strcmp(quantities[q].name, text)) continue;
    *out = (pb_gate_quantity)q;
    return PB_OK;
  }
  pb_reader_find(r, "quantity", where);
  return pb_fail(err, PB_ERR_SCHEMA, where,
                 "\"%s\" is no quantity; known: stiffness, mode, stroke, attainable_damping, "
                 "damping, coupling, order, force_along_struts",
                 text);
}

static bool has_key(pb_gate_quantity q, const char *key) {
  for (int i = 0; i < 4 && quantities[q].key[i]; i++)
    if (!strcmp(quantities[q].key[i], key)) return true;
  return false;
}

static pb_status check_keys(const pb_reader *r, pb_gate_quantity q) {
  const char *known[8] = {"quantity", "min", "max"};
  for (int i = 0; i < 4 && quantities[q].key[i]; i++) known[3 + i] = quantities[q].key[i];
  return pb_reader_known(r, known, NULL, 0);
}

static pb_status read_bounds(const pb_reader *r, pb_gate_limit *l, pb_error *err) {
  const pb_field min = {"min", 0, PB_POSITIVE, false, NAN},
                 max = {"max", 0, PB_POSITIVE, false, NAN};
  pb_status status = pb_reader_number(r, &min, &l->min);
  if (!status) status = pb_reader_number(r, &max, &l->max);
  if (!status && isnan(l->min) && isnan(l->max))
    status = pb_fail(err, PB_ERR_SCHEMA, r->own_pointer, "neither min nor max is given");
  if (!status && l->min > l->max)
    status = pb_fail(err, PB_ERR_SCHEMA, r->own_pointer, "min is above max");
  return status;
}

static pb_status read_axis(const pb_reader *r, pb_gate_limit *l, bool required, pb_error *err) {
  char where[256];
  const char *text;
  l->axis = -1;
  pb_status status = pb_reader_string(r, "axis", required, &text);
  if (status || !text) return status;
  for (int i = 0; i < 6; i++)
    if (!strcmp(axes[i], text)) l->axis = i;
  if (l->axis >= 0) return PB_OK;
  pb_reader_find(r, "axis", where);
  return pb_fail(err, PB_ERR_SCHEMA, where, "expected x, y, z, rx, ry or rz");
}

static pb_status read_number(const pb_reader *r, const char *key, size_t highest, bool required,
                             pb_gate_limit *l, pb_error *err) {
  char where[256];
  const cJSON *value = pb_reader_find(r, key, where);
  if (value) return pb_json_index(value, where, 1, highest, &l->number, err);
  if (!required) return PB_OK;
  return pb_fail(err, PB_ERR_SCHEMA, where, "missing; expected a number from 1 to %zu", highest);
}

// [low, high], low < high.
static pb_status read_pair(const pb_reader *r, const char *key, bool positive, pb_gate_limit *l,
                           pb_error *err) {
  char where[256];
  const cJSON *value = pb_reader_find(r, key, where);
  if (!value) return pb_fail(err, PB_ERR_SCHEMA, where, "missing; expected [low, high]");
  pb_status status = pb_json_numbers(value, where, 2, l->range, err);
  if (!status && !(l->range[0] < l->range[1] && (!positive || l->range[0] > 0)))
    status = pb_fail(err, PB_ERR_SCHEMA, where, "expected two ascending numbers%s",
                     positive ? " above 0" : "");
  return status;
}

static pb_status read_damped(const pb_reader *r, pb_gate_limit *l, pb_error *err) {
  char where[256];
  const cJSON *value = pb_reader_find(r, "damped", where);
  if (!cJSON_IsBool(value))
    return pb_fail(err, PB_ERR_SCHEMA, where, "%sexpected true or false", value ? "" : "missing; ");
  l->damped = cJSON_IsTrue(value);
  return PB_OK;
}

static pb_status read_further(const pb_reader *r, pb_gate_limit *l, pb_error *err) {
  const pb_gate_quantity q = l->quantity;
  const bool stroke = q == PB_GATE_STROKE;
  pb_status status = has_key(q, "axis") ? read_axis(r, l, !stroke, err) : PB_OK;
  if (!status && has_key(q, "number"))
    status = read_number(r, "number", 10000, q == PB_GATE_MODE, l, err);
  if (!status && has_key(q, "strut")) status = read_number(r, "strut", 6, false, l, err);
  if (!status && stroke && (l->axis >= 0) == (l->number > 0))
    status = pb_fail(err, PB_ERR_SCHEMA, r->own_pointer, "expected either axis or strut");
  if (!status && has_key(q, "range")) status = read_pair(r, "range", false, l, err);
  if (!status && has_key(q, "band")) status = read_pair(r, "band", true, l, err);
  if (!status && has_key(q, "damped")) status = read_damped(r, l, err);
  return status;
}

static pb_status read_limit(const cJSON *object, pb_gate_limit *l, pb_error *err) {
  pb_reader r;
  l->axis = -1;
  pb_status status = pb_reader_open(object, l->pointer, NULL, &r, err);
  if (!status) status = read_quantity(&r, &l->quantity, err);
  if (!status) status = check_keys(&r, l->quantity);
  if (!status) status = read_bounds(&r, l, err);
  return status ? status : read_further(&r, l, err);
}

static pb_status read_limits(const cJSON *list, pb_gate *out, pb_error *err) {
  if (!cJSON_IsArray(list) || !list->child)
    return pb_fail(err, PB_ERR_SCHEMA, "/limits", "%sexpected an array of limits",
                   list ? "" : "missing; ");
  out->limit = calloc((size_t)cJSON_GetArraySize(list), sizeof *out->limit);
  if (!out->limit) return pb_fail_memory(err, "/limits");
  pb_status status = PB_OK;
  for (const cJSON *item = list->child; item && !status; item = item->next) {
    pb_gate_limit *l = &out->limit[out->count++];
    snprintf(l->pointer, sizeof l->pointer, "/limits/%zu", out->count - 1);
    status = read_limit(item, l, err);
  }
  return status;
}

pb_status pb_gate_read(const cJSON *spec, pb_gate *out, pb_error *err) {
  static const char *const known[] = {"schema", "name", "limits", NULL};
  const char *schema, *name = NULL;
  pb_reader r;
  *out = (pb_gate){0};
  pb_status status = pb_reader_open(spec, "", NULL, &r, err);
  if (!status) status = pb_reader_known(&r, known, NULL, 0);
  if (!status) status = pb_reader_string(&r, "schema", true, &schema);
  if (!status && strcmp(schema, "plantbus.gate/1"))
    status = pb_fail(err, PB_ERR_SCHEMA, "/schema", "expected \"plantbus.gate/1\"");
  if (!status) status = pb_reader_string(&r, "name", true, &name);
  if (!status) out->name = pb_text_copy(name);
  if (!status && !out->name) status = pb_fail_memory(err, "/name");
  if (!status) status = read_limits(pb_json_member(spec, "limits"), out, err);
  if (status) pb_gate_clear(out);
  return status;
}

void pb_gate_clear(pb_gate *gate) {
  if (!gate) return;
  free(gate->name);
  free(gate->limit);
  *gate = (pb_gate){0};
}
