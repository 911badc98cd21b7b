// What the daemon says besides samples: description, status, events.
#include <stdlib.h>
#include <stdio.h>
#include <string.h>

#include "daemon.h"

const char *pb_drive_name(pb_drive drive) {
  static const char *const name[] = {"paused", "lockstep", "realtime"};
  return name[drive];
}

int pb_drive_parse(const char *name) {
  for (int i = PB_DRIVE_PAUSED; i <= PB_DRIVE_REALTIME; i++)
    if (strcmp(name, pb_drive_name((pb_drive)i)) == 0) return i;
  return -1;
}

typedef struct name_lists {
  char *input_name[PB_STEPPER_INPUTS], *input_unit[PB_STEPPER_INPUTS];
  char *output_name[PB_STEPPER_OUTPUTS], *output_unit[PB_STEPPER_OUTPUTS];
} name_lists;

static void names_fill(const pb_model *model, name_lists *lists) {
  for (size_t i = 0; i < model->nu; i++) {
    lists->input_name[i] = model->input[i].name;
    lists->input_unit[i] = model->input[i].unit;
  }
  for (size_t i = 0; i < model->ny; i++) {
    lists->output_name[i] = model->output[i].name;
    lists->output_unit[i] = model->output[i].unit;
  }
}

static dds_sequence_string strings(char **list, size_t count) {
  return (dds_sequence_string){(uint32_t)count, (uint32_t)count, list, false};
}

void pb_bus_publish_description(pb_daemon *d) {
  const pb_revision *live = pb_daemon_live(d);
  const pb_model *m = live->model;
  name_lists lists;
  names_fill(m, &lists);
  plantbus_PlantDescription out = {
      .name = m->name,
      .revision = live->number,
      .sample_rate = m->sample_rate,
      .states = (uint32_t)m->nx,
      .dof = (uint32_t)m->dof,
      .input_names = strings(lists.input_name, m->nu),
      .input_units = strings(lists.input_unit, m->nu),
      .output_names = strings(lists.output_name, m->ny),
      .output_units = strings(lists.output_unit, m->ny),
      .default_lease = d->options.lease,
      .default_guard = d->options.guard,
      .plant_text = live->text,
      .plant_sha256 = (char *)live->sha256,
      .software_version = PB_VERSION,
      .model = {(uint32_t)live->packed_count, (uint32_t)live->packed_count, live->packed, false}};
  pthread_mutex_lock(&d->lock);
  out.epoch = d->engine.epoch;
  out.mode = (plantbus_RunMode)d->engine.drive;
  out.speed = d->speed;
  out.decimation = d->engine.decimation;
  pthread_mutex_unlock(&d->lock);
  // A writer that is full of unacknowledged data refuses after a short time: the next round tries
  // again.
  d->description_due = dds_write(d->description, &out) != DDS_RETCODE_OK;
}

// A member's copy for the status; the strings are the caller's.
typedef struct member_text {
  char client_name[PB_ENGINE_NAME], channel[PB_ENGINE_NAME];
} member_text;

static uint32_t attached_fill(const pb_engine *engine, plantbus_Attached *out, member_text *text) {
  uint32_t n = 0;
  const bool waiting = pb_engine_waiting(engine);
  for (uint32_t i = 0; i < engine->places; i++) {
    const pb_member *m = &engine->member[i];
    if (!m->id) continue;
    strcpy(text[n].client_name, m->client_name);
    strcpy(text[n].channel, engine->channel[m->channel].name);
    out[n] = (plantbus_Attached){.client_name = text[n].client_name,
                                 .channel = text[n].channel,
                                 .barrier = m->barrier,
                                 .acting = engine->channel[m->channel].acting == m->id,
                                 .waited = waiting && m->barrier && !m->in,
                                 .priority = m->priority,
                                 .commands = m->commands,
                                 .late = m->late,
                                 .age = m->started ? engine->step - m->last_step : 0,
                                 .age_max = m->age_max};
    memcpy(out[n].client, m->client, sizeof out[n].client);
    n++;
  }
  return n;
}

static void counters_fill(pb_daemon *d, plantbus_PlantStatus *out) {
  const uint64_t *v = d->engine.verdicts;
  out->refused = (plantbus_Refusals){.session = v[PB_VERDICT_SESSION],
                                     .foreign = v[PB_VERDICT_FOREIGN],
                                     .step = v[PB_VERDICT_STEP],
                                     .size = v[PB_VERDICT_SIZE],
                                     .non_finite = v[PB_VERDICT_NON_FINITE],
                                     .duplicate = v[PB_VERDICT_DUPLICATE],
                                     .stale = v[PB_VERDICT_STALE]};
  out->late = v[PB_VERDICT_LATE] + atomic_load(&d->realtime.late);
  out->overruns = atomic_load(&d->realtime.overruns);
  out->skipped = atomic_load(&d->realtime.skipped);
  out->dropped_samples = atomic_load(&d->realtime.dropped);
}

static void histogram_fill(const pb_histogram *from, plantbus_Histogram *out) {
  out->count += atomic_load_explicit(&from->count, memory_order_relaxed);
  out->sum += 1e-9 * (double)atomic_load_explicit(&from->sum_ns, memory_order_relaxed);
  const double largest =
      1e-9 * (double)atomic_load_explicit(&from->largest_ns, memory_order_relaxed);
  if (largest > out->largest) out->largest = largest;
  for (int i = 0; i < PB_HISTOGRAM_BINS; i++)
    out->bin[i] += atomic_load_explicit(&from->bin[i], memory_order_relaxed);
}

static void histograms_fill(pb_daemon *d, plantbus_PlantStatus *out) {
  histogram_fill(&d->step_time, &out->step_time);
  histogram_fill(&d->realtime.step_time, &out->step_time);
  histogram_fill(&d->realtime.jitter, &out->jitter);
}

static uint32_t hosted_fill(const pb_host *host, plantbus_Hosted *out) {
  const size_t n = host ? pb_host_count(host) : 0;
  for (size_t i = 0; i < n; i++) {
    const pb_host_item_info *item = pb_host_info(host, i);
    out[i] = (plantbus_Hosted){.channel = (char *)item->channel,
                               .kind = (char *)item->kind,
                               .done = pb_host_done(host, i),
                               .client_name = (char *)item->client_name};
  }
  return (uint32_t)n;
}

static const char *obtained(bool asked, bool got) {
  return !asked ? "not asked" : got ? "obtained" : "refused";
}

static void realtime_text(const pb_daemon *d, char *text, size_t size) {
  const bool ran = atomic_load(&d->realtime.jitter.count) > 0;
  snprintf(text, size, "SCHED_FIFO: %s; affinity: %s; memory lock: %s; denormals: %s",
           obtained(d->options.priority > 0, atomic_load(&d->realtime.fifo)),
           obtained(d->options.cpu >= 0, atomic_load(&d->realtime.affinity)),
           obtained(d->options.lock_memory, d->memory_locked),
           !ran                              ? "not yet in real time"
           : atomic_load(&d->realtime.flush) ? "flushed to zero"
                                             : "not flushed");
}

void pb_bus_publish_status(pb_daemon *d) {
  plantbus_Attached attached[PB_ENGINE_MEMBERS];
  member_text text[PB_ENGINE_MEMBERS];
  uint64_t fault_step[PB_FLAG_COUNT];
  char realtime[192];
  plantbus_Hosted hosted[PB_HOST_ITEMS];
  plantbus_PlantStatus out = {.name = d->name, .real_time = realtime};
  realtime_text(d, realtime, sizeof realtime);
  const int64_t now = pb_daemon_clock();
  pthread_mutex_lock(&d->lock);
  out.mode = (plantbus_RunMode)d->engine.drive;
  out.speed = d->speed;
  out.decimation = d->engine.decimation;
  out.epoch = d->engine.epoch;
  out.revision = d->live->number;
  out.overrun_policy = (char *)pb_overrun_name(d->overrun);
  out.hash = d->current.hash;
  out.hash_step = d->current.step;
  out.step = d->engine.step;
  out.faults = d->faults;
  memcpy(fault_step, d->fault_step, sizeof fault_step);
  counters_fill(d, &out);
  const uint32_t n = attached_fill(&d->engine, attached, text);
  pthread_mutex_unlock(&d->lock);
  out.fault_steps =
      (dds_sequence_unsigned_long_long){PB_FLAG_COUNT, PB_FLAG_COUNT, fault_step, false};
  out.attached = (dds_sequence_plantbus_Attached){n, n, attached, false};
  const uint32_t items = hosted_fill(d->host, hosted);
  out.hosted = (dds_sequence_plantbus_Hosted){items, items, hosted, false};
  out.configuring = d->pending.used && d->pending.is_model;
  histograms_fill(d, &out);
  const double seconds = (double)(now - d->status_written) * 1e-9;
  if (out.epoch == d->status_epoch && seconds > 0.0)
    out.steps_per_second = (double)(out.step - d->status_step) / seconds;
  // Rates are taken over at least half a second: several events in a row do not blur them.
  if (seconds > 0.5 || out.epoch != d->status_epoch) {
    d->status_written = now;
    d->status_step = out.step;
    d->status_epoch = out.epoch;
  }
  d->status_due = dds_write(d->status, &out) != DDS_RETCODE_OK;
}

void pb_bus_publish_events(pb_daemon *d) {
  for (;;) {
    pb_event event;
    pthread_mutex_lock(&d->lock);
    const bool any = pb_engine_event_take(&d->engine, &event);
    pthread_mutex_unlock(&d->lock);
    if (!any) return;
    plantbus_Event out = {.sequence_number = event.number,
                          .plant = d->name,
                          .kind = (char *)pb_event_kind_name(event.kind),
                          .epoch = event.epoch,
                          .step = event.step,
                          .client_name = event.client_name,
                          .channel = event.channel,
                          .message = event.message};
    memcpy(out.client, event.client, sizeof out.client);
    dds_write(d->event, &out);
    d->status_due = true;
  }
}
