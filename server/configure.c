// From a request to a changed plant: see configure.h. All by the service thread.
#include "configure.h"

#include <malloc.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/text.h"
#include "bus_log.h"
#include "daemon.h"

static const int64_t answer_ns = 800000000;  // each request is answered within 1 s

static void pending_clear(pb_pending *p) {
  // Before a change the pointers hold what it brings, after it what it replaced.
  pb_carrier_end(&p->carrier);
  pb_host_free(p->change.swaps_host ? p->change.host : NULL);
  if (p->change.model) free(p->change.state);
  pb_compile_clear(&p->job);
  free(p->patch);
  free(p->comment);
  memset(p, 0, sizeof *p);
}

static void pending_begin(pb_pending *p, const pb_request *request) {
  p->used = true;
  memcpy(p->client, request->client, sizeof p->client);
  p->id = request->id;
  p->answer_by = pb_daemon_clock() + answer_ns;
}

static void answer(pb_daemon *d, const char *status, const pb_error *err, const char *result) {
  pb_pending *p = &d->pending;
  if (!p->answered) pb_bus_reply(d, p->client, p->id, status, err, result);
  p->answered = true;
}

// --- a change of the model ---

static void compile_finished(void *context) {
  pb_daemon *d = context;
  dds_set_guardcondition(d->wake, true);
}

static double step_rate(pb_daemon *d) {
  pthread_mutex_lock(&d->lock);
  const bool realtime = d->engine.drive == PB_DRIVE_REALTIME;
  pthread_mutex_unlock(&d->lock);
  return realtime ? pb_daemon_live(d)->model->sample_rate * d->speed : 0.0;
}

// Takes over text, patch and comment, also on failure.
pb_status pb_configure_begin(pb_daemon *d, pb_request *request, const pb_configure_order *order,
                             pb_error *err) {
  pb_pending *p = &d->pending;
  pending_begin(p, request);
  p->is_model = p->compiling = true;
  p->at_step = order->at_step;
  p->patch = order->patch;
  p->comment = order->comment;
  snprintf(p->client_name, sizeof p->client_name, "%s", order->client_name);
  p->job = (pb_compile_job){.text = order->text,
                            .directory = d->directory,
                            .before = pb_daemon_live(d),
                            .elements = &d->elements,
                            .modes = &d->modes,
                            .number = d->revisions_made + 1,
                            .rate = step_rate(d),
                            .finished = compile_finished,
                            .context = d};
  pb_status status = pb_compile_start(&p->job, err);
  if (status)
    pending_clear(p);
  else
    request->deferred = true;
  return status;
}

pb_status pb_configure_idle(const pb_daemon *d, pb_error *err) {
  if (!d->pending.used) return PB_OK;
  return pb_fail(err, PB_ERR_STATE, "",
                 d->pending.compiling ? "another change is being compiled"
                                      : "another change waits for its step");
}

static void input_map(const pb_model *before, const pb_model *next, int *from) {
  for (size_t i = 0; i < next->nu; i++) from[i] = pb_model_input(before, next->input[i].name);
}

// Whether those who drive the plant can go on with the changed one.
static pb_status clients_admit(pb_daemon *d, const pb_change *change, pb_error *err) {
  uint32_t input;
  pb_status status = PB_OK;
  pthread_mutex_lock(&d->lock);
  const pb_member *m =
      pb_engine_misses(&d->engine, (uint32_t)change->model->nu, change->input_from, &input);
  if (m)
    status = pb_fail(err, PB_ERR_STATE, "/inputs", "client '%s' is attached to '%s', which is gone",
                     m->client_name, d->live->model->input[input].name);
  pthread_mutex_unlock(&d->lock);
  return status;
}

// Under lock the change is the stepping thread's from here on.
static void arm(pb_daemon *d) {
  pb_pending *p = &d->pending;
  pthread_mutex_lock(&d->lock);
  p->change.at_step = p->at_step;
  p->armed = true;
  if (d->engine.drive == PB_DRIVE_REALTIME)
    pb_realtime_change(&d->realtime, &p->change);
  else
    pb_bus_change_due(d);
  pthread_mutex_unlock(&d->lock);
}

static pb_status model_arm(pb_daemon *d, pb_error *err) {
  pb_pending *p = &d->pending;
  pb_compile_job *job = &p->job;
  pb_change *change = &p->change;
  *change = (pb_change){.model = job->next->model,
                        .transfer = job->transfer,
                        .revision = job->number,
                        .swaps_host = d->host != NULL};
  input_map(pb_daemon_live(d)->model, change->model, change->input_from);
  pb_status status = clients_admit(d, change, err);
  if (!status && d->host) status = pb_host_rebind(d->host, change->model, &change->host, err);
  if (status) return status;
  change->state = job->state;
  job->state = NULL;
  p->host_next = change->host;
  if (job->handover && pb_carrier_start(&p->carrier, job->handover)) {
    job->handover = NULL;
    change->carrier = &p->carrier;
    change->ahead = p->carrier.handover->steps;
  }
  arm(d);
  return PB_OK;
}

static void history_add(pb_daemon *d, const pb_pending *p, const pb_transfer_report *report) {
  pb_history_entry *e = &d->history[d->history_count++ % PB_CONFIGURE_HISTORY];
  free(e->comment);
  free(e->patch);
  free(e->text);
  const pb_revision *r = pb_daemon_live(d);
  *e = (pb_history_entry){.revision = r->number,
                          .time = (int64_t)time(NULL),
                          .epoch = d->current.epoch,
                          .step = p ? p->change.made_step : 0,
                          .states = r->model->nx,
                          .comment = pb_text_copy(p && p->comment ? p->comment : ""),
                          .patch = p && p->patch ? pb_text_copy(p->patch) : NULL,
                          .text = pb_text_copy(r->text)};
  memcpy(e->sha256, r->sha256, sizeof e->sha256);
  snprintf(e->client_name, sizeof e->client_name, "%s", p ? p->client_name : "");
  if (!report) return;
  e->output_jump = report->output_jump;
  e->energy_before = report->energy_before;
  e->energy_after = report->energy_after;
  if (report->worst_output < 0) return;
  const pb_signal *worst = &r->model->output[report->worst_output];
  snprintf(e->worst_output, sizeof e->worst_output, "%s", worst->name);
  snprintf(e->worst_unit, sizeof e->worst_unit, "%s", worst->unit);
}

void pb_configure_first(pb_daemon *d) {
  history_add(d, NULL, NULL);
}

static char *model_result(const pb_daemon *d, const pb_pending *p) {
  const pb_history_entry *e = &d->history[(d->history_count - 1) % PB_CONFIGURE_HISTORY];
  cJSON *result = cJSON_CreateObject();
  char *text = NULL;
  if (result && cJSON_AddNumberToObject(result, "revision", e->revision) &&
      cJSON_AddNumberToObject(result, "states", (double)e->states) &&
      cJSON_AddNumberToObject(result, "compile_seconds", p->job.seconds) &&
      cJSON_AddBoolToObject(result, "swapped", true) &&
      cJSON_AddNumberToObject(result, "step", (double)e->step) &&
      cJSON_AddNumberToObject(result, "output_jump", e->output_jump) &&
      cJSON_AddStringToObject(result, "worst_output", e->worst_output) &&
      cJSON_AddNumberToObject(result, "energy_before", e->energy_before) &&
      cJSON_AddNumberToObject(result, "energy_after", e->energy_after) &&
      cJSON_AddNumberToObject(result, "warnings", (double)p->job.warnings.count))
    text = cJSON_PrintUnformatted(result);
  cJSON_Delete(result);
  return text;
}

// The health of the elements that were read for a change: whether it is made or refused, they are
// not read, nor told of, again.
static void elements_told(const pb_compile_job *job) {
  for (size_t i = 0; i < job->notes.count; i++)
    pb_log("plantbusd: revision %u: element %s: %s", job->number, job->notes.item[i].where,
           job->notes.item[i].message);
}

static void model_told(pb_daemon *d) {
  pb_pending *p = &d->pending;
  const pb_history_entry *e = &d->history[(d->history_count - 1) % PB_CONFIGURE_HISTORY];
  pthread_mutex_lock(&d->lock);
  pb_engine_note(&d->engine, PB_EVENT_RECONFIGURED,
                 "revision %u at step %llu, asked for by '%s': %llu states, compiled in %.3g s; "
                 "largest jump of an output %.3g %s (%s), energy %.6g J before and %.6g J after",
                 e->revision, (unsigned long long)e->step, e->client_name,
                 (unsigned long long)e->states, p->job.seconds, e->output_jump, e->worst_unit,
                 e->worst_output, e->energy_before, e->energy_after);
  pthread_mutex_unlock(&d->lock);
  pb_log("plantbusd: revision %u at step %llu (%s): %llu states", e->revision,
         (unsigned long long)e->step, e->client_name, (unsigned long long)e->states);
  for (size_t i = 0; i < p->job.warnings.count; i++)
    pb_log("plantbusd: revision %u: warning: %s: %s", e->revision, p->job.warnings.item[i].where,
           p->job.warnings.item[i].message);
  elements_told(&p->job);
}

static void model_made(pb_daemon *d) {
  pb_pending *p = &d->pending;
  static const pb_error none;
  d->revisions_made = p->job.number;
  d->host = p->host_next;
  pb_transfer_report report;
  const bool examined = pb_transfer_examine(p->job.transfer, &report, NULL) == PB_OK;
  history_add(d, p, examined ? &report : NULL);
  model_told(d);
  char *result = model_result(d, p);
  d->description_due = d->status_due = true;
  answer(d, "ok", &none, result ? result : "{}");
  cJSON_free(result);
  // The change gave the old model back as part of the revision that it belonged to.
  pb_revision *old = (pb_revision *)p->job.before;
  p->job.next = NULL;  // it is the live one
  pending_clear(p);
  pb_revision_free(old);
  malloc_trim(0);  // what was small in it is scattered over the heap
}

static void model_failed(pb_daemon *d, const pb_error *err) {
  char text[800];
  pb_error_format(err, text, sizeof text);
  if (d->pending.answered) {
    pthread_mutex_lock(&d->lock);
    pb_engine_note(&d->engine, PB_EVENT_CONFIGURE_FAILED, "of '%s': %.200s", d->pending.client_name,
                   text);
    pthread_mutex_unlock(&d->lock);
  }
  pb_log("plantbusd: a change of '%s' was refused: %s", d->pending.client_name, text);
  elements_told(&d->pending.job);
  answer(d, "refused", err, "{}");
  pending_clear(&d->pending);
  d->status_due = true;
}

// --- a change of hosted items ---

pb_status pb_configure_host(pb_daemon *d, pb_request *request, pb_host *host, const char *channel,
                            bool removed, uint64_t period) {
  pb_pending *p = &d->pending;
  pending_begin(p, request);
  snprintf(p->host_channel, sizeof p->host_channel, "%s", channel);
  p->host_removed = removed;
  p->host_period = period;
  p->host_next = host;
  p->change = (pb_change){.swaps_host = true, .host = host};
  request->deferred = true;
  arm(d);
  return PB_OK;
}

static void host_made(pb_daemon *d) {
  pb_pending *p = &d->pending;
  static const pb_error none;
  char result[64] = "{}";
  d->host = p->host_next;
  pthread_mutex_lock(&d->lock);
  pb_engine_note(&d->engine, p->host_removed ? PB_EVENT_UNHOSTED : PB_EVENT_HOSTED,
                 p->host_removed ? "channel '%s' was removed" : "channel '%s' runs inside the step",
                 p->host_channel);
  pthread_mutex_unlock(&d->lock);
  if (!p->host_removed)
    snprintf(result, sizeof result, "{\"steps\":%llu}", (unsigned long long)p->host_period);
  answer(d, "ok", &none, result);
  pending_clear(p);
  d->status_due = true;
}

// --- what happens in time ---

void pb_configure_tend(pb_daemon *d) {
  pb_pending *p = &d->pending;
  static const pb_error none;
  if (!p->used) return;
  if (p->compiling && atomic_load(&p->job.done)) {
    pb_error err = {PB_OK, "", ""};
    pb_compile_join(&p->job);
    p->compiling = false;
    pb_status status = p->job.status;
    if (status) err = p->job.err;
    if (!status && p->cancelled) status = pb_fail(&err, PB_ERR_STATE, "", "was cancelled");
    if (!status) status = model_arm(d, &err);
    if (status) {
      model_failed(d, &err);
      return;
    }
  }
  pthread_mutex_lock(&d->lock);
  const bool made = p->made;
  pthread_mutex_unlock(&d->lock);
  if (made && p->is_model)
    model_made(d);
  else if (made)
    host_made(d);
  else if (!p->answered && pb_daemon_clock() >= p->answer_by)
    answer(d, "accepted", &none, "{}");
}

// Takes an armed change back; false: whoever steps has it already.
static bool disarm(pb_daemon *d) {
  pb_pending *p = &d->pending;
  pthread_mutex_lock(&d->lock);
  bool taken = p->armed;
  if (taken && d->engine.drive == PB_DRIVE_REALTIME) taken = pb_realtime_revoke(&d->realtime);
  if (taken) p->armed = false;
  pthread_mutex_unlock(&d->lock);
  return taken;
}

pb_status pb_configure_cancel(pb_daemon *d, pb_error *err) {
  pb_pending *p = &d->pending;
  pb_error why;
  if (!p->used || !p->is_model)
    return pb_fail(err, PB_ERR_STATE, "", "no change of the model is on its way");
  if (p->compiling) {
    p->cancelled = true;
    return PB_OK;
  }
  if (!disarm(d)) return pb_fail(err, PB_ERR_STATE, "", "the change is made already");
  pb_fail(&why, PB_ERR_STATE, "", "was cancelled");
  model_failed(d, &why);
  return PB_OK;
}

// A thread that compiles cannot be stopped; what it works on is then left to the end of the
// process.
bool pb_configure_end(pb_daemon *d) {
  pb_pending *p = &d->pending;
  for (size_t i = 0; i < PB_CONFIGURE_HISTORY; i++) {
    free(d->history[i].comment);
    free(d->history[i].patch);
    free(d->history[i].text);
  }
  if (!p->used) return true;
  if (p->compiling && !atomic_load(&p->job.done)) return false;
  if (p->compiling) pb_compile_join(&p->job);
  if (p->made && p->is_model) {
    pb_revision_free((pb_revision *)p->job.before);
    p->job.next = NULL;
  }
  pending_clear(p);
  return true;
}
