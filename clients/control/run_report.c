// The report of a run: tables and JSON.
#include <math.h>

#include "run.h"
#include "table.h"
#include "standard_output.h"

static pb_status print_stages(const run_result *r, pb_error *err) {
  pb_table t = {0};
  pb_table_text_column(&t, "stage");
  pb_table_number_column(&t, "samples", NULL, 9);
  pb_table_number_column(&t, "seconds", "s", 3);
  pb_table_number_column(&t, "lines used", "%", 4);
  pb_table_number_column(&t, "below floor", "%", 4);
  pb_table_number_column(&t, "magnitude error", "%", 3);
  pb_table_number_column(&t, "phase error", "°", 3);
  pb_table_number_column(&t, "worst", "Hz", 5);
  pb_table_number_column(&t, "largest input", NULL, 4);
  for (int k = 0; k < STAGES; k++) {
    const run_stage *s = &r->stage[k];
    const pb_agreement *a = &s->response.agreement;
    double largest = 0;
    if (!s->done) continue;
    for (size_t i = 0; i < r->design->n; i++) largest = fmax(largest, s->largest[i]);
    pb_table_text(&t, control_stage_name[k]);
    pb_table_count(&t, s->response.report.samples);
    pb_table_number(&t, s->response.report.seconds);
    pb_table_number(&t, 100.0 * (double)a->used / (double)a->lines);
    pb_table_number(&t, 100.0 * (double)a->below / (double)a->lines);
    pb_table_number(&t, a->used ? a->magnitude_percent : NAN);
    pb_table_number(&t, a->used ? a->phase_degree : NAN);
    pb_table_number(&t, a->used ? a->worst_hz : NAN);
    pb_table_number(&t, largest);
  }
  printf("\nResponses to the disturbances, measured beside predicted (all outputs, where coherence "
         "exceeds 0.99):\n");
  pb_status status = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  return status;
}

static pb_status print_rms(const run_result *r, pb_error *err) {
  const control_design *d = r->design;
  pb_table t = {0};
  pb_table_text_column(&t, "motion");
  pb_table_text_column(&t, "unit");
  for (int k = 0; k < STAGES; k++) {
    if (!r->stage[k].done) continue;
    pb_table_number_column(&t, control_stage_name[k], NULL, 4);
    pb_table_number_column(&t, "predicted", NULL, 4);
  }
  pb_table_number_column(&t, "HAC-LAC/undamped", NULL, 3);
  for (size_t i = 0; i < d->motions; i++) {
    pb_table_text(&t, d->model->output[d->motion[i]].name);
    pb_table_text(&t, d->model->output[d->motion[i]].unit);
    for (int k = 0; k < STAGES; k++) {
      if (!r->stage[k].done) continue;
      pb_table_number(&t, run_rms(r, (control_stage)k, i, 0));
      pb_table_number(&t, run_rms(r, (control_stage)k, i, 1));
    }
    pb_table_number(&t, run_rms(r, STAGE_HAC, i, 0) / run_rms(r, STAGE_UNDAMPED, i, 0));
  }
  printf("\nRms of the motions in %g … %g Hz:\n", r->experiment.f1, r->experiment.f2);
  pb_status status = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  return status;
}

static size_t count_coherent(const run_result *r) {
  size_t count = 0;
  for (size_t f = 0; f < r->nf; f++) count += r->coherent[f];
  return count;
}

pb_status run_print(const run_result *r, pb_error *err) {
  const control_design *d = r->design;
  control_print_design(d);
  pb_status status = control_print_margins(d, &r->judgement, err);
  if (status != PB_OK) return status;
  printf("\nHAC runs %s, on channel hac; IFF %s\n",
         d->options->hosted ? "in the daemon" : "in this client, over the bus",
         d->damped ? "in the daemon, on channel iff" : "is not used");
  printf("Disturbance: %s of %g rms on", pb_excitation_name(r->experiment.excitation),
         r->experiment.rms);
  for (size_t j = 0; j < d->disturbances; j++)
    printf(" %s", d->model->input[d->disturbance[j]].name);
  printf(", %g … %g Hz\n", r->experiment.f1, r->experiment.f2);
  status = print_stages(r, err);
  if (status == PB_OK) status = print_rms(r, err);
  if (status == PB_OK && r->nf > 0) {
    printf("\nSensitivity at the metrology: the largest σ(S) is within %.3g %% of the prediction "
           "(worst at %g Hz, %zu of %zu lines)\n",
           r->sensitivity_percent, r->sensitivity_hz, count_coherent(r), r->nf);
  }
  return status;
}

// ---- JSON ---------------------------------------------------------------------------------------

static void json_stage(pb_jsonout *o, const run_result *r, control_stage stage) {
  const control_design *d = r->design;
  const run_stage *s = &r->stage[stage];
  const pb_agreement *a = &s->response.agreement;
  if (!s->done) return;
  pb_jsonout_object(o, control_stage_key[stage]);
  pb_jsonout_integer(o, "samples", s->response.report.samples);
  pb_jsonout_number(o, "seconds", s->response.report.seconds);
  pb_jsonout_integer(o, "segments", s->segments);
  pb_jsonout_number(o, "magnitude_error_percent", a->magnitude_percent);
  pb_jsonout_number(o, "phase_error_degree", a->phase_degree);
  pb_jsonout_number(o, "worst_hz", a->worst_hz);
  pb_jsonout_integer(o, "used", a->used);
  pb_jsonout_integer(o, "below_floor", a->below);
  pb_jsonout_integer(o, "lines", a->lines);
  pb_jsonout_integer(o, "missed", s->trouble.gaps);
  pb_jsonout_integer(o, "flagged", s->trouble.flagged);
  pb_jsonout_object(o, "flags");
  for (unsigned bit = 0; bit < PB_FLAG_BITS; bit++)
    pb_jsonout_integer(o, pb_flag_name(bit), s->trouble.flag[bit]);
  pb_jsonout_object_end(o);
  pb_jsonout_numbers(o, "largest_input", s->largest, d->n);
  pb_jsonout_array(o, "rms");
  for (size_t i = 0; i < d->motions; i++) {
    pb_jsonout_object(o, NULL);
    pb_jsonout_text(o, "motion", d->model->output[d->motion[i]].name);
    pb_jsonout_number(o, "measured", run_rms(r, stage, i, 0));
    pb_jsonout_number(o, "predicted", run_rms(r, stage, i, 1));
    pb_jsonout_object_end(o);
  }
  pb_jsonout_array_end(o);
  pb_jsonout_object_end(o);
}

pb_status run_print_json(const run_result *r, pb_error *err) {
  pb_jsonout o;
  pb_jsonout_begin(&o, stdout);
  pb_jsonout_object(&o, NULL);
  control_json_design(&o, r->design);
  pb_jsonout_object(&o, "margins");
  control_json_margins(&o, r->design, &r->judgement);
  pb_jsonout_object_end(&o);
  pb_jsonout_text(&o, "mode", r->bench->realtime ? "realtime" : "lockstep");
  pb_jsonout_text(&o, "hac_runs", r->design->options->hosted ? "hosted" : "client");
  pb_jsonout_object(&o, "stages");
  for (int k = 0; k < STAGES; k++) json_stage(&o, r, (control_stage)k);
  pb_jsonout_object_end(&o);
  if (r->nf > 0) {
    pb_jsonout_object(&o, "sensitivity");
    pb_jsonout_number(&o, "error_percent", r->sensitivity_percent);
    pb_jsonout_number(&o, "worst_hz", r->sensitivity_hz);
    pb_jsonout_integer(&o, "used", count_coherent(r));
    pb_jsonout_integer(&o, "lines", r->nf);
    pb_jsonout_object_end(&o);
  }
  pb_jsonout_object_end(&o);
  pb_jsonout_end(&o);
  return pb_stdout_flush(err);
}
