// Answering samples. In lockstep in the listener of the sample reader, in real time in the calling
// thread; in both, the calling thread watches over the run.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "session_internal.h"

static const int64_t resend_ns =
    10000000;  // a sample that comes again this late: the answer was lost
static const int64_t progress_ns = 200000000;
static const int64_t tick_ns = 20000000;

// Under lock. The first reason counts.
static void run_end(pb_session *s, pb_status status) {
  if (!s->run.active) return;
  s->run.active = false;
  s->run.status = status;
  pthread_cond_signal(&s->ended);
}

static void run_fail(pb_session *s, pb_status status, const char *message) {
  if (!s->run.active) return;
  run_end(s, pb_fail(&s->run.error, status, s->received->name, "%s", message));
}

static void revision_fail(pb_session *s, uint32_t revision) {
  char message[128];
  snprintf(message, sizeof message, "the plant's model was changed: revision %u became %u",
           s->run.revision, revision);
  run_fail(s, PB_ERR_STATE, message);
}

static bool sample_fits(pb_session *s, const plantbus_Sample *x) {
  if (x->epoch < s->run.epoch) return false;  // from before a reset
  if (x->epoch > s->run.epoch)
    run_fail(s, PB_ERR_STATE, "the plant was reset during the run");
  else if (x->revision != s->run.revision && !s->run.options->any_revision)
    revision_fail(s, x->revision);
  else if (x->input_count != s->model->nu || x->output_count != s->model->ny)
    run_fail(s, PB_ERR_SYNTAX, "a sample does not fit the description");
  return s->run.active && x->step >= s->run.first_step;
}

static bool answer_finite(const plantbus_Command *answer) {
  for (uint32_t i = 0; i < answer->count; i++)
    if (!isfinite(answer->input[i])) return false;
  return true;
}

static void answer_send(pb_session *s) {
  if (!s->attached) return;
  dds_write(s->command, &s->answer);  // when it is lost the sample comes again
  s->run.answered_at = pb_session_clock();
}

// Under lock, in whichever thread answers.
static void sample_answer(pb_session *s, const plantbus_Sample *x) {
  pb_run *run = &s->run;
  if (!sample_fits(s, x)) return;
  if (run->answered && x->step <= run->last_step) {
    if (x->step == run->last_step && pb_session_clock() - run->answered_at > resend_ns)
      answer_send(s);
    return;
  }
  if (run->answered && x->decimation > 0 && x->step > run->last_step + x->decimation)
    run->missed += (x->step - run->last_step) / x->decimation - 1;
  run->samples++;
  run->last_step = x->step;
  run->answered = true;
  run->progress_at = pb_session_clock();
  const pb_sample view = {x->step,        x->time_ns,      x->epoch, x->revision, x->flags,
                          x->input_count, x->output_count, x->input, x->output};
  s->answer.step = x->step;
  if (!run->options->on_sample(run->options->context, &view, s->answer.input)) {
    s->unanswered = *x;
    s->has_unanswered = true;
    run_end(s, PB_OK);
  } else if (!answer_finite(&s->answer)) {
    run_fail(s, PB_ERR_NUMERIC, "the controller's command is not finite");
  } else if (!run->behind) {
    answer_send(s);
  }
}

enum { BATCH = 16 };  // samples taken at once

// Of several samples that wait, as a recorder may find them in real time, only the newest is
// answered.
static void samples_take(pb_session *s) {
  plantbus_Sample x[BATCH];
  void *sample[BATCH];
  dds_sample_info_t info[BATCH];
  for (int i = 0; i < BATCH; i++) sample[i] = &x[i];
  while (s->run.active) {
    const dds_return_t count = dds_take(s->sample, sample, info, BATCH, BATCH);
    if (count <= 0) return;
    for (dds_return_t i = 0; i < count && s->run.active; i++) {
      s->run.behind = i + 1 < count;
      if (info[i].valid_data) sample_answer(s, &x[i]);
    }
    if (count < BATCH) return;  // no more are there; the next one calls again
  }
}

// Between runs the newest sample stays in the reader for the next one.
static void on_sample(dds_entity_t reader, void *context) {
  (void)reader;
  pb_session *s = context;
  pthread_mutex_lock(&s->lock);
  if (s->run.active && s->run.listener) samples_take(s);
  pthread_mutex_unlock(&s->lock);
}

pb_status pb_session_listen(pb_session *s, pb_error *err) {
  if (s->sample > 0) return PB_OK;
  dds_listener_t *listener = dds_create_listener(s);
  if (!listener) return pb_fail_memory(err, "listener");
  dds_lset_data_available(listener, on_sample);
  s->sample = pb_reader_create(s->subscriber, s->topic[PB_TOPIC_SAMPLE], PB_TOPIC_SAMPLE,
                               s->history, listener);
  dds_delete_listener(listener);
  if (s->sample < 0) return pb_fail(err, PB_ERR_IO, "sample", "%s", dds_strretcode(-s->sample));
  s->sample_wait = dds_create_waitset(s->participant);
  const dds_entity_t condition = dds_create_readcondition(s->sample, DDS_ANY_STATE);
  if (s->sample_wait < 0 || dds_waitset_attach(s->sample_wait, condition, 0) < 0)
    return pb_fail(err, PB_ERR_IO, "sample", "conditions cannot be created");
  return PB_OK;
}

// A change of mode that asks for the other way of answering ends the run.
static void mode_changed(pb_session *s) {
  pb_standing standing;
  pb_error err;
  if (pb_session_ping(s, &standing, &err)) return;  // the stall watch will tell
  pthread_mutex_lock(&s->lock);
  if ((standing.mode == PB_REALTIME) == s->run.listener)
    run_fail(s, PB_ERR_STATE, "the daemon's mode was changed");
  pthread_mutex_unlock(&s->lock);
}

static bool event_ends(const pb_session *s, const plantbus_Event *e) {
  return s->attached && e->sequence_number >= s->attach_event &&
         memcmp(e->client, s->client, sizeof s->client) == 0 &&
         (!strcmp(e->kind, "evicted") || !strcmp(e->kind, "lost") ||
          !strcmp(e->kind, "lease_over"));
}

static void events_take(pb_session *s, uint64_t first) {
  bool mode = false;
  for (;;) {
    void *sample[1] = {NULL};
    dds_sample_info_t info;
    if (dds_take(s->event, sample, &info, 1, 1) != 1) break;
    const plantbus_Event *e = sample[0];
    if (info.valid_data && event_ends(s, e)) {
      pthread_mutex_lock(&s->lock);
      run_fail(s, PB_ERR_STATE, e->message);
      pthread_mutex_unlock(&s->lock);
    }
    mode = mode || (info.valid_data && e->sequence_number >= first && !strcmp(e->kind, "mode"));
    dds_return_loan(s->event, sample, 1);
  }
  if (mode) mode_changed(s);
}

// What the calling thread looks after, a few times in a guard. Without the lock.
static void watch(pb_session *s, const pb_run_options *o, uint64_t first_event, int64_t *told) {
  dds_subscription_matched_status_t matched;
  if (s->attached) dds_assert_liveliness(s->command);
  events_take(s, first_event);
  const bool interrupted = o->interrupted && o->interrupted();
  const bool gone =
      dds_get_subscription_matched_status(s->sample, &matched) == 0 && matched.current_count == 0;
  const double stall = o->stall > 0.0 ? o->stall : s->timeout;
  const int64_t now = pb_session_clock();
  pthread_mutex_lock(&s->lock);
  if (interrupted) run_fail(s, PB_ERR_STATE, "interrupted");
  if (gone) run_fail(s, PB_ERR_STATE, "the daemon has gone");
  if (now - s->run.progress_at > (int64_t)(stall * 1e9))
    run_fail(s, PB_ERR_STATE, "the plant stands still: no new sample came in time");
  const uint64_t samples = s->run.samples;
  pthread_mutex_unlock(&s->lock);
  if (o->progress && now - *told >= progress_ns) {
    o->progress(o->context, samples);
    *told = now;
  }
}

static void lockstep_wait(pb_session *s, int64_t pause) {
  const int64_t until = pb_session_clock() + pause;
  const struct timespec t = {until / 1000000000, (long)(until % 1000000000)};
  pthread_mutex_lock(&s->lock);
  if (s->run.active) pthread_cond_timedwait(&s->ended, &s->lock, &t);
  pthread_mutex_unlock(&s->lock);
}

// Real time: samples are answered as they come, between two looks around.
static void realtime_wait(pb_session *s, int64_t pause) {
  const int64_t until = pb_session_clock() + pause;
  for (int64_t now; (now = pb_session_clock()) < until;) {
    dds_waitset_wait(s->sample_wait, NULL, 0, until - now);
    pthread_mutex_lock(&s->lock);
    samples_take(s);
    const bool active = s->run.active;
    pthread_mutex_unlock(&s->lock);
    if (!active) return;
  }
}

static void run_begin(pb_session *s, const pb_run_options *o, const pb_standing *standing) {
  pthread_mutex_lock(&s->lock);
  s->run = (pb_run){.options = o,
                    .active = true,
                    .listener = standing->mode != PB_REALTIME,
                    .first_step = standing->mode != PB_REALTIME ? standing->step : 0,
                    .epoch = standing->epoch,
                    .revision = s->received->revision,
                    .progress_at = pb_session_clock()};
  memset(&s->answer, 0, sizeof s->answer);
  s->answer.session = s->session;
  s->answer.channel = s->channel;
  s->answer.count = s->input_count;
  if (s->has_unanswered && s->run.listener && s->unanswered.epoch == s->run.epoch)
    sample_answer(s, &s->unanswered);
  s->has_unanswered = s->has_unanswered && !s->run.active;
  samples_take(s);
  pthread_mutex_unlock(&s->lock);
}

pb_status pb_session_run(pb_session *s, const pb_run_options *o, pb_run_report *report,
                         pb_error *err) {
  pb_standing standing;
  if (report) *report = (pb_run_report){0};
  pb_status status = pb_session_listen(s, err);
  if (!status) status = pb_session_ping(s, &standing, err);
  if (status) return status;
  const int64_t begin = pb_session_clock();
  int64_t told = begin;
  int64_t pause = tick_ns;
  if (s->attached && s->guard * 0.25e9 < (double)pause) pause = (int64_t)(s->guard * 0.25e9);
  run_begin(s, o, &standing);
  for (;;) {
    pthread_mutex_lock(&s->lock);
    const bool active = s->run.active;
    pthread_mutex_unlock(&s->lock);
    if (!active) break;
    if (s->run.listener)
      lockstep_wait(s, pause);
    else
      realtime_wait(s, pause);
    watch(s, o, standing.event, &told);
  }
  // Not active any more: the listener leaves the run alone.
  if (report)
    *report =
        (pb_run_report){s->run.samples, s->run.missed, (double)(pb_session_clock() - begin) * 1e-9};
  if (s->run.status && err) *err = s->run.error;
  return s->run.status;
}
