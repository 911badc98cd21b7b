// Whether a plant answers, and whether its samples come.
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "doctor.h"
#include "session.h"

static const dds_duration_t tick = DDS_MSECS(10);

typedef struct watch {
  dds_entity_t subscriber, status, sample;
  plantbus_PlantStatus *newest;  // NULL: none came
  bool any;                      // a sample did
  uint64_t first, last;          // steps of the samples seen, of one epoch
  uint32_t epoch;
} watch;

static void ping(doctor *d, const char *plant) {
  pb_session_options options = pb_common_session(&d->options->common);
  options.plant = plant;
  options.timeout = d->options->timeout;
  pb_session *session = NULL;
  pb_error err = {0};
  pb_status status = pb_session_open(&options, &session, &err);
  const int64_t begin = dds_time();
  if (!status) status = pb_session_request(session, "ping", NULL, 0.0, NULL, &err);
  if (status)
    report_add(&d->report, GRADE_FAIL, "ping",
               "is the daemon stopped or overloaded? else data does not pass: see qos, firewall",
               "%s: %s: %s", plant, err.where, err.message);
  else
    report_add(&d->report, GRADE_OK, "ping", NULL, "%s answers, %.1f ms", plant,
               (double)(dds_time() - begin) * 1e-6);
  pb_session_close(session);
}

// ---- samples ------------------------------------------------------------------------------------

static void status_take(watch *w) {
  plantbus_PlantStatus *p = plantbus_PlantStatus__alloc();
  if (!p) return;
  memset(p, 0, sizeof *p);
  void *sample[1] = {p};
  dds_sample_info_t info;
  const bool taken = dds_take(w->status, sample, &info, 1, 1) == 1 && info.valid_data;
  plantbus_PlantStatus *old = taken ? w->newest : p;
  if (taken) w->newest = p;
  if (old) plantbus_PlantStatus_free(old, DDS_FREE_ALL);
}

static void sample_take(watch *w) {
  plantbus_Sample x;
  void *sample[1] = {&x};
  dds_sample_info_t info;
  if (dds_take(w->sample, sample, &info, 1, 1) != 1 || !info.valid_data) return;
  if (!w->any || x.epoch != w->epoch) w->first = x.step;
  w->any = true;
  w->epoch = x.epoch;
  w->last = x.step;
}

static uint32_t barrier_members(const plantbus_PlantStatus *p) {
  uint32_t count = 0;
  for (uint32_t i = 0; i < p->attached._length; i++) count += p->attached._buffer[i].barrier;
  return count;
}

static bool must_run(const plantbus_PlantStatus *p) {
  return p->mode == plantbus_REALTIME || (p->mode == plantbus_LOCKSTEP && barrier_members(p) > 0);
}

// Until samples flow, or the plant says that none are to come, or the time is over.
static void look(doctor *d, watch *w) {
  const dds_time_t deadline = dds_time() + (dds_time_t)(d->options->timeout * 1e9);
  while (dds_time() < deadline) {
    status_take(w);
    sample_take(w);
    if (w->any && w->last > w->first) return;
    if (w->newest && !must_run(w->newest)) return;
    dds_sleepfor(tick);
  }
}

static void waited_names(const plantbus_PlantStatus *p, char *text, size_t size) {
  size_t used = 0;
  text[0] = '\0';
  for (uint32_t i = 0; i < p->attached._length && used < size; i++) {
    const plantbus_Attached *a = &p->attached._buffer[i];
    if (a->waited)
      used += (size_t)snprintf(text + used, size - used, "%s%s (channel %s)", used ? ", " : "",
                               a->client_name, a->channel);
  }
}

static void tell_still(doctor *d, const watch *w, const char *plant) {
  char text[300];
  waited_names(w->newest, text, sizeof text);
  if (w->newest->mode == plantbus_LOCKSTEP && text[0])
    report_add(&d->report, GRADE_WARN, "samples",
               "let it answer, or end it; the daemon evicts it when its guard is over",
               "%s stands still at step %" PRIu64 ": lockstep waits for %s", plant,
               (uint64_t)w->newest->step, text);
  else
    report_add(&d->report, GRADE_FAIL, "samples",
               "status passes and samples do not: see qos; the daemon's log tells more",
               "%s: no new sample came within %g s", plant, d->options->timeout);
}

static void tell(doctor *d, const watch *w, const char *plant) {
  const plantbus_PlantStatus *p = w->newest;
  if (w->any && w->last > w->first)
    report_add(&d->report, GRADE_OK, "samples", NULL, "%s: they come, step %" PRIu64, plant,
               w->last);
  else if (!p)
    report_add(&d->report, GRADE_FAIL, "samples", "data does not pass: see qos and the firewall",
               "%s: no status came within %g s", plant, d->options->timeout);
  else if (p->mode == plantbus_PAUSED)
    report_add(&d->report, GRADE_OK, "samples",
               "to see it move: plantbus-request set_mode '{\"mode\":\"lockstep\"}', or step",
               "%s is paused at step %" PRIu64 ": steps are taken on request", plant,
               (uint64_t)p->step);
  else if (!must_run(p))
    report_add(&d->report, GRADE_OK, "samples", "attach a controller, or plantbus-request step",
               "%s stands at step %" PRIu64 ": lockstep, and no barrier member is attached", plant,
               (uint64_t)p->step);
  else
    tell_still(d, w, plant);
}

static void samples(doctor *d, const char *plant) {
  watch w = {.subscriber = pb_partition_create(d->participant, plant, false)};
  w.status = pb_reader_create(w.subscriber, d->topic[PB_TOPIC_STATUS], PB_TOPIC_STATUS, 0, NULL);
  w.sample = pb_reader_create(w.subscriber, d->topic[PB_TOPIC_SAMPLE], PB_TOPIC_SAMPLE, 1, NULL);
  if (w.status < 0 || w.sample < 0) {
    report_add(&d->report, GRADE_FAIL, "samples", NULL, "readers cannot be created");
  } else {
    look(d, &w);
    tell(d, &w, plant);
  }
  if (w.subscriber > 0) dds_delete(w.subscriber);
  if (w.newest) plantbus_PlantStatus_free(w.newest, DDS_FREE_ALL);
}

void doctor_flow(doctor *d) {
  const char *wanted = d->options->common.plant, *before = "";
  for (size_t i = 0; i < d->plants.count; i++) {
    const char *name = d->plants.plant[i].description->name;
    if ((wanted && strcmp(name, wanted) != 0) || strcmp(name, before) == 0) continue;
    before = name;
    ping(d, name);
    samples(d, name);
  }
}
