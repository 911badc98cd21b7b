// Lockstep: commands are taken, judged and answered with the next sample in the listener of the
// command reader, without a change of thread.
#include <stdio.h>
#include <string.h>

#include "bus_flags.h"
#include "daemon.h"
#include "fpenv.h"

plantbus_Sample pb_bus_sample(const pb_daemon *d) {
  const pb_record *r = &d->current;
  plantbus_Sample s = {.step = r->step,
                       .time_ns = (int64_t)((double)r->step / d->engine.sample_rate * 1e9 + 0.5),
                       .epoch = r->epoch,
                       .revision = r->revision,
                       .flags = r->flags,
                       .input_count = r->nu,
                       .output_count = r->ny,
                       .decimation = d->engine.decimation};
  memcpy(s.input, r->u, r->nu * sizeof(double));
  memcpy(s.output, r->y, r->ny * sizeof(double));
  return s;
}

void pb_bus_publish_sample(pb_daemon *d) {
  const plantbus_Sample s = pb_bus_sample(d);
  dds_write(d->sample, &s);
  d->sample_written = pb_daemon_clock();
  pb_trace_put(d, &s);
}

void pb_bus_note_faults(pb_daemon *d, const pb_record *record) {
  const uint32_t fresh = record->flags & ~d->faults;
  if (!fresh) return;
  d->faults |= fresh;
  for (int bit = 0; bit < PB_FLAG_COUNT; bit++) {
    if (!(fresh & (1u << bit))) continue;
    d->fault_step[bit] = record->step;
    pb_engine_note(&d->engine, PB_EVENT_FAULT, "fault '%s' for the first time at step %llu",
                   pb_flag_name((unsigned)bit), (unsigned long long)record->step);
  }
}

void pb_bus_change_made(pb_daemon *d) {
  pb_pending *p = &d->pending;
  p->armed = false;
  p->made = true;
  if (p->is_model) {
    d->live = p->job.next;
    pb_engine_relayout(&d->engine, (uint32_t)d->live->model->nu, p->change.input_from);
  }
  dds_set_guardcondition(d->wake, true);
}

// Where nobody is waiting for the next sample the current one is told anew, as the changed plant
// sees it; a client in a loop sees the change with the next step.
void pb_bus_change_due(pb_daemon *d) {
  pb_pending *p = &d->pending;
  if (!p->armed || d->engine.step < p->change.at_step) return;
  pb_stepper_change(&d->stepper, &p->change);
  pb_bus_change_made(d);
  if (!p->is_model || pb_engine_barrier_count(&d->engine) > 0 || d->engine.budget > 0) return;
  pb_stepper_renew(&d->stepper);
  d->current = d->stepper.now;
  pb_bus_publish_sample(d);
}

void pb_bus_step(pb_daemon *d, const double *beside) {
  double u[PB_STEPPER_INPUTS];
  bool held;
  const int64_t begin = pb_daemon_clock();
  if (d->pending.armed) pb_bus_change_due(d);
  pb_engine_input(&d->engine, u, &held);
  for (uint32_t i = 0; beside && i < d->engine.nu; i++) u[i] += beside[i];
  pb_stepper_step(&d->stepper, u, held ? PB_FLAG_HELD : 0);
  d->current = d->stepper.now;
  const int64_t now = pb_daemon_clock();
  pb_histogram_add(&d->step_time, now - begin);
  pb_engine_advance(&d->engine, d->current.step, now);
  pb_bus_note_faults(d, &d->current);
}

static void step_once(pb_daemon *d) {
  pb_bus_step(d, NULL);
  if (d->current.step % d->engine.decimation == 0) pb_bus_publish_sample(d);
}

bool pb_bus_run_ready(pb_daemon *d) {
  if (!pb_engine_ready(&d->engine) || pb_trace_owed(d)) return false;
  const uint64_t saved = pb_flush_denormals();
  for (int i = 0; i < PB_DAEMON_CHUNK && pb_engine_ready(&d->engine) && !pb_trace_owed(d); i++)
    step_once(d);
  pb_restore_denormals(saved);
  return pb_engine_ready(&d->engine) && !d->trace.owed;
}

// The first command of a session from this writer: is it the client that attached?
static pb_verdict command_first(pb_daemon *d, const pb_command *command) {
  pb_member *member = pb_engine_find(&d->engine, command->session);
  uint8_t actual[16];
  if (!pb_bus_writer_is(d->command, command->writer, member->client, actual)) {
    pb_engine_refuse(&d->engine, command, PB_VERDICT_FOREIGN);
    return PB_VERDICT_FOREIGN;
  }
  member->writer = command->writer;
  return pb_engine_command(&d->engine, command);
}

static bool command_judge(pb_daemon *d, const plantbus_Command *c, dds_instance_handle_t writer) {
  const pb_command command = {.session = c->session,
                              .step = c->step,
                              .channel = c->channel,
                              .count = c->count,
                              .input = c->input,
                              .writer = writer};
  pb_verdict verdict = pb_engine_command(&d->engine, &command);
  if (verdict == PB_VERDICT_UNKNOWN_WRITER) verdict = command_first(d, &command);
  return verdict == PB_VERDICT_ACCEPTED || verdict == PB_VERDICT_LATE;
}

// No writer is left for the session (unregistered, dead, or silent beyond its liveliness), or its
// own writer disposed of it. A disposal by anybody else, or the end of writers that were never its
// own, is not the end of the session.
static void command_over(pb_daemon *d, uint64_t session, const dds_sample_info_t *info) {
  pb_member *member = pb_engine_find(&d->engine, session);
  if (!member || member->writer == 0) return;
  if (info->instance_state != DDS_IST_NOT_ALIVE_NO_WRITERS &&
      (info->valid_data || info->publication_handle != member->writer))
    return;
  char why[160];
  if (pb_engine_waiting(&d->engine) && member->barrier && !member->in)
    snprintf(why, sizeof why, "was late at step %llu: it gives no sign of life",
             (unsigned long long)d->engine.step);
  else
    snprintf(why, sizeof why, "gives no sign of life or has ended");
  pb_engine_drop(&d->engine, member, PB_EVENT_LOST, why);
}

enum { BATCH = 8 };  // commands taken at once

// Fewer than asked for means that no more are there: what comes later calls again. To ask once more
// in vain would cost a hundredth of a round trip.
bool pb_bus_take_commands(pb_daemon *d, uint64_t *for_step) {
  bool accepted = false;
  plantbus_Command command[BATCH];
  void *sample[BATCH];
  dds_sample_info_t info[BATCH];
  for (int i = 0; i < BATCH; i++) sample[i] = &command[i];
  for (;;) {
    const dds_return_t count = dds_take(d->command, sample, info, BATCH, BATCH);
    for (dds_return_t i = 0; i < count; i++) {
      const plantbus_Command *c = &command[i];
      if (info[i].valid_data && command_judge(d, c, info[i].publication_handle)) {
        accepted = true;
        if (for_step) *for_step = c->step ? c->step : UINT64_MAX;
      }
      // Told with the last command when that was still here.
      if (info[i].instance_state != DDS_IST_ALIVE) {
        command_over(d, c->session, &info[i]);
        accepted = true;  // the inputs may have changed
      }
    }
    if (count < BATCH) return accepted;
  }
}

void pb_bus_on_command(dds_entity_t reader, void *context) {
  (void)reader;
  pb_daemon *d = context;
  if (atomic_load_explicit(&d->realtime_mode, memory_order_acquire)) return;
  pthread_mutex_lock(&d->lock);
  const uint64_t events = d->engine.events_made;
  bool more = false;
  // Looked at again: the mode may have changed while this thread waited for the lock.
  if (d->listening && !atomic_load_explicit(&d->realtime_mode, memory_order_relaxed)) {
    pb_bus_take_commands(d, NULL);
    more = pb_bus_run_ready(d);
  }
  more = more || d->engine.events_made != events;
  pthread_mutex_unlock(&d->lock);
  if (more) dds_set_guardcondition(d->wake, true);
}
