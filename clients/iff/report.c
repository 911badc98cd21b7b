// The report of an IFF experiment: table and JSON.
#include <math.h>

#include "iff_tool.h"
#include "jsonout.h"
#include "table.h"
#include "standard_output.h"

static double percent(double measured, double predicted) {
  double difference = 100 * (measured / predicted - 1);
  return fabs(difference) < 1e-6 ? 0 : difference;
}

static void print_head(const iff_result *r) {
  const pb_description *d = r->bench->description;
  if (r->bench->session) {
    printf("%s, revision %u, %g Hz, %s\n", d->name, d->revision, r->model->sample_rate,
           r->bench->realtime ? "real time" : "lockstep");
  } else {
    printf("%s, %g Hz, predicted\n", d->name, r->model->sample_rate);
  }
  printf("K = %g/(s + 2π·%g) · s/(s + 2π·%g)%s, delay %u samples, sign %+g\n", r->law.gain,
         r->law.integrator_hz, r->law.highpass_hz, r->searched ? " (best gain)" : "", r->loop.delay,
         r->loop.sign);
  printf("%zu loop%s:", r->loops.count, r->loops.count == 1 ? "" : "s");
  for (size_t k = 0; k < r->loops.count; k++) {
    printf("%s %s → %s", k ? "," : "", r->model->output[r->loops.output[k]].name,
           r->model->input[r->loops.input[k]].name);
  }
  printf("\n");
  uint64_t samples = r->open.report.samples + r->closed.report.samples;
  double seconds = r->open.report.seconds + r->closed.report.seconds;
  if (samples == 0) return;
  printf("%llu samples in %.1f s (%.0f a second)\n", (unsigned long long)samples, seconds,
         (double)samples / seconds);
}

static void print_missing(const iff_result *r) {
  size_t missing = 0;
  for (size_t k = 0; k < r->modes; k++) missing += isnan(r->mode[k].closed_measured.hz);
  if (missing > 0)
    printf(
        "  – : %zu modes without a measured pole of their own: equal to another one, or not seen "
        "by the loops\n",
        missing);
}

static pb_status print_modes(const iff_result *r, pb_error *err) {
  bool open = r->open.frf.nf > 0, closed = r->closed.frf.nf > 0;
  pb_table t = {0};
  pb_table_number_column(&t, "open", "Hz", 6);
  pb_table_number_column(&t, "exact damping", "%", 4);
  if (open) pb_table_number_column(&t, "measured", "%", 4);
  pb_table_number_column(&t, "closed |s|/2π", "Hz", 6);
  pb_table_number_column(&t, "oscillates at", "Hz", 6);
  if (closed) pb_table_number_column(&t, "measured", "Hz", 6);
  pb_table_number_column(&t, "predicted damping", "%", 4);
  if (closed) pb_table_number_column(&t, "measured", "%", 4);
  if (closed) pb_table_number_column(&t, "diff", "%", 2);
  for (size_t k = 0; k < r->modes; k++) {
    const iff_mode *m = &r->mode[k];
    pb_table_number(&t, m->open_exact.hz);
    pb_table_number(&t, 100 * m->open_exact.damping);
    if (open) pb_table_number(&t, 100 * m->open_measured.damping);
    pb_table_number(&t, m->closed_predicted.hz);
    pb_table_number(&t, pb_pole_damped_hz(m->closed_predicted));
    if (closed) pb_table_number(&t, m->closed_measured.hz);
    pb_table_number(&t, 100 * m->closed_predicted.damping);
    if (!closed) continue;
    pb_table_number(&t, 100 * m->closed_measured.damping);
    pb_table_number(&t, percent(m->closed_measured.damping, m->closed_predicted.damping));
  }
  printf("\nModes, open loop and closed:\n");
  pb_status status = pb_table_print(&t, stdout, 2, err);
  if (closed && status == PB_OK) print_missing(r);
  pb_table_free(&t);
  return status;
}

static void print_agreement(const char *what, const iff_measurement *m) {
  if (m->frf.nf == 0) return;
  const pb_agreement *a = &m->agreement;
  if (a->used == 0)
    printf("%s plant: nothing to compare, no line is above the noise and the floor\n", what);
  else
    printf("%s plant: within %.3g %% and %.3g° of the prediction (worst at %g Hz, %.1f %% of the "
           "lines)\n",
           what, a->magnitude_percent, a->phase_degree, a->worst_hz,
           100.0 * (double)a->used / (double)a->lines);
  if (a->below > 0)
    printf(
        "  %.1f %% of the lines are below the floor: responses that are rounding (symmetry), not "
        "compared\n",
        100.0 * (double)a->below / (double)a->lines);
}

// What the gain was sought for, and what it was not: modes that the loops cannot move.
static void print_gain(const iff_result *r) {
  const pb_best_gain *g = &r->best;
  double smallest = INFINITY;
  for (size_t k = 0; k < r->modes; k++)
    smallest = fmin(smallest, r->mode[k].closed_predicted.damping);
  if (!r->searched || g->left_out == 0)
    printf("Smallest damping of these modes: %.4g %%%s\n", 100 * smallest,
           r->searched ? ", the largest of all gains that can be doubled" : "");
  if (!r->searched || g->left_out == 0) return;
  printf("Smallest damping of the %zu modes that the loops can damp: %.4g %%, the largest of all "
         "gains "
         "that can be doubled\n",
         g->modes, 100 * g->smallest_damping);
  printf("Not counted are %zu that no gain damps beyond 1 %% and three times their own:",
         g->left_out);
  for (size_t k = 0; k < g->left_out; k++)
    printf("%s %.5g Hz (%.3g %%, at most %.3g %%)", k ? "," : "", g->out_hz[k],
           100 * g->out_damping[k], 100 * g->out_most[k]);
  putchar('\n');
}

pb_status iff_print(const iff_result *r, pb_error *err) {
  print_head(r);
  pb_status status = print_modes(r, err);
  printf("\n");
  print_gain(r);
  print_agreement("Undamped", &r->open);
  print_agreement("Damped", &r->closed);
  if (!r->stable) {
    char pole[96];
    pb_pole_format(r->worst, r->model->sample_rate, pole, sizeof pole);
    printf("The loop is predicted to be unstable: a pole at %s\n", pole);
  }
  return status;
}

// ---- JSON ---------------------------------------------------------------------------------------

static void json_controller(pb_jsonout *j, const iff_result *r) {
  pb_jsonout_object(j, "controller");
  pb_jsonout_number(j, "gain", r->law.gain);
  pb_jsonout_boolean(j, "best", r->searched);
  pb_jsonout_number(j, "integrator_hz", r->law.integrator_hz);
  pb_jsonout_number(j, "highpass_hz", r->law.highpass_hz);
  pb_jsonout_number(j, "sign", r->loop.sign);
  pb_jsonout_integer(j, "delay", r->loop.delay);
  pb_jsonout_boolean(j, "stable", r->stable);
  pb_jsonout_array(j, "loops");
  for (size_t k = 0; k < r->loops.count; k++) {
    pb_jsonout_object(j, NULL);
    pb_jsonout_text(j, "input", r->model->input[r->loops.input[k]].name);
    pb_jsonout_text(j, "output", r->model->output[r->loops.output[k]].name);
    pb_jsonout_object_end(j);
  }
  pb_jsonout_array_end(j);
  pb_jsonout_object_end(j);
}

static void json_modes(pb_jsonout *j, const iff_result *r) {
  pb_jsonout_array(j, "modes");
  for (size_t k = 0; k < r->modes; k++) {
    const iff_mode *m = &r->mode[k];
    pb_jsonout_object(j, NULL);
    pb_jsonout_pole(j, "open_exact", &m->open_exact);
    pb_jsonout_pole(j, "open_measured", &m->open_measured);
    pb_jsonout_pole(j, "closed_predicted", &m->closed_predicted);
    pb_jsonout_pole(j, "closed_measured", &m->closed_measured);
    pb_jsonout_number(j, "damping_error_percent",
                      percent(m->closed_measured.damping, m->closed_predicted.damping));
    pb_jsonout_object_end(j);
  }
  pb_jsonout_array_end(j);
}

static void json_measurement(pb_jsonout *j, const char *key, const iff_measurement *m) {
  if (m->frf.nf == 0) return;
  pb_jsonout_object(j, key);
  pb_jsonout_number(j, "magnitude_error_percent", m->agreement.magnitude_percent);
  pb_jsonout_number(j, "phase_error_degree", m->agreement.phase_degree);
  pb_jsonout_number(j, "worst_hz", m->agreement.worst_hz);
  pb_jsonout_integer(j, "used", m->agreement.used);
  pb_jsonout_integer(j, "below_floor", m->agreement.below);
  pb_jsonout_integer(j, "lines", m->agreement.lines);
  pb_jsonout_number(j, "least_coherence", m->agreement.coherence);
  pb_jsonout_number(j, "fit_error", m->fit.error);
  pb_jsonout_integer(j, "samples", m->report.samples);
  pb_jsonout_number(j, "seconds", m->report.seconds);
  pb_jsonout_object_end(j);
}

static void json_attainable(pb_jsonout *j, const iff_result *r) {
  if (!r->searched) return;
  pb_jsonout_object(j, "search");
  pb_jsonout_number(j, "smallest_damping", r->best.smallest_damping);
  pb_jsonout_numbers(j, "attainable_damping", r->best.attainable, r->best.modes);
  pb_jsonout_numbers(j, "attained_at_gain", r->best.attained_at, r->best.modes);
  pb_jsonout_numbers(j, "left_out_hz", r->best.out_hz, r->best.left_out);
  pb_jsonout_numbers(j, "left_out_damping", r->best.out_damping, r->best.left_out);
  pb_jsonout_numbers(j, "left_out_most", r->best.out_most, r->best.left_out);
  pb_jsonout_object_end(j);
}

pb_status iff_print_json(const iff_result *r, pb_error *err) {
  pb_jsonout j;
  pb_jsonout_begin(&j, stdout);
  pb_jsonout_object(&j, NULL);
  pb_jsonout_text(&j, "plant", r->bench->description->name);
  if (r->bench->session) {
    pb_jsonout_integer(&j, "revision", r->bench->description->revision);
    pb_jsonout_text(&j, "mode", r->bench->realtime ? "realtime" : "lockstep");
  }
  pb_jsonout_number(&j, "sample_rate", r->model->sample_rate);
  json_controller(&j, r);
  json_attainable(&j, r);
  json_modes(&j, r);
  json_measurement(&j, "undamped", &r->open);
  json_measurement(&j, "damped", &r->closed);
  pb_jsonout_object_end(&j);
  pb_jsonout_end(&j);
  return pb_stdout_flush(err);
}
