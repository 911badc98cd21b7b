// Comparing an identification with the model: see analysis.h.
#include "analysis.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "control/pole_match.h"

enum { FIT_CHANNELS = 8, CLOSE_ROWS = 24 };

void pb_analysis_clear(pb_analysis *a) {
  for (size_t k = 0; a->row && k < a->rows; k++) free(a->row[k].zero);
  free(a->row);
  free(a->mode);
  free(a->agreement);
  free(a->exact);
  free(a->exact_floor);
  if (a->early.h != a->frf.h) free(a->early.h);
  pb_frf_clear(&a->frf);
  *a = (pb_analysis){0};
}

// 180 dB below the largest response of the output: what a sum of modes that cancel each other
// leaves.
static const double rounding_range = 1e-9;

void pb_response_floor(const double complex *h, size_t nu, const size_t *output, size_t outputs,
                       double *floor) {
  for (size_t o = 0; o < outputs; o++) {
    double largest = 0;
    for (size_t i = 0; i < nu; i++) largest = fmax(largest, cabs(h[output[o] * nu + i]));
    floor[o] = rounding_range * largest;
  }
}

pb_status pb_exact_responses(const pb_model *model, pb_time_base base,
                             const pb_experiment_channels *ch, const double *hz, size_t nf,
                             double complex **out, double **floor, pb_error *err) {
  size_t all = model->ny * model->nu, some = ch->outputs * ch->inputs;
  double complex *h = malloc(all * sizeof *h);
  *out = malloc((nf * some + 1) * sizeof **out);
  *floor = malloc((nf * ch->outputs + 1) * sizeof **floor);
  pb_status status = h && *out && *floor ? PB_OK : pb_fail_memory(err, "responses");
  for (size_t f = 0; f < nf && status == PB_OK; f++) {
    status = pb_model_frf(model, base, &hz[f], 1, h, err);
    if (status == PB_OK)
      pb_response_floor(h, model->nu, ch->output, ch->outputs, *floor + f * ch->outputs);
    for (size_t k = 0; k < some && status == PB_OK; k++) {
      (*out)[f * some + k] = h[ch->output[k / ch->inputs] * model->nu + ch->input[k % ch->inputs]];
    }
  }
  free(h);
  if (status != PB_OK) {
    free(*out);
    free(*floor);
    *out = NULL;
    *floor = NULL;
  }
  return status;
}

// Samples by which channel (o, i) is delayed.
static size_t delay_of(const pb_model *model, pb_time_base base, const pb_experiment_channels *ch,
                       size_t o, size_t i) {
  size_t delay = pb_model_output_electronics(model, ch->output[o]).delay;
  return base == PB_APPLIED ? delay : delay + pb_model_input_electronics(model, ch->input[i]).delay;
}

pb_status pb_responses_advance(const pb_model *model, pb_time_base base,
                               const pb_experiment_channels *ch, const pb_frf *frf, pb_frf *out,
                               pb_error *err) {
  *out = *frf;
  if (pb_model_delay(model) == 0) return PB_OK;
  out->h = malloc(frf->nf * frf->ny * frf->nu * sizeof *out->h);
  if (!out->h) return pb_fail_memory(err, "responses");
  for (size_t k = 0; k < frf->nf * frf->ny * frf->nu; k++) {
    size_t f = k / (frf->ny * frf->nu), o = k / frf->nu % frf->ny, i = k % frf->nu;
    double turn = frf->frequency_hz[f] / model->sample_rate * 2 * M_PI;
    out->h[k] = frf->h[k] * cexp(I * turn * (double)delay_of(model, base, ch, o, i));
  }
  return PB_OK;
}

// The largest response of output o at line f: with several inputs at once, what their orthogonality
// and the taken-out decay leave of it hides responses that are far smaller.
static double largest_of_line(const pb_frf *frf, const double complex *exact, size_t f, size_t o) {
  double largest = 0;
  for (size_t i = 0; i < frf->nu; i++)
    largest = fmax(largest, cabs(exact[(f * frf->ny + o) * frf->nu + i]));
  return largest;
}

// 100 dB below the largest response of the line counts as noise, as does three standard deviations.
static const double dynamic_range = 1e-5;

pb_agreement pb_agreement_of(const pb_frf *frf, const double complex *exact,
                             const double *exact_floor, size_t o) {
  pb_agreement a = {.lines = frf->nf * frf->nu, .coherence = 1};
  for (size_t f = 0; f < frf->nf; f++) {
    double coherence = frf->coherence[f * frf->ny + o];
    double hidden = dynamic_range * largest_of_line(frf, exact, f, o);
    a.coherence = fmin(a.coherence, coherence);
    for (size_t i = 0; i < frf->nu; i++) {
      size_t k = (f * frf->ny + o) * frf->nu + i;
      if (!(cabs(exact[k]) > exact_floor[f * frf->ny + o])) {
        a.below++;
        continue;
      }
      double floor = fmax(3 * sqrt(frf->variance[k]), hidden);
      if (!(coherence > 0.99) || !(cabs(frf->h[k]) > floor)) continue;
      double complex ratio = frf->h[k] / exact[k];
      double magnitude = 100 * fabs(cabs(ratio) - 1);
      a.used++;
      a.phase_degree = fmax(a.phase_degree, 180 / M_PI * fabs(carg(ratio)));
      if (magnitude >= a.magnitude_percent) {
        a.magnitude_percent = magnitude;
        a.worst_hz = frf->frequency_hz[f];
      }
    }
  }
  return a;
}

static pb_status compare(pb_analysis *a, pb_error *err) {
  a->agreement = calloc(a->frf.ny, sizeof *a->agreement);
  if (!a->agreement) return pb_fail_memory(err, "analysis");
  a->overall.coherence = 1;
  for (size_t o = 0; o < a->frf.ny; o++) {
    pb_agreement one = a->agreement[o] = pb_agreement_of(&a->frf, a->exact, a->exact_floor, o);
    pb_agreement *all = &a->overall;
    if (one.magnitude_percent >= all->magnitude_percent) all->worst_hz = one.worst_hz;
    all->magnitude_percent = fmax(all->magnitude_percent, one.magnitude_percent);
    all->phase_degree = fmax(all->phase_degree, one.phase_degree);
    all->coherence = fmin(all->coherence, one.coherence);
    all->used += one.used;
    all->below += one.below;
    all->lines += one.lines;
  }
  return PB_OK;
}

static double rms_of(const pb_frf *frf, size_t o, size_t i) {
  double sum = 0;
  for (size_t f = 0; f < frf->nf; f++) {
    double size = cabs(frf->h[(f * frf->ny + o) * frf->nu + i]);
    sum += size * size;
  }
  return sqrt(sum / (double)frf->nf);
}

// Share of input i in all that output o does, from 0 to 1: comparable between outputs of any unit.
static double share_of(const pb_frf *frf, size_t o, size_t i) {
  double sum = 0;
  for (size_t j = 0; j < frf->nu; j++) sum += rms_of(frf, o, j);
  return sum > 0 ? rms_of(frf, o, i) / sum : 0;
}

static bool is_taken(const pb_fit_channel *channel, size_t count, size_t o, size_t i) {
  for (size_t k = 0; k < count; k++) {
    if (channel[k].output == o && channel[k].input == i) return true;
  }
  return false;
}

static bool output_is_taken(const pb_fit_channel *channel, size_t count, size_t o) {
  for (size_t k = 0; k < count; k++) {
    if (channel[k].output == o) return true;
  }
  return false;
}

size_t pb_fit_channels(const pb_frf *frf, pb_fit_channel *channel, size_t most) {
  size_t count = 0, all = frf->ny * frf->nu;
  for (size_t turn = 0; count < most && count < all; turn++) {
    size_t i = turn % frf->nu, best = frf->ny;
    double best_share = 0;
    for (size_t o = 0; o < frf->ny; o++) {
      if (is_taken(channel, count, o, i)) continue;
      // An output that is already there counts half.
      double share = share_of(frf, o, i) * (output_is_taken(channel, count, o) ? 0.5 : 1);
      if (share > best_share) best_share = share, best = o;
    }
    if (best < frf->ny && best_share > 1e-6) channel[count++] = (pb_fit_channel){best, i};
    if (turn > 2 * all) break;  // the others do not respond at all
  }
  return count;
}

static pb_fit_options fit_options(const pb_analysis *a, double floor) {
  return (pb_fit_options){
      .sample_rate = a->model->sample_rate, .weight = PB_FIT_NOISE, .floor = floor};
}

// Lines of a measurement are evenly spaced.
static double resolution_of(const pb_frf *frf) {
  const double *hz = frf->frequency_hz;
  return frf->nf > 1 ? (hz[frf->nf - 1] - hz[0]) / (double)(frf->nf - 1) : 0;
}

static pb_status list_modes(pb_analysis *a, const pb_pole_list *exact, const pb_fit *fit,
                            pb_error *err) {
  const double rate = a->model->sample_rate;
  const size_t count = exact->count;
  pb_pole *measured = malloc((count + 1) * sizeof *measured);
  size_t *cluster = malloc((count + 1) * sizeof *cluster);
  a->mode = calloc(count + 1, sizeof *a->mode);
  pb_status status = measured && cluster && a->mode ? pb_pole_match(exact->item, count, fit->pole,
                                                                    fit->poles, rate, measured, err)
                                                    : pb_fail_memory(err, "analysis");
  a->resolution = resolution_of(&a->frf);
  if (status == PB_OK)
    a->clusters = pb_pole_clusters(exact->item, count, rate, a->resolution, cluster);
  for (size_t k = 0; k < count && status == PB_OK; k++)
    a->mode[a->modes++] = (pb_mode_row){exact->item[k], measured[k], cluster[k]};
  free(measured);
  free(cluster);
  return status;
}

static pb_status find_modes(pb_analysis *a, double floor, pb_error *err) {
  double f1 = a->frf.frequency_hz[0], f2 = a->frf.frequency_hz[a->frf.nf - 1];
  pb_fit_channel channel[FIT_CHANNELS];
  pb_fit_options options = fit_options(a, floor);
  pb_pole_list exact = {0};
  pb_fit fit = {0};
  size_t channels = pb_fit_channels(&a->frf, channel, FIT_CHANNELS);
  pb_status status = pb_fit_frf(&a->early, channel, channels, &options, &fit, err);
  if (status == PB_OK) status = pb_exact_modes(a->model, f1, f2, &exact, err);
  if (status == PB_OK) status = list_modes(a, &exact, &fit, err);
  a->fit_error = fit.error;
  pb_fit_clear(&fit);
  pb_pole_list_clear(&exact);
  return status;
}

static size_t index_of(const size_t *list, size_t count, size_t wanted) {
  for (size_t k = 0; k < count; k++) {
    if (list[k] == wanted) return k;
  }
  return count;
}

static pb_status list_zeros(pb_channel_row *row, const pb_exact_zero *exact, size_t count,
                            const pb_pole_list *fitted, double rate, pb_error *err) {
  pb_pole *wanted = malloc((count + 1) * sizeof *wanted), *of = malloc((count + 1) * sizeof *of);
  row->zero = calloc(count + 1, sizeof *row->zero);
  pb_status status = wanted && of && row->zero ? PB_OK : pb_fail_memory(err, "analysis");
  for (size_t k = 0; k < count && status == PB_OK; k++) wanted[k] = exact[k].sampled;
  if (status == PB_OK)
    status = pb_pole_match(wanted, count, fitted->item, fitted->count, rate, of, err);
  for (size_t k = 0; k < count && status == PB_OK; k++)
    row->zero[row->zeros++] = (pb_zero_row){exact[k], of[k]};
  free(wanted);
  free(of);
  return status;
}

// Zeros and static gain of one channel, from a fit of its own.
static pb_status look_closely(pb_analysis *a, pb_fit_channel at, double floor, pb_channel_row *row,
                              pb_error *err) {
  double f1 = a->frf.frequency_hz[0], f2 = a->frf.frequency_hz[a->frf.nf - 1];
  pb_fit_options options = fit_options(a, floor);
  pb_exact_zero *exact = NULL;
  size_t count = 0;
  pb_pole_list zeros = {0};
  pb_fit fit = {0};
  pb_status status = pb_fit_frf(&a->early, &at, 1, &options, &fit, err);
  if (status == PB_OK) status = pb_fit_zeros(&fit, 0, &zeros, err);
  if (status == PB_OK) {
    status = pb_exact_zeros(a->model, row->output, row->input, f1, f2, &exact, &count, err);
  }
  if (status == PB_OK) status = list_zeros(row, exact, count, &zeros, a->model->sample_rate, err);
  // The fit reaches down to 0 Hz where nothing happens below the band.
  double lowest = a->modes > 0 ? a->mode[0].exact.hz : 10 * f1;
  row->dc_measured =
      status == PB_OK && f1 < 0.3 * lowest ? creal(pb_fit_evaluate(&fit, 0, 0)) : NAN;
  free(exact);
  pb_pole_list_clear(&zeros);
  pb_fit_clear(&fit);
  return status;
}

// The channels looked at: all when they are not too many, else each actuator with its own sensor,
// else the first of each input.
static size_t choose_rows(const pb_analysis *a, pb_fit_channel *channel) {
  const pb_experiment_channels *ch = &a->channels;
  size_t count = 0;
  if (ch->outputs * ch->inputs <= CLOSE_ROWS) {
    for (size_t k = 0; k < ch->outputs * ch->inputs; k++) {
      channel[count++] = (pb_fit_channel){k % ch->outputs, k / ch->outputs};
    }
    return count;
  }
  for (size_t i = 0; i < ch->inputs && count < CLOSE_ROWS; i++) {
    int sensor = pb_sensor_of(a->model, ch->input[i]);
    size_t o = sensor < 0 ? ch->outputs : index_of(ch->output, ch->outputs, (size_t)sensor);
    if (o < ch->outputs) channel[count++] = (pb_fit_channel){o, i};
  }
  return count > 0 ? count : pb_fit_channels(&a->frf, channel, CLOSE_ROWS);
}

static pb_status find_rows(pb_analysis *a, double floor, pb_error *err) {
  pb_fit_channel channel[CLOSE_ROWS];
  size_t count = choose_rows(a, channel);
  double *dc = malloc(a->model->ny * a->model->nu * sizeof *dc);
  a->row = calloc(count + 1, sizeof *a->row);
  pb_status status =
      dc && a->row ? pb_model_dc(a->model, dc, err) : pb_fail_memory(err, "analysis");
  for (size_t k = 0; k < count && status == PB_OK; k++) {
    pb_channel_row *row = &a->row[a->rows++];
    row->output = a->channels.output[channel[k].output];
    row->input = a->channels.input[channel[k].input];
    // From the applied input, as measured: without the gain of its electronics.
    row->dc_exact = dc[row->output * a->model->nu + row->input] /
                    pb_model_input_electronics(a->model, row->input).gain;
    row->dc_measured = NAN;
    status = look_closely(a, channel[k], floor, row, err);
    if (status == PB_ERR_NUMERIC || status == PB_ERR_SINGULAR)
      status = PB_OK;  // it does not respond
  }
  free(dc);
  return status;
}

pb_status pb_analyse(const pb_model *model, const pb_experiment_channels *channels, pb_frf *frf,
                     double floor, pb_analysis *out, pb_error *err) {
  *out = (pb_analysis){.model = model, .channels = *channels, .frf = *frf};
  *frf = (pb_frf){0};
  pb_status status = pb_exact_responses(model, PB_APPLIED, channels, out->frf.frequency_hz,
                                        out->frf.nf, &out->exact, &out->exact_floor, err);
  if (status == PB_OK)
    status = pb_responses_advance(model, PB_APPLIED, channels, &out->frf, &out->early, err);
  if (status == PB_OK) status = compare(out, err);
  if (status == PB_OK) status = find_modes(out, floor, err);
  if (status == PB_OK) status = find_rows(out, floor, err);
  if (status != PB_OK) pb_analysis_clear(out);
  return status;
}
