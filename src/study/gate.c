// A plant held against a specification: see gate.h.
#include "study/gate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "signal/small_solve.h"
#include "study/file_model.h"
#include "study/point.h"

enum { N = 6, LINES = 200 };

// A plant under judgement; its hexapod's analysis is done when a limit asks for it, and again only
// for another band.
typedef struct judgement {
  const cJSON *file;
  const char *directory;
  pb_model *model;
  double *dc;  // [ny][nu]
  pb_hexapod_channels channels;
  bool has_channels;
  pb_study_point point;
  bool has_point;
} judgement;

// An answer that needs what the plant lacks fails at the limit that asks for it.
static pb_status at_limit(const pb_gate_limit *l, pb_status status, pb_error *err) {
  if (status == PB_OK) return PB_OK;
  char message[sizeof err->message], where[sizeof err->where];
  memcpy(message, err->message, sizeof message);
  memcpy(where, err->where, sizeof where);
  return pb_fail(err, status, l->pointer, "%.100s: %.380s", where, message);
}

static pb_status need_channels(judgement *j, pb_error *err) {
  pb_status status =
      j->has_channels ? PB_OK : pb_hexapod_channels_find(j->model, &j->channels, err);
  j->has_channels = status == PB_OK;
  return status;
}

// band NULL: any.
static pb_status need_point(judgement *j, const double *band, pb_error *err) {
  const double any[2] = {1, 500};
  if (j->has_point && (!band || (j->point.hz[0] == band[0] && band[1] == j->point.hz[LINES - 1])))
    return PB_OK;
  if (!band) band = any;
  const pb_study_options o = {.from = band[0], .to = band[1], .points = LINES};
  pb_study_point_clear(&j->point);
  pb_status status = pb_study_point_find(j->file, j->directory, &o, &j->point, err);
  j->has_point = status == PB_OK;
  return status;
}

// ---- static quantities --------------------------------------------------------------------------

static const char *const load_name[N] = {"Fx", "Fy", "Fz", "Mx", "My", "Mz"};
static const char *const motion_name[N] = {"Dx", "Dy", "Dz", "Rx", "Ry", "Rz"};

static pb_status find_signal(const pb_model *m, const char *name, bool input, size_t *out,
                             pb_error *err) {
  return pb_signal_find(input ? m->input : m->output, input ? m->nu : m->ny,
                        input ? "input" : "output", name, name, out, err);
}

static pb_status stiffness(judgement *j, const pb_gate_limit *l, double *value, pb_error *err) {
  size_t load = 0, motion = 0;
  pb_status status = find_signal(j->model, load_name[l->axis], true, &load, err);
  if (!status) status = find_signal(j->model, motion_name[l->axis], false, &motion, err);
  if (!status) *value = 1 / j->dc[motion * j->model->nu + load];
  return status;
}

// Motion per applied unit of an actuator: its amplifier's gain is not the actuator's.
static double applied_gain(const judgement *j, size_t output, size_t strut) {
  const pb_model *m = j->model;
  size_t input = j->channels.input[strut];
  double gain = m->input_electronics ? m->input_electronics[input].gain : 1;
  return j->dc[output * m->nu + input] / gain;
}

// v = G⁻¹ e_axis makes the pure motion of size 1; the actuator that moves most sets how far it
// goes.
static pb_status stroke(judgement *j, const pb_gate_limit *l, double *value, pb_error *err) {
  const double width = l->range[1] - l->range[0];
  double complex g[N * N], v[N] = {0};
  double most = 0;
  pb_status status = need_channels(j, err);
  if (status) return status;
  if (l->axis < 0) {
    *value = width * fabs(applied_gain(j, j->channels.metrology[l->number - 1], l->number - 1));
    return PB_OK;
  }
  for (size_t r = 0; r < N && !status; r++) {
    size_t output = 0;
    status = find_signal(j->model, motion_name[r], false, &output, err);
    for (size_t c = 0; c < N && !status; c++) g[r + c * N] = applied_gain(j, output, c);
  }
  if (status) return status;
  v[l->axis] = 1;
  if (!pb_small_solve(N, 1, g, v))
    return pb_fail(err, PB_ERR_SINGULAR, "actuators", "they cannot move the platform all ways");
  for (size_t c = 0; c < N; c++) most = fmax(most, cabs(v[c]));
  *value = width / most;
  return PB_OK;
}

static pb_status mode(judgement *j, const pb_gate_limit *l, double *value, pb_error *err) {
  if (l->number > j->model->modes)
    return pb_fail(err, PB_ERR_STATE, "mode", "the plant has %zu", j->model->modes);
  *value = j->model->mode_hz[l->number - 1];
  return PB_OK;
}

// ---- with control -------------------------------------------------------------------------------

static pb_status attainable(judgement *j, const pb_gate_limit *l, double *value, pb_error *err) {
  pb_status status = need_point(j, NULL, err);
  if (status) return status;
  if (l->number > j->point.size.modes)
    return pb_fail(err, PB_ERR_STATE, "mode", "IFF is judged on %zu modes", j->point.size.modes);
  *value = l->number ? j->point.attainable[l->number - 1] : j->point.smallest_attainable;
  return PB_OK;
}

static pb_status coupling(judgement *j, const pb_gate_limit *l, double *value, pb_error *err) {
  pb_status status = need_point(j, l->range, err);
  *value = 0;
  for (size_t f = 0; f < LINES && !status; f++)
    *value = fmax(*value, l->damped ? j->point.rga[f] : j->point.rga_open[f]);
  return status;
}

static pb_status find_value(judgement *j, const pb_gate_limit *l, double *value, pb_error *err) {
  pb_status status = PB_OK;
  switch (l->quantity) {
  case PB_GATE_STIFFNESS:
    return stiffness(j, l, value, err);
  case PB_GATE_MODE:
    return mode(j, l, value, err);
  case PB_GATE_STROKE:
    return stroke(j, l, value, err);
  case PB_GATE_ATTAINABLE:
    return attainable(j, l, value, err);
  case PB_GATE_COUPLING:
    return coupling(j, l, value, err);
  case PB_GATE_DAMPING:
    status = need_point(j, NULL, err);
    if (!status && j->point.stable.gain > 0) *value = j->point.stable.smallest;
    return status;
  case PB_GATE_STRUTS:
    status = need_point(j, NULL, err);
    if (!status) *value = j->point.struts.margin;
    return status;
  default:
    *value = (double)j->model->nx;
    return PB_OK;
  }
}

// ---- the verdict --------------------------------------------------------------------------------

static void judge(pb_gate_limit *l) {
  double above = isnan(l->min) ? INFINITY : l->value / l->min - 1;
  double below = isnan(l->max) ? INFINITY : 1 - l->value / l->max;
  l->margin = isnan(l->value) ? NAN : fmin(above, below);
  l->passed = l->margin >= 0;
}

pb_status pb_gate_judge(pb_gate *gate, const cJSON *plant, const char *directory, pb_error *err) {
  judgement j = {.file = plant, .directory = directory};
  bool passed = true;
  pb_status status = pb_file_model(plant, directory, &j.model, err);
  if (!status) {
    j.dc = malloc((j.model->ny * j.model->nu + 1) * sizeof *j.dc);
    status = j.dc ? pb_model_dc(j.model, j.dc, err) : pb_fail_memory(err, "gate");
  }
  for (size_t k = 0; k < gate->count && !status; k++) {
    pb_gate_limit *l = &gate->limit[k];
    l->value = NAN;
    status = at_limit(l, find_value(&j, l, &l->value, err), err);
    judge(l);
    passed = passed && l->passed;
  }
  gate->passed = passed && !status;
  pb_study_point_clear(&j.point);
  free(j.dc);
  pb_model_free(j.model);
  return status;
}
