// What the monitor reads from the bus: see feed.h.
#include "feed.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "bus_domain.h"
#include "discovery.h"
#include "interrupt.h"

struct feed {
  dds_entity_t participant, topic[PB_TOPIC_COUNT];
  dds_entity_t description, status, sample, event, waitset;
  plantbus_PlantDescription *described;
  plantbus_PlantStatus *newest;
  monitor_state state;
};

const monitor_state *feed_state(const feed *f) {
  return &f->state;
}

// ---- finding the plant --------------------------------------------------------------------------

static void host_of(feed *f, const dds_guid_t *participant) {
  pb_discovery who = {0};
  if (pb_discovery_read(f->participant, f->topic, &who, NULL)) return;
  pb_peer_format(pb_discovery_peer(&who, participant), f->state.daemon, sizeof f->state.daemon);
  pb_discovery_clear(&who);
}

static void list_plants(feed *f, const pb_plants_seen *plants) {
  for (size_t i = 0; i < plants->count; i++) {
    host_of(f, &plants->plant[i].participant);
    fprintf(stderr, "  %s  %s\n", plants->plant[i].description->name, f->state.daemon);
  }
}

static pb_status choose(feed *f, const pb_common_options *o, double timeout, pb_error *err) {
  pb_plants_seen plants;
  pb_status status = pb_plants_find(f->participant, f->topic[PB_TOPIC_DESCRIPTION], o->plant,
                                    timeout, pb_interrupted, &plants, err);
  if (status) return status;
  if (plants.count == 0) {
    status = pb_plants_none(f->participant, f->topic[PB_TOPIC_DESCRIPTION], o->plant, o->domain,
                            timeout, err);
  } else if (plants.count > 1) {
    list_plants(f, &plants);
    status = pb_fail(err, PB_ERR_STATE, "plant", "%zu are served on domain %u: name one by --plant",
                     plants.count, o->domain);
  } else {
    host_of(f, &plants.plant[0].participant);
    f->described = plants.plant[0].description;
    f->state.description = f->described;
    plants.plant[0].description = NULL;
    plants.count = 0;
  }
  pb_plants_clear(&plants);
  return status;
}

// ---- readers ------------------------------------------------------------------------------------

static dds_entity_t sample_reader(feed *f, dds_entity_t subscriber) {
  dds_qos_t *qos = pb_topic_qos(PB_TOPIC_SAMPLE);
  if (!qos) return DDS_RETCODE_OUT_OF_RESOURCES;
  dds_qset_reliability(qos, DDS_RELIABILITY_BEST_EFFORT, 0);
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
  const dds_entity_t reader = dds_create_reader(subscriber, f->topic[PB_TOPIC_SAMPLE], qos, NULL);
  dds_delete_qos(qos);
  return reader;
}

static pb_status readers_make(feed *f, pb_error *err) {
  const dds_entity_t subscriber = pb_partition_create(f->participant, f->described->name, false);
  f->description =
      pb_reader_create(subscriber, f->topic[PB_TOPIC_DESCRIPTION], PB_TOPIC_DESCRIPTION, 0, NULL);
  f->status = pb_reader_create(subscriber, f->topic[PB_TOPIC_STATUS], PB_TOPIC_STATUS, 0, NULL);
  f->event = pb_reader_create(subscriber, f->topic[PB_TOPIC_EVENT], PB_TOPIC_EVENT, 0, NULL);
  f->sample = sample_reader(f, subscriber);
  f->waitset = dds_create_waitset(f->participant);
  const dds_entity_t condition = dds_create_readcondition(f->status, DDS_ANY_STATE);
  if (f->description < 0 || f->event < 0 || f->sample < 0 ||
      dds_waitset_attach(f->waitset, condition, 0) < 0)
    return pb_fail(err, PB_ERR_IO, "DDS", "readers cannot be created");
  return PB_OK;
}

static pb_status join(feed *f, const pb_common_options *o, pb_error *err) {
  const pb_domain_options options = {
      .domain = o->domain, .config = o->config, .interface = o->interface};
  pb_status status = pb_domain_join(&options, &f->participant, err);
  for (int t = 0; !status && t < PB_TOPIC_COUNT; t++) {
    f->topic[t] = pb_topic_create(f->participant, (pb_topic)t);
    if (f->topic[t] < 0)
      status =
          pb_fail(err, PB_ERR_IO, pb_topic_name((pb_topic)t), "%s", dds_strretcode(-f->topic[t]));
  }
  return status;
}

pb_status feed_open(const pb_common_options *o, double timeout, feed **out, pb_error *err) {
  *out = NULL;
  if (o->plant && !pb_plant_name_valid(o->plant))
    return pb_fail(err, PB_ERR_ARGUMENT, o->plant, "is not the name of a plant");
  feed *f = calloc(1, sizeof *f);
  if (!f) return pb_fail_memory(err, "feed");
  pb_status status = join(f, o, err);
  if (!status) status = choose(f, o, timeout, err);
  if (!status) status = readers_make(f, err);
  if (status) {
    feed_close(f);
    return status;
  }
  *out = f;
  return PB_OK;
}

void feed_close(feed *f) {
  if (!f) return;
  if (f->participant > 0) dds_delete(f->participant);
  if (f->described) plantbus_PlantDescription_free(f->described, DDS_FREE_ALL);
  if (f->newest) plantbus_PlantStatus_free(f->newest, DDS_FREE_ALL);
  free(f);
}

// ---- taking -------------------------------------------------------------------------------------

static void extremes_forget(feed *f) {
  f->state.seen = 0;
  f->state.has_sample = false;
}

static void description_take(feed *f) {
  plantbus_PlantDescription *d = plantbus_PlantDescription__alloc();
  if (!d) return;
  memset(d, 0, sizeof *d);
  void *sample[1] = {d};
  dds_sample_info_t info;
  const bool taken = dds_take(f->description, sample, &info, 1, 1) == 1 && info.valid_data;
  if (taken && d->revision != f->described->revision) extremes_forget(f);
  plantbus_PlantDescription *old = taken ? f->described : d;
  if (taken) f->state.description = f->described = d;
  plantbus_PlantDescription_free(old, DDS_FREE_ALL);
}

static bool status_take(feed *f) {
  plantbus_PlantStatus *p = plantbus_PlantStatus__alloc();
  if (!p) return false;
  memset(p, 0, sizeof *p);
  void *sample[1] = {p};
  dds_sample_info_t info;
  const bool taken = dds_take(f->status, sample, &info, 1, 1) == 1 && info.valid_data;
  plantbus_PlantStatus *old = taken ? f->newest : p;
  if (taken) f->state.status = f->newest = p;
  if (old) plantbus_PlantStatus_free(old, DDS_FREE_ALL);
  return taken;
}

static void extreme(monitor_state *m, size_t index, double value) {
  m->least[index] = m->seen ? fmin(m->least[index], value) : value;
  m->most[index] = m->seen ? fmax(m->most[index], value) : value;
}

static void sample_take(feed *f) {
  monitor_state *m = &f->state;
  plantbus_Sample taken;
  void *sample[1] = {&taken};
  dds_sample_info_t info;
  if (dds_take(f->sample, sample, &info, 1, 1) != 1 || !info.valid_data) return;
  const uint32_t revision = m->sample.revision;
  plantbus_Sample *x = &m->sample;
  *x = taken;
  if (x->input_count > plantbus_MAX_INPUTS) x->input_count = plantbus_MAX_INPUTS;
  if (x->output_count > plantbus_MAX_OUTPUTS) x->output_count = plantbus_MAX_OUTPUTS;
  if (m->has_sample && x->revision != revision) extremes_forget(f);
  m->has_sample = true;
  for (uint32_t i = 0; i < x->input_count; i++) extreme(m, i, x->input[i]);
  for (uint32_t i = 0; i < x->output_count; i++) extreme(m, plantbus_MAX_INPUTS + i, x->output[i]);
  m->seen++;
}

static void event_keep(monitor_state *m, const plantbus_Event *e) {
  if (m->events == MONITOR_EVENTS)
    memmove(&m->event[0], &m->event[1], (--m->events) * sizeof m->event[0]);
  monitor_event *kept = &m->event[m->events++];
  *kept = (monitor_event){.epoch = e->epoch, .step = e->step};
  snprintf(kept->kind, sizeof kept->kind, "%s", e->kind);
  snprintf(kept->message, sizeof kept->message, "%s", e->message);
}

static void events_take(feed *f) {
  for (;;) {
    void *sample[1] = {NULL};
    dds_sample_info_t info;
    if (dds_take(f->event, sample, &info, 1, 1) != 1) return;
    if (info.valid_data) event_keep(&f->state, sample[0]);
    dds_return_loan(f->event, sample, 1);
  }
}

bool feed_take(feed *f) {
  dds_subscription_matched_status_t matched;
  description_take(f);
  sample_take(f);
  events_take(f);
  const bool any = status_take(f);
  if (dds_get_subscription_matched_status(f->status, &matched) == DDS_RETCODE_OK)
    f->state.gone = f->newest && matched.current_count == 0;
  return any;
}

void feed_wait(feed *f, double seconds) {
  dds_waitset_wait(f->waitset, NULL, 0, (dds_duration_t)(seconds * 1e9));
}
