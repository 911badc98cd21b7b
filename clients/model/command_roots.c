// plantbus-model modes, poles, zeros.
#include <complex.h>
#include <math.h>
#include <stdlib.h>

#include "model/sampled_roots.h"
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

// ---- poles --------------------------------------------------------------------------------------

// Roots in columns of their own: |s|/2π, damping, real and imaginary part, |Im s|/2π.
typedef struct root_list {
  size_t count;
  double *hz, *damping, *real, *imag, *oscillation;  // one block of memory, at hz
} root_list;

// The continuous-time equivalent of a root; sampled roots z = e^{sT}.
static double complex as_continuous(double complex root, bool sampled, double rate) {
  return sampled ? clog(root) * rate : root;
}

static bool root_list_fill(const tool *t, const double complex *root, size_t count, double rate,
                           root_list *list) {
  double *data = malloc((5 * count + 1) * sizeof *data);
  *list = (root_list){.hz = data};
  if (!data) return false;
  list->damping = data + count;
  list->real = list->damping + count;
  list->imag = list->real + count;
  list->oscillation = list->imag + count;
  for (size_t k = 0; k < count; k++) {
    double complex s = as_continuous(root[k], t->sampled, rate);
    double size = cabs(s);
    if (t->max_frequency > 0 && size > two_pi * t->max_frequency) continue;
    size_t n = list->count++;
    list->hz[n] = size / two_pi;
    list->damping[n] = size > 0 ? -creal(s) / size : 0;
    list->real[n] = creal(root[k]);
    list->imag[n] = cimag(root[k]);
    list->oscillation[n] = fabs(cimag(s)) / two_pi;
  }
  return true;
}

static int emit_poles(const tool *t, const root_list *list, const char *unit) {
  const column c[] = {
      {"poles_hz", "frequency", "Hz", 7, list->hz},
      {"damping", "damping", NULL, 4, list->damping},
      {"real", "real part", unit, 7, list->real},
      {"imag", "imaginary part", unit, 7, list->imag},
      {"oscillation_hz", "oscillates at", "Hz", 7, list->oscillation},
  };
  return emit_columns(t, &(columns){.count = 5, .rows = list->count, .column = c});
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

// Poles of the plant that oscillate above half the sample rate: sampled ones are at aliases.
static pb_status print_aliases(const tool *t, const pb_model *model, pb_error *err) {
  pb_sampled_root *root = NULL;
  size_t count = 0, above = 0;
  pb_status st = pb_model_sampled_poles(model, 0, &root, &count, err);
  for (size_t k = 0; k < count && !st; k++) above += !root[k].has_sampled;
  const double nyquist = 0.5 * model->sample_rate;
  if (!st && above > 0 && t->sampled)
    printf("%zu %s: above %g Hz, half the sample rate, in the plant.\n", above,
           above == 1 ? "pair is an alias" : "pairs are aliases", nyquist);
  else if (!st && above > 0)
    printf("%zu %s above %g Hz, half the sample rate: aliases in the sampled plant (--sampled).\n",
           above, above == 1 ? "pair is" : "pairs are", nyquist);
  free(root);
  return st;
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
  if (!code) code = emit_poles(t, &list, t->sampled ? NULL : "rad/s");
  if (!code && wants_table(t)) code = tool_end(print_aliases(t, model, &err), &err);
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

// ---- zeros, of the plant and of the sampled plant -----------------------------------------------

enum { ZERO_COLUMNS = 8 };

typedef struct zero_list {
  size_t count;
  double *value[ZERO_COLUMNS];  // of one block of memory, at value[0]
} zero_list;

// Both of a pair of conjugates, each with what sampling makes of it; NaN where nothing is known.
static bool zero_list_fill(const pb_sampled_root *root, size_t count, zero_list *list) {
  double *data = malloc((2 * count * ZERO_COLUMNS + 1) * sizeof *data);
  *list = (zero_list){.value = {data}};
  if (!data) return false;
  for (size_t c = 0; c < ZERO_COLUMNS; c++) list->value[c] = data + c * 2 * count;
  for (size_t k = 0; k < count; k++) {
    const pb_sampled_root *r = &root[k];
    const double row[ZERO_COLUMNS] = {r->hz,
                                      r->damping,
                                      creal(r->s),
                                      cimag(r->s),
                                      r->has_sampled ? r->sampled_hz : NAN,
                                      r->has_sampled ? r->sampled_damping : NAN,
                                      (double)r->multiplicity,
                                      r->sign_differs};
    for (int twin = 0; twin < (cimag(r->s) > 0 ? 2 : 1); twin++, list->count++)
      for (size_t c = 0; c < ZERO_COLUMNS; c++)
        list->value[c][list->count] = c == 3 && twin ? -row[c] : row[c];
  }
  return true;
}

// One line where the damping of a sampled zero has the sign that the plant's has not.
static void print_signs(const pb_model *model, const pb_sampled_root *root, size_t count) {
  size_t differ = 0;
  for (size_t k = 0; k < count; k++) {
    if (!root[k].sign_differs || (k > 0 && root[k].s == root[k - 1].s)) continue;
    printf(differ++ ? ", %.5g Hz" : "The damping changes its sign at %.5g Hz", root[k].hz);
  }
  if (differ)
    printf(": by sampling at %g Hz with held inputs, not by the plant.\n", model->sample_rate);
}

static int emit_zeros(const tool *t, const pb_model *model, const pb_sampled_root *root,
                      size_t count, const channels *ch) {
  pb_error err = {0};
  zero_list list;
  if (!zero_list_fill(root, count, &list)) return tool_end(pb_fail_memory(&err, t->file), &err);
  const column c[ZERO_COLUMNS] = {
      {"zeros_hz", "frequency", "Hz", 7, list.value[0]},
      {"damping", "damping", NULL, 4, list.value[1]},
      {"real", "real part", "rad/s", 7, list.value[2]},
      {"imag", "imaginary part", "rad/s", 7, list.value[3]},
      {"sampled_hz", "sampled", "Hz", 7, list.value[4]},
      {"sampled_damping", "sampled damping", NULL, 4, list.value[5]},
      {"multiplicity", "multiplicity", NULL, 1, list.value[6]},
      {"sign_by_sampling", "sign by sampling", NULL, 1, list.value[7]},
  };
  const size_t shown = wants_table(t) ? ZERO_COLUMNS - 1 : ZERO_COLUMNS;  // a line tells it there
  int code =
      emit_columns(t, &(columns){.count = shown, .rows = list.count, .column = c, .channels = ch});
  if (!code && wants_table(t)) print_signs(model, root, count);
  free(list.value[0]);
  return code;
}

// Zeros of the chosen channel; beyond the size that can be treated whole only below Nyquist. They
// are those of |s| up to --max-frequency.
static pb_status find_zeros(const tool *t, const pb_model *model, const channels *ch,
                            pb_sampled_root **zero, size_t *zeros, pb_error *err) {
  *zero = NULL;
  if (ch->inputs != ch->outputs) {
    return pb_fail(err, PB_ERR_ARGUMENT, t->file,
                   "zeros need as many inputs as outputs, not %zu and %zu", ch->inputs,
                   ch->outputs);
  }
  double band = t->max_frequency;
  if (band <= 0 && model->nx > PB_ZEROS_DIRECT) band = 0.5 * model->sample_rate;
  pb_status status =
      pb_model_sampled_zeros(model, ch->input, ch->output, ch->inputs, band, zero, zeros, err);
  size_t kept = 0;
  for (size_t k = 0; !status && k < *zeros; k++)
    if (t->max_frequency <= 0 || (*zero)[k].hz <= t->max_frequency) (*zero)[kept++] = (*zero)[k];
  *zeros = kept;
  return status;
}

static int plot_zeros(const tool *t, const pb_model *model, const channels *ch,
                      const pb_sampled_root *root, size_t zeros) {
  char title[256];
  snprintf(title, sizeof title, "%s: %s%s → %s%s", model->name, ch->input_name[0],
           ch->inputs > 1 ? "…" : "", ch->output_name[0], ch->outputs > 1 ? "…" : "");
  pb_error err = {0};
  double complex *pole = malloc((model->nx + 1) * sizeof *pole);
  double complex *zero = malloc((zeros + 1) * sizeof *zero);
  pb_status status = pole && zero ? PB_OK : pb_fail_memory(&err, t->file);
  if (!status) status = pb_model_poles(model, PB_CONTINUOUS, pole, &err);
  for (size_t k = 0; !status && k < zeros; k++) zero[k] = root[k].s;
  int code = tool_end(status, &err);
  if (!code) code = plot_roots(t, title, pole, model->nx, zero, zeros);
  free(zero);
  free(pole);
  return code;
}

int command_zeros(const tool *t, const pb_model *model) {
  channels ch;
  int code = channels_choose(t, model, true, &ch);
  if (code) return code;
  pb_error err = {0};
  pb_sampled_root *zero = NULL;
  size_t zeros = 0;
  code = tool_end(find_zeros(t, model, &ch, &zero, &zeros, &err), &err);
  if (!code) code = emit_zeros(t, model, zero, zeros, &ch);
  if (!code && t->out_format == FORMAT_PNG) code = plot_zeros(t, model, &ch, zero, zeros);
  free(zero);
  channels_free(&ch);
  return code;
}
