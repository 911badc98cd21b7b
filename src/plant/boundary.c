// The electrical boundary of a sensor stack: see boundary.h.
#include "plant/boundary.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"

double pb_boundary_stiffening(const pb_boundary *b) {
  if (b->kind == PB_BOUNDARY_SHORT) return 0;
  const double k2 = b->coupling * b->coupling;
  return b->stiffness * k2 / (1 - k2);
}

double pb_boundary_time(const pb_boundary *b) {
  if (b->kind != PB_BOUNDARY_RESISTOR) return 0;
  return b->resistance * b->capacitance * (1 - b->coupling * b->coupling);
}

// ---- the stack of an element --------------------------------------------------------------------

// Whether an interface frame lies between the two of the stack, on the line that joins them.
static bool between(const pb_element *e, const size_t end[2], size_t frame) {
  const double *a = e->position + 3 * end[0], *b = e->position + 3 * end[1];
  const double *p = e->position + 3 * frame;
  double length2 = 0, along = 0, off2 = 0;
  for (int i = 0; i < 3; i++) {
    length2 += (b[i] - a[i]) * (b[i] - a[i]);
    along += (b[i] - a[i]) * (p[i] - a[i]);
  }
  if (!(length2 > 0)) return false;
  along /= length2;
  for (int i = 0; i < 3; i++) {
    const double d = p[i] - a[i] - along * (b[i] - a[i]);
    off2 += d * d;
  }
  return along > 1e-6 && along < 1 - 1e-6 && off2 < 1e-6 * length2;
}

// What is free while one end moves and the other is held: frames on the way, and inner modes.
static size_t list_free(const pb_element *e, const size_t end[2], size_t *free_list) {
  size_t count = 0;
  for (size_t f = 0; f < e->frames; f++)
    for (size_t i = 0; i < 6 && between(e, end, f); i++) free_list[count++] = 6 * f + i;
  for (size_t i = 6 * e->frames; i < e->size; i++) free_list[count++] = i;
  return count;
}

static double along(const pb_element *e, size_t row, size_t frame, const double axis[3]) {
  double sum = 0;
  for (size_t i = 0; i < 3; i++) sum += axis[i] * e->k[row + (6 * frame + i) * e->size];
  return sum;
}

// k = −aᵀ(K_AB − K_Ao K_oo⁻¹ K_oB) a
static pb_status solve_stack(const pb_element *e, const size_t end[2], const double axis[3],
                             const size_t *o, size_t count, double *koo, double *x, double *k,
                             pb_error *err) {
  int n = (int)count, one = 1, info = 0;
  for (size_t j = 0; j < count; j++) {
    for (size_t i = 0; i < count; i++) koo[i + j * count] = e->k[o[i] + o[j] * e->size];
    x[j] = along(e, o[j], end[1], axis);
  }
  if (n) dpotrf_("U", &n, koo, &n, &info);
  if (!info && n) dpotrs_("U", &n, &one, koo, &n, x, &n, &info);
  if (info)
    return pb_fail(err, PB_ERR_ELEMENT, e->file, "what lies between a stack's frames is not held");
  *k = 0;
  for (size_t i = 0; i < 3; i++) *k -= axis[i] * along(e, 6 * end[0] + i, end[1], axis);
  for (size_t j = 0; j < count; j++) *k += along(e, o[j], end[0], axis) * x[j];
  if (*k > 0) return PB_OK;
  return pb_fail(err, PB_ERR_ELEMENT, e->file,
                 "between frames %zu and %zu there is no stiffness along the stack's axis",
                 end[0] + 1, end[1] + 1);
}

pb_status pb_element_stack_stiffness(const pb_element *e, const size_t frame[2],
                                     const double axis[3], double *stiffness, pb_error *err) {
  *stiffness = 0;
  size_t *list = malloc(e->size * sizeof *list);
  pb_status st = list ? PB_OK : pb_fail_memory(err, e->file);
  const size_t count = st ? 0 : list_free(e, frame, list);
  double *koo = malloc((count * count + 1) * sizeof *koo), *x = malloc((count + 1) * sizeof *x);
  double k = 0;
  if (!st && (!koo || !x)) st = pb_fail_memory(err, e->file);
  if (!st) st = solve_stack(e, frame, axis, list, count, koo, x, &k, err);
  if (!st) *stiffness = k;
  free(list);
  free(koo);
  free(x);
  return st;
}

// ---- the key ------------------------------------------------------------------------------------

static const pb_field fields[] = {
    {"coupling", offsetof(pb_boundary, coupling), PB_POSITIVE, false, 0},
    {"capacitance", offsetof(pb_boundary, capacitance), PB_POSITIVE, false, 0},
    {"stiffness", offsetof(pb_boundary, stiffness), PB_POSITIVE, false, 0},
};
enum { APA_FIELDS = 2, ELEMENT_FIELDS = 3 };  // an apa_2dof says its stiffness as k_e

// "short", "open" or {"resistance": R}
static pb_status read_kind(const pb_reader *r, pb_boundary *b) {
  static const char *const none[] = {NULL};
  static const pb_field resistance[] = {
      {"resistance", offsetof(pb_boundary, resistance), PB_POSITIVE, true, 0}};
  char where[256];
  pb_reader inner;
  const cJSON *value = pb_reader_find(r, "sensor", where);
  if (cJSON_IsString(value) && !strcmp(value->valuestring, "short")) {
    b->kind = PB_BOUNDARY_SHORT;
    return PB_OK;
  }
  if (cJSON_IsString(value) && !strcmp(value->valuestring, "open")) {
    b->kind = PB_BOUNDARY_OPEN;
    return PB_OK;
  }
  if (!cJSON_IsObject(value))
    return pb_fail(r->err, PB_ERR_SCHEMA, where,
                   "expected \"short\", \"open\" or {\"resistance\": ohms}");
  b->kind = PB_BOUNDARY_RESISTOR;
  pb_status st = pb_reader_open(value, where, NULL, &inner, r->err);
  if (!st) st = pb_reader_known(&inner, none, resistance, 1);
  return st ? st : pb_reader_fields(&inner, resistance, 1, b, false);
}

static pb_status check_values(const pb_reader *r, const pb_boundary *b) {
  char where[256];
  pb_reader_find(r, "coupling", where);
  if (b->kind != PB_BOUNDARY_SHORT && b->coupling == 0)
    return pb_fail(r->err, PB_ERR_SCHEMA, where,
                   "missing; expected the coupling k_33 of the stack");
  if (b->coupling >= 1)
    return pb_fail(r->err, PB_ERR_SCHEMA, where, "expected a coupling below 1, not %g",
                   b->coupling);
  pb_reader_find(r, "capacitance", where);
  if (b->kind == PB_BOUNDARY_RESISTOR && b->capacitance == 0)
    return pb_fail(r->err, PB_ERR_SCHEMA, where,
                   "missing; a resistor needs the capacitance of the free stack");
  return PB_OK;
}

static pb_status element_stiffness(const pb_reader *r, const char *pointer, pb_component *c) {
  const pb_stack *s = &c->super.sensor;
  if (!s->present)
    return pb_fail(r->err, PB_ERR_SCHEMA, pointer,
                   "the component has no sensor stack (\"stacks\")");
  if (c->boundary.stiffness > 0) return PB_OK;
  const size_t node[2] = {c->frame[s->frame[0]].node, c->frame[s->frame[1]].node};
  pb_error inner = {0};
  pb_status st =
      pb_element_stack_stiffness(c->super.element, node, s->axis, &c->boundary.stiffness, &inner);
  if (!st) return PB_OK;
  return pb_fail(r->err, st, pointer, "%.300s; give its \"stiffness\"", inner.message);
}

pb_status pb_loader_boundary(const pb_reader *r, pb_component *c) {
  static const char *const known[] = {"sensor", NULL};
  char where[256];
  pb_reader inner;
  const cJSON *object = pb_reader_find(r, "boundary", where);
  if (!object) return PB_OK;
  const bool apa = c->type == PB_APA_2DOF;
  const size_t count = apa ? APA_FIELDS : ELEMENT_FIELDS;
  pb_boundary *b = &c->boundary;
  pb_status st = pb_reader_open(object, where, NULL, &inner, r->err);
  if (!st) st = pb_reader_known(&inner, known, fields, count);
  if (!st) st = pb_reader_fields(&inner, fields, count, b, false);
  if (!st) st = read_kind(&inner, b);
  if (!st) st = check_values(&inner, b);
  if (st) return st;
  if (!apa) return element_stiffness(&inner, where, c);
  b->stiffness = c->strut.k_e;
  if (b->kind == PB_BOUNDARY_RESISTOR && !(b->stiffness > 0))
    return pb_fail(r->err, PB_ERR_SCHEMA, where, "a sensor stack with k_e = 0 carries no resistor");
  return PB_OK;
}
