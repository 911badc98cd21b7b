// A study on a running daemon: its plant is changed to each value, identified from the first
// strut's actuator, and compared with the model that the daemon then publishes; at the end it gets
// the plant back that it had.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "analysis.h"
#include "bench.h"
#include "interrupt.h"
#include "jsonout.h"
#include "patch.h"
#include "session_change.h"
#include "study.h"
#include "table.h"
#include "standard_output.h"

// What was measured with one value.
typedef struct live_row {
  uint32_t revision;
  size_t states;
  pb_agreement agreement;  // over force sensor and metrology
  pb_mode_row mode;        // the first of the band
  pb_zero_row zero;        // the first of actuator → force sensor; hz NaN: none
} live_row;

typedef struct live {
  const study_options *options;
  cJSON *original;    // the plant file that the daemon had
  uint32_t revision;  // its number
  bool asked;         // for a change of it
  pb_name_list values;
  live_row *row;  // [values.count]
} live;

// ---- changing the plant -------------------------------------------------------------------------

static pb_session_options session_of(const live *l) {
  return pb_common_session(&l->options->common);
}

static pb_status open_session(const live *l, pb_session **out, pb_error *err) {
  const pb_session_options options = session_of(l);
  return pb_session_open(&options, out, err);
}

// Moves what makes document's member `key` into that of target, as far as it differs, into patch.
static pb_status add_difference(const cJSON *document, const cJSON *target, const char *key,
                                cJSON *patch, pb_error *err) {
  char pointer[32];
  cJSON *part = NULL;
  const cJSON *value = pb_json_member(target, key);
  if (!value) return PB_OK;
  snprintf(pointer, sizeof pointer, "/%s", key);
  pb_status status = pb_patch_make(document, pointer, value, &part, err);
  cJSON *member = status ? NULL : cJSON_DetachItemFromObjectCaseSensitive(part, key);
  cJSON_Delete(part);
  if (status || (member && cJSON_AddItemToObject(patch, key, member))) return status;
  cJSON_Delete(member);
  return pb_fail_memory(err, key);
}

static pb_status send_value(const live *l, pb_session *session, const char *value, pb_error *err) {
  const char *text = pb_session_description(session)->plant_text;
  const pb_variation v = {l->options->kind, value, l->options->stiffness, NULL};
  const pb_change_options wait = {l->options->patience, l->options->patience, pb_interrupted};
  pb_change change = {0};
  cJSON *now = NULL, *target = NULL, *body = cJSON_CreateObject();
  cJSON *patch = cJSON_AddObjectToObject(body, "patch");
  cJSON_AddStringToObject(body, "name", "plantbus-study");
  pb_status status =
      patch ? pb_json_parse(text, strlen(text), &now, err) : pb_fail_memory(err, "request");
  if (!status) status = pb_variation_apply(l->original, &v, &target, err);
  if (!status && l->options->models.count > 0)
    status = add_difference(now, target, "models", patch, err);
  if (!status) status = add_difference(now, target, "template", patch, err);
  if (!status) status = pb_session_change(session, "configure", body, &wait, &change, err);
  pb_change_clear(&change);
  cJSON_Delete(body);
  cJSON_Delete(target);
  cJSON_Delete(now);
  return status;
}

static pb_status change_to(live *l, const char *value, pb_error *err) {
  pb_session *session = NULL;
  pb_status status = open_session(l, &session, err);
  l->asked = l->asked || !status;
  if (!status) status = send_value(l, session, value, err);
  pb_session_close(session);
  return status;
}

// The first error is the one that counts. A change that was asked for may still come, also where
// the wait for it was broken off.
static pb_status give_back(const live *l, pb_status before, pb_error *err) {
  const pb_session_options options = session_of(l);
  pb_error own;
  if (!l->asked) return before;
  pb_status status = pb_session_give_back(&options, l->revision, l->options->patience, &own);
  if (!status || before) return before;
  return pb_fail(err, status, own.where, "the daemon did not get its plant back: %s", own.message);
}

// ---- measuring ----------------------------------------------------------------------------------

static pb_status estimate(const live *l, pb_bench *bench, const pb_experiment_channels *channels,
                          pb_analysis *out, pb_error *err) {
  const pb_study_options *o = &l->options->point;
  pb_experiment *experiment = NULL;
  pb_run_report report;
  pb_frf frf = {0};
  pb_experiment_options e = {.excitation = PB_EXCITE_MULTISINE,
                             .f1 = o->from,
                             .f2 = fmin(o->to, 0.4 * bench->model->sample_rate),
                             .rms = 1,
                             .resolution = 0.5,
                             .averages = 2,
                             .seed = 1};
  pb_status status = pb_settle_seconds(bench->model, e.f1, e.f2, !bench->realtime, &e.settle, err);
  if (!status)
    status = pb_experiment_new(bench->model, channels, NULL, &e, bench->realtime, &experiment, err);
  if (!status) status = pb_experiment_begin(experiment, err);
  if (!status) status = pb_bench_attach(bench, "study", channels->input, channels->inputs, 0, err);
  if (!status) status = pb_bench_run(bench, experiment, "identify", &report, err);
  pb_bench_detach(bench);
  if (experiment) pb_bench_tell_trouble(experiment);
  if (!status) status = pb_experiment_estimate(experiment, &frf, err);
  if (!status) status = pb_analyse(bench->model, channels, &frf, 1e-6, out, err);
  pb_frf_clear(&frf);
  pb_experiment_free(experiment);
  return status;
}

static void read_row(const pb_bench *bench, const pb_analysis *a, size_t sensor, live_row *row) {
  const pb_pole unknown = {.z = NAN, .hz = NAN, .damping = NAN};
  row->revision = bench->description->revision;
  row->states = bench->model->nx;
  row->agreement = a->overall;
  row->mode = a->modes ? a->mode[0] : (pb_mode_row){unknown, unknown, 0};
  row->zero = (pb_zero_row){.exact = {unknown, unknown}, .measured = unknown};
  for (size_t k = 0; k < a->rows; k++)
    if (a->row[k].output == sensor && a->row[k].zeros > 0) row->zero = a->row[k].zero[0];
}

static pb_status measure(const live *l, live_row *row, pb_error *err) {
  pb_bench bench = {0};
  pb_hexapod_channels c;
  pb_analysis analysis = {0};
  pb_status status = pb_bench_open(&l->options->common, PB_RESET_AUTO, &bench, err);
  if (status) return status;
  if (!bench.realtime) bench.block = 1000;
  status = pb_hexapod_channels_find(bench.model, &c, err);
  const size_t output[2] = {c.sensor[0], c.metrology[0]};
  const pb_experiment_channels channels = {c.input, output, 1, 2};
  if (!status) status = estimate(l, &bench, &channels, &analysis, err);
  if (!status) read_row(&bench, &analysis, c.sensor[0], row);
  pb_analysis_clear(&analysis);
  pb_bench_close(&bench);
  return status;
}

// ---- the report ---------------------------------------------------------------------------------

static pb_status print_rows(const live *l, pb_error *err) {
  const pb_study_kind_facts *facts = pb_study_kind_of(l->options->kind);
  char head[64];
  pb_table t = {0};
  snprintf(head, sizeof head, facts->unit ? "%s [%s]" : "%s", facts->quantity, facts->unit);
  pb_table_text_column(&t, head);
  pb_table_number_column(&t, "revision", NULL, 6);
  pb_table_number_column(&t, "states", NULL, 6);
  pb_table_number_column(&t, "first mode", "Hz", 6);
  pb_table_number_column(&t, "exact", "Hz", 6);
  pb_table_number_column(&t, "zero of one strut", "Hz", 6);
  pb_table_number_column(&t, "exact", "Hz", 6);
  pb_table_number_column(&t, "magnitude", "%", 3);
  pb_table_number_column(&t, "phase", "°", 3);
  for (size_t k = 0; k < l->values.count; k++) {
    const live_row *r = &l->row[k];
    pb_table_text(&t, l->values.name[k]);
    pb_table_count(&t, r->revision);
    pb_table_count(&t, r->states);
    pb_table_number(&t, r->mode.measured.hz);
    pb_table_number(&t, r->mode.exact.hz);
    pb_table_number(&t, r->zero.measured.hz);
    pb_table_number(&t, r->zero.exact.sampled.hz);
    pb_table_number(&t, r->agreement.used ? r->agreement.magnitude_percent : NAN);
    pb_table_number(&t, r->agreement.used ? r->agreement.phase_degree : NAN);
  }
  printf("Identified on the daemon, beside its published model (largest difference of force sensor "
         "and metrology):\n");
  pb_status status = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  return status;
}

static pb_status print_json(const live *l, pb_error *err) {
  pb_jsonout j;
  pb_jsonout_begin(&j, stdout);
  pb_jsonout_object(&j, NULL);
  pb_jsonout_text(&j, "study", pb_study_kind_of(l->options->kind)->name);
  pb_jsonout_boolean(&j, "live", true);
  pb_jsonout_array(&j, "values");
  for (size_t k = 0; k < l->values.count; k++) {
    const live_row *r = &l->row[k];
    pb_jsonout_object(&j, NULL);
    pb_jsonout_text(&j, "value", l->values.name[k]);
    pb_jsonout_integer(&j, "revision", r->revision);
    pb_jsonout_integer(&j, "states", r->states);
    pb_jsonout_pole(&j, "mode_measured", &r->mode.measured);
    pb_jsonout_pole(&j, "mode_exact", &r->mode.exact);
    pb_jsonout_pole(&j, "zero_measured", &r->zero.measured);
    pb_jsonout_pole(&j, "zero_exact", &r->zero.exact.sampled);
    pb_jsonout_number(&j, "magnitude_error_percent", r->agreement.magnitude_percent);
    pb_jsonout_number(&j, "phase_error_degree", r->agreement.phase_degree);
    pb_jsonout_integer(&j, "lines_used", r->agreement.used);
    pb_jsonout_object_end(&j);
  }
  pb_jsonout_array_end(&j);
  pb_jsonout_object_end(&j);
  pb_jsonout_end(&j);
  return pb_stdout_flush(err);
}

// ---- all of it ----------------------------------------------------------------------------------

// The daemon's plant, its revision, and the values to go through: those asked for, else the study's
// that the plant can have.
static pb_status begin(live *l, pb_error *err) {
  pb_session *session = NULL;
  pb_name_list wanted = {0};
  const bool asked = l->options->values.count > 0;
  pb_status status = open_session(l, &session, err);
  if (status) return status;
  const char *text = pb_session_description(session)->plant_text;
  l->revision = pb_session_description(session)->revision;
  status = pb_json_parse(text, strlen(text), &l->original, err);
  pb_session_close(session);
  for (size_t k = 0; k < l->options->models.count && !status; k++)
    status = study_add_model(l->original, l->options->models.name[k], err);
  if (!status && !asked && !pb_parse_names(pb_study_kind_of(l->options->kind)->values, &wanted))
    status = pb_fail_memory(err, "values");
  const pb_name_list *list = asked ? &l->options->values : &wanted;
  for (size_t k = 0; k < list->count && !status; k++) {
    const pb_variation v = {l->options->kind, list->name[k], l->options->stiffness, NULL};
    cJSON *varied = NULL;
    status = pb_variation_apply(l->original, &v, &varied, err);
    cJSON_Delete(varied);
    bool left_out = status && !asked && pb_json_member(l->original, "template");
    if (!status && !pb_parse_names(list->name[k], &l->values))
      status = pb_fail_memory(err, "values");
    if (left_out) status = PB_OK;
  }
  pb_name_list_free(&wanted);
  if (!status && l->values.count == 0)
    return pb_fail(err, PB_ERR_STATE, "template", "the plant can have none of the study's values");
  l->row = calloc(l->values.count + 1, sizeof *l->row);
  return status || l->row ? status : pb_fail_memory(err, "values");
}

pb_status study_live(const study_options *o, pb_error *err) {
  live l = {.options = o};
  pb_status status = begin(&l, err);
  for (size_t k = 0; k < l.values.count && !status; k++) {
    status = change_to(&l, l.values.name[k], err);
    if (!status) status = measure(&l, &l.row[k], err);
  }
  status = give_back(&l, status, err);
  if (!status) status = o->result.json ? print_json(&l, err) : print_rows(&l, err);
  cJSON_Delete(l.original);
  pb_name_list_free(&l.values);
  free(l.row);
  return status;
}
