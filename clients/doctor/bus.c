// What the domain says: participants, plants, readers and writers that do not fit.
#include <stdlib.h>
#include <string.h>

#include "bus_domain.h"
#include "doctor.h"
#include "qos.h"

static const dds_duration_t still = DDS_MSECS(300);  // without news: discovery has ended
static const dds_duration_t tick = DDS_MSECS(50);

bool doctor_join(doctor *d) {
  const doctor_options *o = d->options;
  const pb_domain_options options = {
      .domain = o->common.domain, .config = o->common.config, .interface = o->common.interface};
  pb_error err = {0};
  pb_status status = pb_domain_join(&options, &d->participant, &err);
  for (int t = 0; !status && t < PB_TOPIC_COUNT; t++) {
    d->topic[t] = pb_topic_create(d->participant, (pb_topic)t);
    if (d->topic[t] < 0)
      status =
          pb_fail(&err, PB_ERR_IO, pb_topic_name((pb_topic)t), "%s", dds_strretcode(-d->topic[t]));
  }
  if (status)
    report_add(&d->report, GRADE_FAIL, "domain", "mend what the middleware says on stderr",
               "%s: %s", err.where, err.message);
  else
    report_add(&d->report, GRADE_OK, "domain", NULL, "domain %u is joined", o->common.domain);
  return !status;
}

// ---- discovery ----------------------------------------------------------------------------------

static bool named(const doctor *d) {
  for (size_t i = 0; i < d->plants.count; i++)
    if (strcmp(d->plants.plant[i].description->name, d->options->common.plant) == 0) return true;
  return false;
}

// What has been heard of counts once nothing new has come for a while.
static void settle(doctor *d) {
  const dds_time_t deadline = dds_time() + (dds_time_t)(d->options->timeout * 1e9);
  dds_time_t changed = dds_time();
  size_t before = 0;
  while (dds_time() < changed + still && dds_time() < deadline) {
    pb_discovery_clear(&d->seen);
    if (pb_discovery_read(d->participant, d->topic, &d->seen, NULL)) return;
    if (d->seen.peers + d->seen.endpoints != before) changed = dds_time();
    before = d->seen.peers + d->seen.endpoints;
    dds_sleepfor(tick);
  }
}

void doctor_discover(doctor *d) {
  const dds_entity_t topic = d->topic[PB_TOPIC_DESCRIPTION];
  const char *plant = d->options->common.plant;
  pb_error err = {0};
  pb_status status =
      pb_plants_find(d->participant, topic, NULL, d->options->timeout, NULL, &d->plants, &err);
  if (!status && plant && d->plants.count > 0 && !named(d)) {  // it may be slower than the others
    pb_plants_clear(&d->plants);
    pb_plants_seen only = {0};
    status = pb_plants_find(d->participant, topic, plant, d->options->timeout, NULL, &only, &err);
    pb_plants_clear(&only);
    if (!status)
      status =
          pb_plants_find(d->participant, topic, NULL, d->options->timeout, NULL, &d->plants, &err);
  }
  if (status) report_add(&d->report, GRADE_FAIL, "plant", NULL, "%s: %s", err.where, err.message);
  settle(d);
}

size_t doctor_others(const doctor *d) {
  size_t count = 0;
  for (size_t i = 0; i < d->seen.peers; i++) count += !d->seen.peer[i].own;
  return count;
}

void doctor_participants(doctor *d) {
  char text[400] = "", one[200];
  size_t used = 0;
  for (size_t i = 0; i < d->seen.peers && used < sizeof text; i++) {
    if (d->seen.peer[i].own) continue;
    pb_peer_format(&d->seen.peer[i], one, sizeof one);
    used += (size_t)snprintf(text + used, sizeof text - used, "%s%s", used ? ", " : "", one);
  }
  if (doctor_others(d) == 0)
    report_add(&d->report, GRADE_FAIL, "participants",
               d->loopback ? "start plantbusd with this --domain, on this host; plantbus-doctor "
                             "--scan 0-20 looks into other domains"
                           : "start plantbusd with this --domain and interface; plantbus-doctor "
                             "--scan 0-20 looks into other domains",
               "nobody else is in domain %u (listened %g s)", d->options->common.domain,
               d->options->timeout);
  else
    report_add(&d->report, GRADE_OK, "participants", NULL, "%zu: %s", doctor_others(d), text);
}

// ---- plants -------------------------------------------------------------------------------------

static void plant_names(const doctor *d, char *text, size_t size) {
  size_t used = 0;
  text[0] = '\0';
  for (size_t i = 0; i < d->plants.count && used < size; i++) {
    char who[200];
    pb_peer_format(pb_discovery_peer(&d->seen, &d->plants.plant[i].participant), who, sizeof who);
    used += (size_t)snprintf(text + used, size - used, "%s'%s' (%s)", i ? ", " : "",
                             d->plants.plant[i].description->name, who);
  }
}

static const char *served_twice(const doctor *d) {
  for (size_t i = 1; i < d->plants.count; i++)
    if (strcmp(d->plants.plant[i].description->name, d->plants.plant[i - 1].description->name) == 0)
      return d->plants.plant[i].description->name;
  return NULL;
}

void doctor_plants(doctor *d) {
  const char *plant = d->options->common.plant;
  char text[400];
  plant_names(d, text, sizeof text);
  if (d->plants.count == 0 && doctor_others(d) == 0)
    report_add(&d->report, GRADE_FAIL, "plant", NULL, "no plant, as nobody is there");
  else if (d->plants.count == 0 && d->seen.endpoints == 0)
    report_add(&d->report, GRADE_FAIL, "plant",
               "use the same interface and configuration on both sides; else unicast is held up by "
               "a firewall",
               "there are participants, but no reader or writer of the bus was heard of");
  else if (d->plants.count == 0)
    report_add(&d->report, GRADE_FAIL, "plant",
               "start plantbusd; if it runs, see qos and types below, and the firewall",
               "there are participants, but none describes a plant");
  else if (plant && !named(d))
    report_add(&d->report, GRADE_FAIL, "plant", "use one of these names with --plant",
               "'%s' is not served here; served are %s", plant, text);
  else if (served_twice(d))
    report_add(&d->report, GRADE_FAIL, "plant", "end one of them, or give it another domain",
               "'%s' is served twice: %s", served_twice(d), text);
  else
    report_add(&d->report, GRADE_OK, "plant",
               d->plants.count > 1 && !plant ? "clients must name one: --plant NAME" : NULL, "%s",
               text);
}

// ---- readers and writers ------------------------------------------------------------------------

static int topic_of(const char *name) {
  for (int t = 0; t < PB_TOPIC_COUNT; t++)
    if (strcmp(name, pb_topic_name((pb_topic)t)) == 0) return t;
  return -1;
}

static bool type_fits(doctor *d, const pb_endpoint *e, int topic, const char *who) {
  char expected[128] = "";
  dds_get_type_name(d->topic[topic], expected, sizeof expected);
  const bool same_name = strcmp(e->type, expected) == 0;
  if (same_name && (!e->has_type_info || e->same_type)) return true;
  report_add(&d->report, GRADE_FAIL, "types", "build both sides from the same idl/plantbus.idl",
             same_name ? "%s: the %s of %s has another definition of type %s (partition '%s')"
                       : "%s: the %s of %s has type %s (partition '%s'), which is not the bus'",
             e->topic, e->writer ? "writer" : "reader", who, e->type, e->partition);
  return false;
}

static bool qos_fits(doctor *d, const pb_endpoint *e, int topic, const char *who) {
  char conflict[160];
  dds_qos_t *ours = pb_topic_qos((pb_topic)topic);
  if (!ours) return true;
  const bool bad = e->writer ? qos_conflict(e->qos, ours, conflict, sizeof conflict)
                             : qos_conflict(ours, e->qos, conflict, sizeof conflict);
  dds_delete_qos(ours);
  if (bad)
    report_add(&d->report, GRADE_FAIL, "qos", "take its qualities of service from idl/bus_qos.c",
               "%s: the %s of %s does not match, %s (partition '%s')", e->topic,
               e->writer ? "writer" : "reader", who, conflict, e->partition);
  return !bad;
}

void doctor_endpoints(doctor *d) {
  size_t qos = 0, types = 0, known = 0;
  for (size_t i = 0; i < d->seen.endpoints; i++) {
    const pb_endpoint *e = &d->seen.endpoint[i];
    const int topic = topic_of(e->topic);
    char who[200];
    pb_peer_format(pb_discovery_peer(&d->seen, &e->participant), who, sizeof who);
    if (topic < 0) {
      report_add(&d->report, GRADE_WARN, "types", "use the same version of plantbus on both sides",
                 "%s, a topic that this version does not know, is used by %s", e->topic, who);
      continue;
    }
    known++;
    qos += qos_fits(d, e, topic, who);
    types += type_fits(d, e, topic, who);
  }
  if (known > 0 && qos == known)
    report_add(&d->report, GRADE_OK, "qos", NULL, "%zu readers and writers of others match", known);
  if (known > 0 && types == known)
    report_add(&d->report, GRADE_OK, "types", NULL, "all have the types of this version");
}
