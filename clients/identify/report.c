// The report of an identification: tables and JSON.
#include <math.h>

#include "frf_files.h"
#include "identify.h"
#include "jsonout.h"
#include "table.h"
#include "standard_output.h"

// Difference in percent; below 1e-6 it is rounding and shown as 0.
static double percent(double measured, double exact) {
  double difference = 100 * (measured / exact - 1);
  return fabs(difference) < 1e-6 ? 0 : difference;
}

static pb_status print_agreement(const identify_result *r, pb_error *err) {
  const pb_analysis *a = &r->analysis;
  pb_table t = {0};
  pb_table_text_column(&t, "output");
  pb_table_number_column(&t, "magnitude", "%", 3);
  pb_table_number_column(&t, "phase", "°", 3);
  pb_table_number_column(&t, "worst at", "Hz", 5);
  pb_table_number_column(&t, "lines used", "%", 4);
  pb_table_number_column(&t, "below floor", "%", 4);
  pb_table_number_column(&t, "least coherence", NULL, 6);
  for (size_t o = 0; o < a->channels.outputs; o++) {
    const pb_agreement *g = &a->agreement[o];
    pb_table_text(&t, a->model->output[a->channels.output[o]].name);
    pb_table_number(&t, g->used ? g->magnitude_percent : NAN);
    pb_table_number(&t, g->used ? g->phase_degree : NAN);
    pb_table_number(&t, g->used ? g->worst_hz : NAN);
    pb_table_number(&t, 100.0 * (double)g->used / (double)g->lines);
    pb_table_number(&t, 100.0 * (double)g->below / (double)g->lines);
    pb_table_number(&t, g->coherence);
  }
  printf("\nLargest difference from the exact sampled response (coherence > 0.99, above the "
         "noise):\n");
  pb_status status = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  return status;
}

// Equal ones, by symmetry, are told with their number.
static void print_cluster(const pb_analysis *a, size_t c) {
  size_t members = 0, shown = 0;
  for (size_t k = 0; k < a->modes; k++) members += a->mode[k].cluster == c;
  printf("  cluster of %zu: ", members);
  for (size_t k = 0; k < a->modes;) {
    size_t equal = 1;
    const double hz = a->mode[k].exact.hz;
    while (k + equal < a->modes && a->mode[k + equal].exact.hz < hz * (1 + 1e-6)) equal++;
    if (a->mode[k].cluster == c) printf("%s%.7g", shown++ ? ", " : "", hz);
    if (a->mode[k].cluster == c && equal > 1) printf(" (×%zu)", equal);
    k += equal;
  }
  printf(" Hz, closer than the %g Hz between lines: not told apart one by one\n", a->resolution);
}

static pb_status print_modes(const identify_result *r, pb_error *err) {
  const pb_analysis *a = &r->analysis;
  if (a->modes == 0) return PB_OK;
  pb_table t = {0};
  pb_table_number_column(&t, "resonance", "Hz", 7);
  pb_table_number_column(&t, "exact", "Hz", 7);
  pb_table_number_column(&t, "diff", "%", 2);
  pb_table_number_column(&t, "damping", "%", 4);
  pb_table_number_column(&t, "exact", "%", 4);
  pb_table_number_column(&t, "diff", "%", 2);
  for (size_t k = 0; k < a->modes; k++) {
    const pb_mode_row *m = &a->mode[k];
    pb_table_number(&t, m->measured.hz);
    pb_table_number(&t, m->exact.hz);
    pb_table_number(&t, percent(m->measured.hz, m->exact.hz));
    pb_table_number(&t, 100 * m->measured.damping);
    pb_table_number(&t, 100 * m->exact.damping);
    pb_table_number(&t, percent(m->measured.damping, m->exact.damping));
  }
  printf("\nModes:\n");
  pb_status status = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  for (size_t c = 1; c <= a->clusters && status == PB_OK; c++) print_cluster(a, c);
  return status;
}

static void channel_name(const pb_analysis *a, const pb_channel_row *row, char *text, size_t size) {
  snprintf(text, size, "%s → %s", a->model->input[row->input].name,
           a->model->output[row->output].name);
}

static pb_status print_gains(const identify_result *r, pb_error *err) {
  const pb_analysis *a = &r->analysis;
  pb_table t = {0};
  pb_table_text_column(&t, "channel");
  pb_table_number_column(&t, "static gain", NULL, 5);
  pb_table_number_column(&t, "exact", NULL, 5);
  pb_table_number_column(&t, "diff", "%", 2);
  pb_table_text_column(&t, "unit");
  size_t rows = 0;
  for (size_t k = 0; k < a->rows; k++) {
    const pb_channel_row *row = &a->row[k];
    if (isnan(row->dc_measured) || isinf(row->dc_exact)) continue;
    char name[160], unit[80];
    channel_name(a, row, name, sizeof name);
    pb_channel_unit(a->model, row->output, row->input, unit, sizeof unit);
    pb_table_text(&t, name);
    pb_table_number(&t, row->dc_measured);
    pb_table_number(&t, row->dc_exact);
    pb_table_number(&t, percent(row->dc_measured, row->dc_exact));
    pb_table_text(&t, unit);
    rows++;
  }
  if (rows > 0) printf("\nStatic gains (from the fitted response):\n");
  pb_status status = rows > 0 ? pb_table_print(&t, stdout, 2, err) : PB_OK;
  pb_table_free(&t);
  return status;
}

// Where a sampled zero shows a sign that the plant does not have.
static void print_sign(const pb_analysis *a, const pb_channel_row *row, const pb_zero_row *z) {
  char name[160];
  if (!z->exact.sign_differs) return;
  channel_name(a, row, name, sizeof name);
  printf("  %s, %.6g Hz: sampling, not the plant, makes the sign of the damping (continuous %+.4g "
         "%%, sampled %+.4g %%)\n",
         name, z->exact.continuous.hz, 100 * z->exact.continuous.damping,
         100 * z->exact.sampled.damping);
}

static void zero_cells(pb_table *t, const pb_zero_row *z) {
  pb_table_number(t, z->measured.hz);
  pb_table_number(t, z->exact.sampled.hz);
  pb_table_number(t, percent(z->measured.hz, z->exact.sampled.hz));
  pb_table_number(t, 100 * z->measured.damping);
  pb_table_number(t, 100 * z->exact.sampled.damping);
  pb_table_number(t, z->exact.continuous.hz);
  pb_table_number(t, 100 * z->exact.continuous.damping);
}

// Measured and "sampled" are zeros of the sampled response; those of the continuous plant stand
// beside them.
static pb_status print_zeros(const identify_result *r, pb_error *err) {
  const pb_analysis *a = &r->analysis;
  pb_table t = {0};
  size_t rows = 0;
  pb_table_text_column(&t, "channel");
  pb_table_number_column(&t, "zero", "Hz", 6);
  pb_table_number_column(&t, "sampled", "Hz", 6);
  pb_table_number_column(&t, "diff", "%", 2);
  pb_table_number_column(&t, "damping", "%", 4);
  pb_table_number_column(&t, "sampled", "%", 4);
  pb_table_number_column(&t, "continuous", "Hz", 6);
  pb_table_number_column(&t, "continuous", "%", 4);
  for (size_t k = 0; k < a->rows; k++) {
    for (size_t j = 0; j < a->row[k].zeros; j++, rows++) {
      char name[160];
      channel_name(a, &a->row[k], name, sizeof name);
      pb_table_text(&t, j == 0 ? name : "");
      zero_cells(&t, &a->row[k].zero[j]);
    }
  }
  if (rows > 0) printf("\nZeros, of the sampled response and of the continuous plant:\n");
  pb_status status = rows > 0 ? pb_table_print(&t, stdout, 2, err) : PB_OK;
  pb_table_free(&t);
  for (size_t k = 0; k < a->rows && status == PB_OK; k++)
    for (size_t j = 0; j < a->row[k].zeros; j++) print_sign(a, &a->row[k], &a->row[k].zero[j]);
  return status;
}

// Channels that were asked for and are not in the tables of zeros and gains, nor drawn.
static void print_left_out(const pb_analysis *a) {
  const size_t all = a->channels.inputs * a->channels.outputs;
  if (a->rows >= all) return;
  printf(
      "\nZeros, static gains and plots: %zu of the %zu channels, each actuator with its own sensor "
      "or the strongest; the files hold all. Fewer --input and --output show the others.\n",
      a->rows, all);
}

pb_status identify_print(const identify_result *r, pb_error *err) {
  const pb_description *d = r->bench->description;
  const pb_experiment_options *e = &r->experiment;
  printf("%s, revision %u, %g Hz, %s%s\n", d->name, d->revision, r->bench->model->sample_rate,
         r->bench->realtime ? "real time" : "lockstep", r->bench->was_reset ? ", from rest" : "");
  printf("%s, %g … %g Hz every %g Hz, rms %g, seed %llu, %zu averages; %zu inputs, %zu outputs\n",
         pb_excitation_name(e->excitation), e->f1, e->f2, e->resolution, e->rms,
         (unsigned long long)e->seed, r->rounds * e->averages, r->analysis.channels.inputs,
         r->analysis.channels.outputs);
  printf("%llu samples in %.1f s (%.0f a second)\n", (unsigned long long)r->report.samples,
         r->report.seconds, (double)r->report.samples / r->report.seconds);
  pb_status status = print_agreement(r, err);
  if (status == PB_OK) status = print_modes(r, err);
  if (status == PB_OK) status = print_zeros(r, err);
  if (status == PB_OK) status = print_gains(r, err);
  if (status == PB_OK) print_left_out(&r->analysis);
  return status;
}

// ---- JSON ---------------------------------------------------------------------------------------

static void json_names(pb_jsonout *j, const char *key, const pb_signal *signal, const size_t *index,
                       size_t count) {
  pb_jsonout_row(j, key);
  for (size_t k = 0; k < count; k++) pb_jsonout_text(j, NULL, signal[index[k]].name);
  pb_jsonout_array_end(j);
}

static void json_experiment(pb_jsonout *j, const identify_result *r) {
  const pb_experiment_options *e = &r->experiment;
  pb_jsonout_object(j, "experiment");
  pb_jsonout_text(j, "excitation", pb_excitation_name(e->excitation));
  pb_jsonout_number(j, "f1", e->f1);
  pb_jsonout_number(j, "f2", e->f2);
  pb_jsonout_number(j, "resolution", e->resolution);
  pb_jsonout_number(j, "rms", e->rms);
  pb_jsonout_integer(j, "averages", r->rounds * e->averages);
  pb_jsonout_integer(j, "seed", e->seed);
  pb_jsonout_number(j, "settle", e->settle);
  pb_jsonout_boolean(j, "one_at_a_time", e->one_at_a_time);
  pb_jsonout_integer(j, "samples", r->report.samples);
  pb_jsonout_number(j, "seconds", r->report.seconds);
  pb_jsonout_integer(j, "gaps", r->trouble->gaps);
  pb_jsonout_integer(j, "flagged", r->trouble->flagged);
  pb_jsonout_object(j, "flags");
  for (unsigned bit = 0; bit < PB_FLAG_BITS; bit++)
    pb_jsonout_integer(j, pb_flag_name(bit), r->trouble->flag[bit]);
  pb_jsonout_object_end(j);
  pb_jsonout_integer(j, "disturbed", r->trouble->disturbed);
  pb_jsonout_object_end(j);
}

static void json_agreement(pb_jsonout *j, const char *key, const char *output,
                           const pb_agreement *g) {
  pb_jsonout_object(j, key);
  if (output) pb_jsonout_text(j, "output", output);
  pb_jsonout_number(j, "magnitude_error_percent", g->magnitude_percent);
  pb_jsonout_number(j, "phase_error_degree", g->phase_degree);
  pb_jsonout_number(j, "worst_hz", g->worst_hz);
  pb_jsonout_integer(j, "used", g->used);
  pb_jsonout_integer(j, "below_floor", g->below);
  pb_jsonout_integer(j, "lines", g->lines);
  pb_jsonout_number(j, "least_coherence", g->coherence);
  pb_jsonout_object_end(j);
}

static void json_modes(pb_jsonout *j, const pb_analysis *a) {
  pb_jsonout_array(j, "modes");
  for (size_t k = 0; k < a->modes; k++) {
    pb_jsonout_object(j, NULL);
    pb_jsonout_pole(j, "exact", &a->mode[k].exact);
    pb_jsonout_pole(j, "measured", &a->mode[k].measured);
    pb_jsonout_integer(j, "cluster", a->mode[k].cluster);
    pb_jsonout_object_end(j);
  }
  pb_jsonout_array_end(j);
}

static void json_channels(pb_jsonout *j, const pb_analysis *a) {
  pb_jsonout_array(j, "channels");
  for (size_t k = 0; k < a->rows; k++) {
    const pb_channel_row *row = &a->row[k];
    char unit[80];
    pb_channel_unit(a->model, row->output, row->input, unit, sizeof unit);
    pb_jsonout_object(j, NULL);
    pb_jsonout_text(j, "input", a->model->input[row->input].name);
    pb_jsonout_text(j, "output", a->model->output[row->output].name);
    pb_jsonout_text(j, "unit", unit);
    pb_jsonout_number(j, "dc_exact", row->dc_exact);
    pb_jsonout_number(j, "dc_measured", row->dc_measured);
    pb_jsonout_array(j, "zeros");
    for (size_t n = 0; n < row->zeros; n++) {
      pb_jsonout_object(j, NULL);
      pb_jsonout_pole(j, "exact", &row->zero[n].exact.sampled);
      pb_jsonout_pole(j, "continuous", &row->zero[n].exact.continuous);
      pb_jsonout_boolean(j, "sign_by_sampling", row->zero[n].exact.sign_differs);
      pb_jsonout_pole(j, "measured", &row->zero[n].measured);
      pb_jsonout_object_end(j);
    }
    pb_jsonout_array_end(j);
    pb_jsonout_object_end(j);
  }
  pb_jsonout_array_end(j);
}

typedef enum part { PART_REAL, PART_IMAG, PART_EXACT_REAL, PART_EXACT_IMAG, PART_VARIANCE } part;

static double part_of(const pb_analysis *a, size_t k, part which) {
  switch (which) {
  case PART_REAL:
    return creal(a->frf.h[k]);
  case PART_IMAG:
    return cimag(a->frf.h[k]);
  case PART_EXACT_REAL:
    return creal(a->exact[k]);
  case PART_EXACT_IMAG:
    return cimag(a->exact[k]);
  case PART_VARIANCE:
    break;
  }
  return a->frf.variance[k];
}

// [frequency][output][input]
static void json_response(pb_jsonout *j, const char *key, const pb_analysis *a, part which) {
  const pb_frf *m = &a->frf;
  pb_jsonout_array(j, key);
  for (size_t f = 0; f < m->nf; f++) {
    pb_jsonout_row(j, NULL);
    for (size_t o = 0; o < m->ny; o++) {
      pb_jsonout_row(j, NULL);
      for (size_t i = 0; i < m->nu; i++) {
        pb_jsonout_number(j, NULL, part_of(a, (f * m->ny + o) * m->nu + i, which));
      }
      pb_jsonout_array_end(j);
    }
    pb_jsonout_array_end(j);
  }
  pb_jsonout_array_end(j);
}

static void json_frf(pb_jsonout *j, const pb_analysis *a) {
  pb_jsonout_object(j, "frf");
  pb_jsonout_numbers(j, "frequency_hz", a->frf.frequency_hz, a->frf.nf);
  json_response(j, "real", a, PART_REAL);
  json_response(j, "imag", a, PART_IMAG);
  json_response(j, "exact_real", a, PART_EXACT_REAL);
  json_response(j, "exact_imag", a, PART_EXACT_IMAG);
  json_response(j, "variance", a, PART_VARIANCE);
  pb_jsonout_array(j, "coherence");
  for (size_t f = 0; f < a->frf.nf; f++) {
    pb_jsonout_numbers(j, NULL, a->frf.coherence + f * a->frf.ny, a->frf.ny);
  }
  pb_jsonout_array_end(j);
  pb_jsonout_object_end(j);
}

pb_status identify_print_json(const identify_result *r, pb_error *err) {
  const pb_analysis *a = &r->analysis;
  pb_jsonout j;
  pb_jsonout_begin(&j, stdout);
  pb_jsonout_object(&j, NULL);
  pb_jsonout_text(&j, "plant", r->bench->description->name);
  pb_jsonout_integer(&j, "revision", r->bench->description->revision);
  pb_jsonout_text(&j, "mode", r->bench->realtime ? "realtime" : "lockstep");
  pb_jsonout_number(&j, "sample_rate", a->model->sample_rate);
  json_names(&j, "inputs", a->model->input, a->channels.input, a->channels.inputs);
  json_names(&j, "outputs", a->model->output, a->channels.output, a->channels.outputs);
  json_experiment(&j, r);
  json_agreement(&j, "agreement", NULL, &a->overall);
  pb_jsonout_array(&j, "agreement_by_output");
  for (size_t o = 0; o < a->channels.outputs; o++) {
    json_agreement(&j, NULL, a->model->output[a->channels.output[o]].name, &a->agreement[o]);
  }
  pb_jsonout_array_end(&j);
  json_modes(&j, a);
  json_channels(&j, a);
  json_frf(&j, a);
  pb_jsonout_object_end(&j);
  pb_jsonout_end(&j);
  return pb_stdout_flush(err);
}
