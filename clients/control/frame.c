// The coordinates in which HAC's loops are closed, and the Jacobian between them.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/json.h"
#include "control/jacobian.h"
#include "control_tool.h"

// J of the template, when the plant is one and the loops are its six struts in order.
static pb_status from_geometry(const control_design *d, double *j, bool *found, pb_error *err) {
  const char *text = d->plant->bench.description->plant_text;
  *found = false;
  for (size_t k = 0; k < d->n; k++) {
    char name[8];
    snprintf(name, sizeof name, "dL%zu", k + 1);
    if (d->n != 6 || strcmp(d->model->output[d->metrology[k]].name, name) != 0) return PB_OK;
  }
  cJSON *file = NULL;
  pb_hexapod hexapod;
  pb_status status = pb_json_parse(text, strlen(text), &file, err);
  if (status == PB_OK && pb_json_member(file, "template")) {
    status = pb_hexapod_read(file, &hexapod, err);
    if (status == PB_OK) pb_jacobian_geometry(&hexapod, j);
    *found = status == PB_OK;
  }
  cJSON_Delete(file);
  return status;
}

static pb_status from_gains(const control_design *d, double *j, pb_error *err) {
  if (d->motions != d->n || d->disturbances != d->n) {
    return pb_fail(err, PB_ERR_STATE, "--frame",
                   "%zu struts, %zu motions and %zu forces at the point of interest: a Jacobian "
                   "from static gains needs as many of each",
                   d->n, d->motions, d->disturbances);
  }
  return pb_jacobian_static(d->model, d->metrology, d->motion, d->disturbance, d->n, j, err);
}

static double difference(const double *a, const double *b, size_t n) {
  double worst = 0, largest = 0;
  for (size_t k = 0; k < n * n; k++) {
    worst = fmax(worst, fabs(a[k] - b[k]));
    largest = fmax(largest, fabs(a[k]));
  }
  return worst / largest;
}

// A template whose parts the file moves has another Jacobian than its geometry says.
static pb_status check_difference(const control_design *d, pb_error *err) {
  const control_frame *f = &d->frame;
  if (!(f->difference > 1e-3) || d->options->jacobian != JACOBIAN_AUTO) return PB_OK;
  return pb_fail(err, PB_ERR_GEOMETRY, "--jacobian",
                 "the template's geometry and the static gains differ by %.3g of the largest "
                 "entry: say which one, geometry or static",
                 f->difference);
}

// *other: the one that is not used, to compare with.
static pb_status find_jacobian(control_design *d, double *j, double *other, pb_error *err) {
  control_frame *f = &d->frame;
  jacobian_source wanted = d->options->jacobian;
  bool geometry = false;
  pb_error ignored;
  pb_status status = from_geometry(d, j, &geometry, err);
  if (status != PB_OK) return status;
  if (wanted == JACOBIAN_GEOMETRY && !geometry) {
    return pb_fail(err, PB_ERR_STATE, "--jacobian",
                   "the plant is no template of six struts with metrology dL1 … dL6");
  }
  if (wanted == JACOBIAN_STATIC || !geometry) {
    f->source = "static gains";
    status = from_gains(d, other, err);
    f->difference = status == PB_OK && geometry ? difference(j, other, d->n) : NAN;
    if (status == PB_OK) memcpy(j, other, d->n * d->n * sizeof *j);
    return status;
  }
  f->source = "geometry";
  f->difference = from_gains(d, other, &ignored) == PB_OK ? difference(j, other, d->n) : NAN;
  return check_difference(d, err);
}

pb_status control_make_frame(control_design *d, pb_error *err) {
  control_frame *f = &d->frame;
  size_t n = d->n;
  f->cartesian = d->options->cartesian;
  if (!f->cartesian) return PB_OK;
  f->j = malloc(n * n * sizeof *f->j);
  f->inverse = malloc(n * n * sizeof *f->inverse);
  f->inverse_t = malloc(n * n * sizeof *f->inverse_t);
  if (!f->j || !f->inverse || !f->inverse_t) return pb_fail_memory(err, "jacobian");
  pb_status status = find_jacobian(d, f->j, f->inverse, err);
  if (status == PB_OK) status = pb_jacobian_invert(f->j, n, f->inverse, &f->condition, err);
  if (status != PB_OK) return status;
  for (size_t k = 0; k < n * n; k++) f->inverse_t[k] = f->inverse[k / n + (k % n) * n];
  f->transform = (pb_hac_frame){f->inverse, f->inverse_t};
  return PB_OK;
}

void control_frame_clear(control_frame *f) {
  free(f->j);
  free(f->inverse);
  free(f->inverse_t);
  *f = (control_frame){0};
}
