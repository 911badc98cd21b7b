// What a part's element is known by: see characteristics.h.
#include "part/characteristics.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"

static const double two_pi = 6.283185307179586476925286766559;

static const pb_characteristic actuator_list[] = {{"mass", "kg", 0},
                                                  {"axial_stiffness", "N/m", 0},
                                                  {"axial_mode", "Hz", 0},
                                                  {"amplification", "", 0},
                                                  {"stroke", "m", 0},
                                                  {"blocked_force", "N", 0},
                                                  {"stack_stiffness", "N/m", 0}};
static const pb_characteristic joint_list[] = {{"mass", "kg", 0},
                                               {"axial_stiffness", "N/m", 0},
                                               {"shear_stiffness", "N/m", 0},
                                               {"bending_stiffness", "N m/rad", 0},
                                               {"torsion_stiffness", "N m/rad", 0}};

static const pb_characteristic *list_of(pb_part_type type, size_t *count) {
  bool joint = type == PB_PART_FLEXIBLE_JOINT;
  *count =
      joint ? sizeof joint_list / sizeof *joint_list : sizeof actuator_list / sizeof *actuator_list;
  return joint ? joint_list : actuator_list;
}

bool pb_characteristic_known(pb_part_type type, const char *name) {
  size_t count;
  const pb_characteristic *list = list_of(type, &count);
  for (size_t i = 0; i < count; i++)
    if (!strcmp(list[i].name, name)) return true;
  return false;
}

// K or M without the six rows and columns of one frame. NULL: out of memory.
static double *without_frame(const double *x, size_t n, size_t frame) {
  double *out = malloc((n - 6) * (n - 6) * sizeof *out), *next = out;
  for (size_t j = 0; out && j < n; j++) {
    if (j / 6 == frame) continue;
    for (size_t i = 0; i < n; i++)
      if (i / 6 != frame) *next++ = x[i + j * n];
  }
  return out;
}

// Motions of the element under `loads` columns of forces, `frame` held; forces without its rows.
static pb_status solve_held(const pb_reduction *e, size_t frame, int loads, double *force,
                            pb_error *err) {
  int n = (int)e->size - 6, info = 0;
  double *k = without_frame(e->k, e->size, frame);
  if (!k) return pb_fail_memory(err, "characteristics");
  dpotrf_("U", &n, k, &n, &info);
  if (!info) dpotrs_("U", &n, &loads, k, &n, force, &n, &info);
  free(k);
  return info ? pb_fail(err, PB_ERR_SINGULAR, "characteristics",
                        "the element held at one frame is not stiff in every direction")
              : PB_OK;
}

pb_status pb_element_held_modes(const pb_reduction *e, size_t frame, double *hz, double *shape,
                                pb_error *err) {
  int n = (int)e->size - 6, itype = 1, info = 0, lwork = 1 + 6 * n + 2 * n * n, liwork = 3 + 5 * n;
  size_t size = (size_t)n;
  double *k = without_frame(e->k, e->size, frame), *m = without_frame(e->m, e->size, frame);
  double *work = malloc((size_t)lwork * sizeof *work);
  int *iwork = malloc((size_t)liwork * sizeof *iwork);
  pb_status st = k && m && work && iwork ? PB_OK : pb_fail_memory(err, "characteristics");
  if (!st) {
    dsygvd_(&itype, "V", "U", &n, k, &n, m, &n, hz, work, &lwork, iwork, &liwork, &info);
    if (info) st = pb_fail(err, PB_ERR_NUMERIC, "characteristics", "the modes did not converge");
  }
  for (size_t mode = 0; !st && mode < size; mode++) {
    hz[mode] = sqrt(fmax(hz[mode], 0)) / two_pi;
    double *to = shape + mode * e->size;
    for (size_t i = 0, at = 0; i < e->size; i++) to[i] = i / 6 == frame ? 0 : k[at++ + mode * size];
  }
  free(k);
  free(m);
  free(work);
  free(iwork);
  return st;
}

// The frequency of the mode with the largest effective mass along z, frame 0 held.
static pb_status axial_mode(const pb_reduction *e, double *axial, pb_error *err) {
  size_t n = e->size, modes = n - 6;
  double *hz = malloc(modes * sizeof *hz), *shape = malloc(n * modes * sizeof *shape);
  double *push = calloc(n, sizeof *push), most = -1;
  pb_status st = hz && shape && push ? PB_OK : pb_fail_memory(err, "characteristics");
  for (size_t j = 0; !st && j < e->frames; j++)  // M R, R: all frames along z, modal rows at rest
    for (size_t i = 0; i < n; i++) push[i] += e->m[i + (6 * j + 2) * n];
  if (!st) st = pb_element_held_modes(e, 0, hz, shape, err);
  for (size_t mode = 0; !st && mode < modes; mode++) {
    double share = 0;
    for (size_t i = 0; i < n; i++) share += shape[i + mode * n] * push[i];
    if (share * share <= most) continue;
    most = share * share;
    *axial = hz[mode];
  }
  free(hz);
  free(shape);
  free(push);
  return st;
}

// Row of direction 0…5 of a frame when frame 0 is left out.
static size_t row(size_t frame, size_t direction) {
  return 6 * (frame - 1) + direction;
}

static pb_status actuator(const pb_part *part, const pb_reduction *e, pb_characteristic *out,
                          pb_error *err) {
  size_t n = e->size - 6;
  double *u = calloc(2 * n, sizeof *u), hz = 0;
  if (!u) return pb_fail_memory(err, "characteristics");
  u[row(1, 2)] = 1;
  for (int stacks = 0; stacks < 2; stacks++) {
    u[n + row(stacks ? 4 : 2, 0)] = -1;
    u[n + row(stacks ? 6 : 3, 0)] = 1;
  }
  pb_status st = solve_held(e, 0, 2, u, err);
  if (!st) st = axial_mode(e, &hz, err);
  if (!st) {
    double stiffness = 1 / u[row(1, 2)];
    double elongation = u[n + row(6, 0)] - u[n + row(2, 0)];
    double amplification = fabs(u[n + row(1, 2)] / elongation);
    double stroke = amplification * 1e-3 * 3 * part->actuator.stack_length;
    double value[] = {e->mass,
                      stiffness,
                      hz,
                      amplification,
                      stroke,
                      stiffness * stroke,
                      -e->k[12 + 18 * e->size]};
    for (size_t i = 0; i < sizeof value / sizeof *value; i++) out[i].value = value[i];
  }
  free(u);
  return st;
}

static pb_status joint(const pb_reduction *e, pb_characteristic *out, pb_error *err) {
  size_t n = e->size - 6;
  double *u = calloc(6 * n, sizeof *u);
  if (!u) return pb_fail_memory(err, "characteristics");
  for (size_t i = 0; i < 6; i++) u[i + i * n] = 1;
  pb_status st = solve_held(e, 1, 6, u, err);
  if (!st) {
    double k[6];
    for (size_t i = 0; i < 6; i++) k[i] = 1 / u[i + i * n];
    double value[] = {e->mass, k[2], 0.5 * (k[0] + k[1]), 0.5 * (k[3] + k[4]), k[5]};
    for (size_t i = 0; i < sizeof value / sizeof *value; i++) out[i].value = value[i];
  }
  free(u);
  return st;
}

pb_status pb_part_characteristics(const pb_part *part, const pb_reduction *element,
                                  pb_characteristic out[PB_CHARACTERISTICS], size_t *count,
                                  pb_error *err) {
  const pb_characteristic *list = list_of(part->type, count);
  memcpy(out, list, *count * sizeof *out);
  pb_status st = part->type == PB_PART_FLEXIBLE_JOINT ? joint(element, out, err)
                                                      : actuator(part, element, out, err);
  if (st) *count = 0;
  return st;
}
