// plantbus-model modes, poles, zeros.
#include <complex.h>
#include <math.h>
#include <stdlib.h>

#include "model/zeros.h"
#include "plot.h"
#include "tool.h"

static const double two_pi = 2 * 3.14159265358979323846;

int command_modes(const tool *t, const pb_model *model) {
  const column c[] = {
      {"modes_hz", "frequency", "Hz", 7, model->mode_hz},
      {"damping", "damping", NULL, 4, model->mode_damping},
  };
  size_t rows = 0;
  double limit = t->max_frequency > 0 ? t->max_frequency : INFINITY;
  while (rows < model->modes && model->mode_hz[rows] <= limit) rows++;
  return emit_columns(t, &(columns){.count = 2, .rows = rows, .column = c});
}

// ---- poles and zeros ----------------------------------------------------------------------------

// Roots in columns of their own: |s|/2π, damping, real and imaginary part.
typedef struct root_list {
  size_t count;
  double *hz, *damping, *real, *imag;  // one block of memory, at hz
} root_list;

// The continuous-time equivalent of a root; sampled roots z = e^{sT}.
static double complex as_continuous(double complex root, bool sampled, double rate) {
  return sampled ? clog(root) * rate : root;
}

static bool root_list_fill(const tool *t, const double complex *root, size_t count, double rate,
                           root_list *list) {
  double *data = malloc((4 * count + 1) * sizeof *data);
  *list = (root_list){.hz = data};
  if (!data) return false;
  list->damping = data + count;
  list->real = list->damping + count;
  list->imag = list->real + count;
  for (size_t k = 0; k < count; k++) {
    double complex s = as_continuous(root[k], t->sampled, rate);
    double size = cabs(s);
    if (t->max_frequency > 0 && size > two_pi * t->max_frequency) continue;
    size_t n = list->count++;
    list->hz[n] = size / two_pi;
    list->damping[n] = size > 0 ? -creal(s) / size : 0;
    list->real[n] = creal(root[k]);
    list->imag[n] = cimag(root[k]);
  }
  return true;
}

static int emit_roots(const tool *t, const root_list *list, const channels *ch, const char *key,
                      const char *unit) {
  const column c[] = {
      {key, "frequency", "Hz", 7, list->hz},
      {"damping", "damping", NULL, 4, list->damping},
      {"real", "real part", unit, 7, list->real},
      {"imag", "imaginary part", unit, 7, list->imag},
  };
  return emit_columns(t, &(columns){.count = 4, .rows = list->count, .column = c, .channels = ch});
}

static int compare_size(const void *a, const void *b) {
  double complex x = *(const double complex *)a, y = *(const double complex *)b;
  double difference = cabs(x) - cabs(y);
  if (fabs(difference) > 1e-12 * cabs(x)) return difference > 0 ? 1 : -1;
  return (cimag(x) < cimag(y)) - (cimag(x) > cimag(y));  // of a pair, the upper one first
}

// The picture of poles and zeros shows continuous time, the upper half plane.
static int plot_roots(const tool *t, const char *title, const double complex *pole, size_t poles,
                      const double complex *zero, size_t zeros) {
  pb_error err = {0};
  pb_locus_plot plot = {.title = title,
                        .poles = poles,
                        .zeros = zeros,
                        .pole = pole,
                        .zero = zero,
                        .max_imag = two_pi * t->max_frequency};
  return emit_done(t, pb_plot_locus(t->out, &plot, &err), &err);
}

int command_poles(const tool *t, const pb_model *model) {
  pb_error err = {0};
  root_list list = {0};
  double complex *pole = malloc((model->nx + 1) * sizeof *pole);
  pb_status status = pole ? PB_OK : pb_fail_memory(&err, t->file);
  if (!status) {
    status = pb_model_poles(model, t->sampled ? PB_SAMPLED : PB_CONTINUOUS, pole, &err);
  }
  if (!status && !t->sampled) qsort(pole, model->nx, sizeof *pole, compare_size);
  if (!status && !root_list_fill(t, pole, model->nx, model->sample_rate, &list)) {
    status = pb_fail_memory(&err, t->file);
  }
  int code = tool_end(status, &err);
  if (!code) code = emit_roots(t, &list, NULL, "poles_hz", t->sampled ? NULL : "rad/s");
  if (!code && t->out_format == FORMAT_PNG) {
    for (size_t k = 0; k < model->nx; k++) {
      pole[k] = as_continuous(pole[k], t->sampled, model->sample_rate);
    }
    code = plot_roots(t, model->name, pole, model->nx, NULL, 0);
  }
  free(list.hz);
  free(pole);
  return code;
}

// Zeros of the chosen channel; beyond the size that can be treated whole only below Nyquist.
static pb_status find_zeros(const tool *t, const pb_model *model, const channels *ch,
                            double complex **zero, size_t *zeros, pb_error *err) {
  *zero = NULL;
  if (ch->inputs != ch->outputs) {
    return pb_fail(err, PB_ERR_ARGUMENT, t->file,
                   "zeros need as many inputs as outputs, not %zu and %zu", ch->inputs,
                   ch->outputs);
  }
  double band = t->max_frequency;
  if (band <= 0 && model->nx > PB_ZEROS_DIRECT) band = 0.5 * model->sample_rate;
  return pb_model_zeros(model, ch->input, ch->output, ch->inputs, band, zero, zeros, err);
}

static int plot_zeros(const tool *t, const pb_model *model, const channels *ch,
                      const double complex *zero, size_t zeros) {
  char title[256];
  snprintf(title, sizeof title, "%s: %s%s → %s%s", model->name, ch->input_name[0],
           ch->inputs > 1 ? "…" : "", ch->output_name[0], ch->outputs > 1 ? "…" : "");
  pb_error err = {0};
  double complex *pole = malloc((model->nx + 1) * sizeof *pole);
  pb_status status = pole ? PB_OK : pb_fail_memory(&err, t->file);
  if (!status) status = pb_model_poles(model, PB_CONTINUOUS, pole, &err);
  int code = tool_end(status, &err);
  if (!code) code = plot_roots(t, title, pole, model->nx, zero, zeros);
  free(pole);
  return code;
}

int command_zeros(const tool *t, const pb_model *model) {
  channels ch;
  int code = channels_choose(t, model, true, &ch);
  if (code) return code;
  pb_error err = {0};
  root_list list = {0};
  double complex *zero = NULL;
  size_t zeros = 0;
  pb_status status = find_zeros(t, model, &ch, &zero, &zeros, &err);
  if (!status && !root_list_fill(t, zero, zeros, model->sample_rate, &list)) {
    status = pb_fail_memory(&err, t->file);
  }
  code = tool_end(status, &err);
  if (!code) code = emit_roots(t, &list, &ch, "zeros_hz", "rad/s");
  if (!code && t->out_format == FORMAT_PNG) code = plot_zeros(t, model, &ch, zero, zeros);
  free(list.hz);
  free(zero);
  channels_free(&ch);
  return code;
}
