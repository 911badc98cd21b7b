// Specifications: see element_limits.h.
#include "study/element_limits.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "plant/reader.h"

static const pb_quantity quantities[] = {
    {"stroke", "stroke", "µm", 1e6},
    {"stiffness", "axial stiffness", "N/µm", 1e-6},
    {"resolution", "resolution", "nm", 1e9},
    {"blocked_force", "blocked force", "N", 1},
    {"height", "height", "mm", 1e3},
    {"mass", "mass", "g", 1e3},
    {"resonance", "first resonance", "Hz", 1},
    {"stack_stiffness", "stack stiffness", "N/µm", 1e-6},
    {"axial_stiffness", "axial stiffness k_a", "N/µm", 1e-6},
    {"shear_stiffness", "shear stiffness k_s", "N/µm", 1e-6},
    {"bending_stiffness", "bending stiffness k_f", "Nm/rad", 1},
    {"torsion_stiffness", "torsion stiffness k_t", "Nm/rad", 1},
    {"bending_stroke", "bending stroke", "mrad", 1e3},
};

const pb_quantity *pb_quantity_find(const char *key) {
  for (size_t i = 0; i < sizeof quantities / sizeof *quantities; i++)
    if (!strcmp(quantities[i].key, key)) return &quantities[i];
  return NULL;
}

void pb_limits_clear(pb_limits *l) {
  free(l->name);
  free(l->limit);
  *l = (pb_limits){0};
}

typedef struct bounds {
  double above, below, about, factor;
} bounds;

static const pb_field bound_fields[] = {
    {"above", offsetof(bounds, above), PB_ANY, false, NAN},
    {"below", offsetof(bounds, below), PB_ANY, false, NAN},
    {"about", offsetof(bounds, about), PB_POSITIVE, false, NAN},
    {"factor", offsetof(bounds, factor), PB_POSITIVE, false, NAN},
};

static pb_status read_limit(const cJSON *item, const char *where, const char *const *known,
                            pb_limit *out, pb_error *err) {
  static const char *const none[] = {NULL};
  pb_reader r;
  bounds b;
  while (*known && strcmp(*known, item->string)) known++;
  *out = (pb_limit){pb_quantity_find(item->string), -INFINITY, INFINITY, false};
  if (!*known || !out->quantity)
    return pb_fail(err, PB_ERR_SCHEMA, where, "is no quantity that this tool knows");
  pb_status st = pb_reader_open(item, where, NULL, &r, err);
  if (!st) st = pb_reader_known(&r, none, bound_fields, 4);
  if (!st) st = pb_reader_fields(&r, bound_fields, 4, &b, false);
  if (st) return st;
  out->about = !isnan(b.about);
  if (out->about ? !isnan(b.above) || !isnan(b.below) || !(b.factor > 1) : !isnan(b.factor))
    return pb_fail(err, PB_ERR_SCHEMA, where,
                   "expected \"above\" or \"below\" or both, or \"about\" with a \"factor\" > 1");
  if (!isnan(b.above)) out->low = b.above;
  if (!isnan(b.below)) out->high = b.below;
  if (out->about) out->low = b.about / b.factor, out->high = b.about * b.factor;
  if (!isfinite(out->low) && !isfinite(out->high))
    return pb_fail(err, PB_ERR_SCHEMA, where, "limits nothing");
  if (!(out->low < out->high))
    return pb_fail(err, PB_ERR_SCHEMA, where, "no value is above %g and below %g", out->low,
                   out->high);
  return PB_OK;
}

pb_status pb_limits_read(const cJSON *file, const char *const *known, pb_limits *out,
                         pb_error *err) {
  static const char *const keys[] = {"schema", "name", "source", "limits", NULL};
  const char *name = NULL, *schema = NULL;
  char where[256], at[256];
  pb_reader r;
  *out = (pb_limits){0};
  pb_status st = pb_reader_open(file, "", NULL, &r, err);
  if (!st) st = pb_reader_known(&r, keys, NULL, 0);
  if (!st) st = pb_reader_string(&r, "schema", true, &schema);
  if (!st && strcmp(schema, "plantbus.specification/1"))
    st = pb_fail(err, PB_ERR_SCHEMA, "/schema", "expected \"plantbus.specification/1\"");
  if (!st) st = pb_reader_string(&r, "name", true, &name);
  if (st) return st;
  const cJSON *limits = pb_reader_find(&r, "limits", where);
  if (!cJSON_IsObject(limits) || !limits->child)
    return pb_fail(err, PB_ERR_SCHEMA, where, "expected an object with at least one limit");
  out->name = pb_text_copy(name);
  out->limit = calloc((size_t)cJSON_GetArraySize(limits), sizeof *out->limit);
  if (!out->name || !out->limit) st = pb_fail_memory(err, where);
  for (const cJSON *item = limits->child; item && !st; item = item->next) {
    pb_json_pointer(at, sizeof at, where, item->string);
    st = read_limit(item, at, known, &out->limit[out->count], err);
    if (!st) out->count++;
  }
  if (st) pb_limits_clear(out);
  return st;
}

pb_verdict pb_limit_judge(const pb_limit *l, double value, double *margin) {
  *margin = NAN;
  if (isnan(value)) return PB_UNKNOWN;
  double low = INFINITY, high = INFINITY;
  if (isfinite(l->low)) low = (value - l->low) / fabs(l->low);
  if (isfinite(l->high)) high = (l->high - value) / fabs(l->high);
  *margin = fmin(low, high);
  // A locked direction is infinitely stiff: above every limit.
  const bool met =
      l->about ? *margin >= -1e-12
               : (!isfinite(l->low) || value > l->low) && (!isfinite(l->high) || value < l->high);
  return met ? PB_MET : PB_MISSED;
}

void pb_limit_text(const pb_limit *l, char *text, size_t size) {
  const double low = l->low * l->quantity->scale, high = l->high * l->quantity->scale;
  const char *unit = l->quantity->unit;
  if (isfinite(low) && isfinite(high))
    snprintf(text, size, "%.4g … %.4g %s", low, high, unit);
  else if (isfinite(low))
    snprintf(text, size, "> %.4g %s", low, unit);
  else
    snprintf(text, size, "< %.4g %s", high, unit);
}
