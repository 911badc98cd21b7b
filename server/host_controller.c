// Reading controllers: integral force feedback and general state space. See host_item.h.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "control/iff.h"
#include "control/lti_ops.h"
#include "host_item.h"
#include "model/block.h"
#include "request_body.h"

static pb_status parts_new(pb_host_def *def, size_t parts, pb_error *err) {
  def->part = calloc(parts, sizeof *def->part);
  if (!def->part) return pb_fail_memory(err, "host");
  def->parts = parts;
  return PB_OK;
}

// What a library call refused, as an error of the request.
static pb_status refuse_inner(pb_error *err, const char *where, pb_status status,
                              const pb_error *inner) {
  if (status == PB_ERR_MEMORY) return pb_fail_memory(err, "host");
  return pb_fail(err, PB_ERR_SCHEMA, where, "%s", inner->message);
}

static pb_status gains_read(const pb_host_reader *r, double *gain, pb_error *err) {
  const cJSON *item = pb_json_member(r->body, "gain");
  const size_t pairs = r->def->inputs;
  if (cJSON_IsNumber(item) && isfinite(item->valuedouble)) {
    for (size_t i = 0; i < pairs; i++) gain[i] = item->valuedouble;
    return PB_OK;
  }
  if (!cJSON_IsArray(item) || (size_t)cJSON_GetArraySize(item) != pairs)
    return pb_fail(err, PB_ERR_SCHEMA, "/gain", "expected a number or an array of %zu", pairs);
  size_t i = 0;
  for (const cJSON *value = item->child; value; value = value->next, i++) {
    char where[32];
    snprintf(where, sizeof where, "/gain/%zu", i);
    if (!cJSON_IsNumber(value) || !isfinite(value->valuedouble))
      return pb_fail(err, PB_ERR_SCHEMA, where, "expected a number");
    gain[i] = value->valuedouble;
  }
  return PB_OK;
}

static bool lti_finite(const pb_lti *lti) {
  return pb_all_finite(lti->a, lti->nx * lti->nx) && pb_all_finite(lti->b, lti->nx * lti->nu) &&
         pb_all_finite(lti->c, lti->ny * lti->nx) && pb_all_finite(lti->d, lti->ny * lti->nu);
}

// One part a pair of output and input: the matrices of all of them together would be mostly zeros.
pb_status pb_host_read_iff(const pb_host_reader *r, pb_error *err) {
  pb_host_def *def = r->def;
  double gain[PB_STEPPER_INPUTS];
  pb_iff iff = pb_iff_default(0);
  if (def->outputs != def->inputs)
    return pb_fail(err, PB_ERR_SCHEMA, "/outputs", "expected as many outputs as inputs (%zu)",
                   def->inputs);
  pb_status status = gains_read(r, gain, err);
  if (!status)
    status = pb_host_read_positive(r->body, "integrator_hz", false, &iff.integrator_hz, err);
  if (!status) status = pb_host_read_positive(r->body, "highpass_hz", false, &iff.highpass_hz, err);
  if (!status) status = parts_new(def, def->inputs, err);
  for (size_t i = 0; i < def->parts && !status; i++) {
    pb_error inner = {0};
    iff.gain = gain[i];
    status = pb_iff_discrete(&iff, 1, r->sample_rate, &def->part[i], &inner);
    if (status) return refuse_inner(err, "/integrator_hz", status, &inner);
    if (!lti_finite(&def->part[i]))
      return pb_fail(err, PB_ERR_SCHEMA, "/gain", "is too large for a double");
  }
  return status;
}

// An array of rows into m, rows × columns; a matrix without entries may be absent or empty.
static pb_status matrix_read(const cJSON *body, const char *key, size_t rows, size_t columns,
                             bool required, double *m, pb_error *err) {
  const cJSON *item = pb_json_member(body, key);
  const bool empty = rows == 0 || columns == 0;
  if (!item && (empty || !required)) return PB_OK;
  if (empty && cJSON_IsArray(item) && !item->child) return PB_OK;
  if (!cJSON_IsArray(item) || (size_t)cJSON_GetArraySize(item) != rows) {
    char where[8];
    snprintf(where, sizeof where, "/%s", key);
    return pb_fail(err, PB_ERR_SCHEMA, where, "expected an array of %zu rows of %zu numbers", rows,
                   columns);
  }
  size_t i = 0;
  for (const cJSON *row = item->child; row; row = row->next, i++) {
    const pb_status status = pb_host_read_row(row, key, i, columns, m + i, rows, err);
    if (status) return status;
  }
  return PB_OK;
}

// Without "a" the controller has no states, and needs neither b nor c.
static pb_status states_read(const cJSON *body, size_t *states, pb_error *err) {
  const cJSON *a = pb_json_member(body, "a");
  *states = 0;
  if (!a && !pb_json_member(body, "b") && !pb_json_member(body, "c")) return PB_OK;
  if (!cJSON_IsArray(a))
    return pb_fail(err, PB_ERR_SCHEMA, "/a",
                   "expected an array of rows, empty for a controller without states");
  const int rows = cJSON_GetArraySize(a);
  if (rows > PB_HOST_STATES)
    return pb_fail(err, PB_ERR_SCHEMA, "/a", "%d states, at most %d", rows, PB_HOST_STATES);
  *states = (size_t)rows;
  return PB_OK;
}

// From which time base to the plant's: *discrete when the matrices are at its rate already.
static pb_status time_read(const pb_host_reader *r, bool *discrete, pb_c2d_method *method,
                           pb_error *err) {
  double dt = 0;
  const char *name = NULL;
  pb_status status = pb_host_read_number(r->body, "dt", false, &dt, err);
  if (!status) status = pb_body_string(r->body, "method", false, &name, err);
  if (status) return status;
  if (dt != 0 && !(fabs(dt * r->sample_rate - 1) <= 1e-9))
    return pb_fail(err, PB_ERR_SCHEMA, "/dt",
                   "expected 0 (continuous) or the plant's sample period, %.12g s",
                   1 / r->sample_rate);
  *discrete = dt != 0;
  *method = PB_C2D_TUSTIN;
  if (!name) return PB_OK;
  if (*discrete)
    return pb_fail(err, PB_ERR_SCHEMA, "/method", "only a continuous system is made discrete");
  if (strcmp(name, "zoh") == 0) {
    *method = PB_C2D_ZOH;
  } else if (strcmp(name, "tustin") != 0) {
    return pb_fail(err, PB_ERR_SCHEMA, "/method", "expected \"tustin\" or \"zoh\"");
  }
  return PB_OK;
}

static pb_status make_discrete(const pb_host_reader *r, const pb_lti *given, pb_error *err) {
  bool discrete = false;
  pb_c2d_method method = PB_C2D_TUSTIN;
  pb_error inner = {0};
  pb_status status = time_read(r, &discrete, &method, err);
  if (!status) status = parts_new(r->def, 1, err);
  if (status) return status;
  pb_lti *part = &r->def->part[0];
  const double dt = 1 / r->sample_rate;
  status =
      discrete ? pb_lti_copy(given, part, &inner) : pb_lti_c2d(given, dt, method, part, &inner);
  if (status) return refuse_inner(err, "/a", status, &inner);
  part->dt = dt;
  if (!lti_finite(part))
    return pb_fail(err, PB_ERR_SCHEMA, "/a", "the discrete system is not finite");
  return PB_OK;
}

pb_status pb_host_read_lti(const pb_host_reader *r, pb_error *err) {
  const size_t nu = r->def->outputs, ny = r->def->inputs;  // of the controller
  size_t nx = 0;
  pb_lti given = {0};
  pb_status status = states_read(r->body, &nx, err);
  if (!status) status = pb_lti_new(nx, nu, ny, 0, &given, err);
  if (!status) status = matrix_read(r->body, "a", nx, nx, nx > 0, given.a, err);
  if (!status) status = matrix_read(r->body, "b", nx, nu, nx > 0, given.b, err);
  if (!status) status = matrix_read(r->body, "c", ny, nx, nx > 0, given.c, err);
  if (!status) status = matrix_read(r->body, "d", ny, nu, nx == 0, given.d, err);
  if (!status) status = make_discrete(r, &given, err);
  pb_lti_free(&given);
  return status;
}
