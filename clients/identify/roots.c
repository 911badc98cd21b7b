// Exact modes and zeros of the published model: see roots.h.
#include "roots.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model/sampled_roots.h"

pb_status pb_all_poles(const pb_model *model, pb_pole_list *out, pb_error *err) {
  *out = (pb_pole_list){0};
  double complex *s = malloc((model->nx + 1) * sizeof *s);
  out->item = malloc((model->nx + 1) * sizeof *out->item);
  pb_status status =
      s && out->item ? pb_model_poles(model, PB_CONTINUOUS, s, err) : pb_fail_memory(err, "poles");
  for (size_t k = 0; k < model->nx && status == PB_OK; k++) {
    if (cimag(s[k]) < 0) continue;
    // From s, not from z: above Nyquist z is another mode's.
    double size = cabs(s[k]);
    out->item[out->count++] = (pb_pole){.z = cexp(s[k] / model->sample_rate),
                                        .hz = size / (2 * M_PI),
                                        .damping = size > 0 ? -creal(s[k]) / size : 0};
  }
  free(s);
  if (status != PB_OK) pb_pole_list_clear(out);
  return status;
}

pb_status pb_exact_modes(const pb_model *model, double f1, double f2, pb_pole_list *out,
                         pb_error *err) {
  pb_status status = pb_all_poles(model, out, err);
  if (status != PB_OK) return status;
  size_t kept = 0;
  for (size_t k = 0; k < out->count; k++) {
    const pb_pole p = out->item[k];
    if (p.damping < 1 && p.hz >= f1 && p.hz <= f2) out->item[kept++] = p;
  }
  out->count = kept;
  pb_pole_sort(out->item, kept);
  return PB_OK;
}

double pb_settling_time(const pb_pole_list *poles, double sample_rate, double f1, double level,
                        double longest) {
  double slowest = 0;
  for (size_t k = 0; k < poles->count; k++) {
    const pb_pole p = poles->item[k];
    if (p.hz < f1 / 4) continue;
    double decay = -log(cabs(p.z)) * sample_rate;  // 1/s
    double time = decay > 0 ? log(1 / level) / decay : longest;
    slowest = fmax(slowest, fmin(time, longest));
  }
  return slowest;
}

pb_status pb_settle_seconds(const pb_model *model, double f1, double f2, bool removable,
                            double *seconds, pb_error *err) {
  const double rate = model->sample_rate;
  pb_pole_list poles;
  pb_status status = pb_all_poles(model, &poles, err);
  if (status != PB_OK) return status;
  *seconds = removable ? pb_settling_time(&poles, rate, 4 * f2, 1e-2, 5)
                       : pb_settling_time(&poles, rate, f1, 1e-4, 120);
  *seconds += (double)pb_model_delay(model) / rate;
  pb_pole_list_clear(&poles);
  return PB_OK;
}

// A zero on a pole: a mode that the channel does not see, or hardly.
static bool cancels(const pb_pole_list *poles, double complex s, double rate) {
  for (size_t k = 0; k < poles->count; k++) {
    double complex p = pb_pole_s(poles->item[k].z, rate);
    if (cabs(s - p) < 1e-4 * cabs(p)) return true;
  }
  return false;
}

static pb_exact_zero zero_of(const pb_sampled_root *r, double rate) {
  static const pb_pole none = {.z = NAN, .hz = NAN, .damping = NAN};
  return (pb_exact_zero){
      .sampled = r->has_sampled ? (pb_pole){r->z, r->sampled_hz, r->sampled_damping} : none,
      .continuous = {cexp(r->s / rate), r->hz, r->damping},
      .sign_differs = r->sign_differs};
}

pb_status pb_exact_zeros(const pb_model *model, size_t output, size_t input, double f1, double f2,
                         pb_exact_zero **zero, size_t *count, pb_error *err) {
  *zero = NULL;
  *count = 0;
  pb_sampled_root *root = NULL;
  size_t found = 0;
  pb_pole_list poles = {0};
  pb_status status =
      pb_model_sampled_zeros(model, &input, &output, 1, 1.2 * f2, &root, &found, err);
  if (status == PB_OK) status = pb_exact_modes(model, f1, f2, &poles, err);
  if (status == PB_OK) {
    *zero = malloc((found + 1) * sizeof **zero);
    if (!*zero) status = pb_fail_memory(err, "zeros");
  }
  for (size_t k = 0; k < found && status == PB_OK; k++) {
    if (root[k].hz < f1 || root[k].hz > f2) continue;
    if (cancels(&poles, root[k].s, model->sample_rate)) continue;
    (*zero)[(*count)++] = zero_of(&root[k], model->sample_rate);
  }
  pb_pole_list_clear(&poles);
  free(root);
  return status;
}

int pb_sensor_of(const pb_model *model, size_t input) {
  static const char *const pair[][2] = {{"Va", "Vs"}, {"f", "fm"}};
  const char *name = model->input[input].name;
  for (size_t k = 0; k < sizeof pair / sizeof *pair; k++) {
    size_t length = strlen(pair[k][0]);
    if (strncmp(name, pair[k][0], length) != 0) continue;
    char sensor[128];
    int written = snprintf(sensor, sizeof sensor, "%s%s", pair[k][1], name + length);
    if (written < 0 || (size_t)written >= sizeof sensor) continue;
    int output = pb_model_output(model, sensor);
    if (output >= 0) return output;
  }
  return -1;
}

void pb_jsonout_pole(pb_jsonout *j, const char *key, const pb_pole *p) {
  pb_jsonout_object(j, key);
  pb_jsonout_number(j, "hz", p->hz);
  pb_jsonout_number(j, "damping", p->damping);
  pb_jsonout_object_end(j);
}
