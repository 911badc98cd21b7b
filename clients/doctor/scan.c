// Which domains have participants and plants. A few domains are open at a time: each costs a
// handful of threads.
#include <string.h>

#include "bus_domain.h"
#include "doctor.h"
#include "interrupt.h"
#include "jsonout.h"

enum { BATCH = 8 };

static const dds_duration_t tick = DDS_MSECS(50);

typedef struct probe {
  uint32_t domain;
  dds_entity_t participant, topic[PB_TOPIC_COUNT];
} probe;

static pb_status probe_open(const doctor_options *o, uint32_t domain, probe *p, pb_error *err) {
  const pb_domain_options options = {
      .domain = domain, .config = o->common.config, .interface = o->common.interface};
  *p = (probe){.domain = domain};
  pb_status status = pb_domain_join(&options, &p->participant, err);
  for (int t = 0; !status && t < PB_TOPIC_COUNT; t++)
    p->topic[t] = pb_topic_create(p->participant, (pb_topic)t);
  return status;
}

typedef struct output {
  pb_jsonout json;
  bool as_json;
  size_t found;  // domains with somebody in them
} output;

static void tell_json(output *out, const probe *p, const pb_discovery *seen,
                      const pb_plants_seen *plants) {
  char who[200];
  pb_jsonout_object(&out->json, NULL);
  pb_jsonout_integer(&out->json, "domain", p->domain);
  pb_jsonout_array(&out->json, "participants");
  for (size_t i = 0; i < seen->peers; i++) {
    if (seen->peer[i].own) continue;
    pb_peer_format(&seen->peer[i], who, sizeof who);
    pb_jsonout_text(&out->json, NULL, who);
  }
  pb_jsonout_array_end(&out->json);
  pb_jsonout_array(&out->json, "plants");
  for (size_t i = 0; i < plants->count; i++)
    pb_jsonout_text(&out->json, NULL, plants->plant[i].description->name);
  pb_jsonout_array_end(&out->json);
  pb_jsonout_object_end(&out->json);
}

static void tell_text(const probe *p, const pb_discovery *seen, const pb_plants_seen *plants,
                      size_t others) {
  char who[200];
  printf("domain %-3u  %zu participant%s", p->domain, others, others == 1 ? "" : "s");
  for (size_t i = 0; i < plants->count; i++) {
    pb_peer_format(pb_discovery_peer(seen, &plants->plant[i].participant), who, sizeof who);
    printf("%s'%s' (%s)", i ? ", " : "  plants: ", plants->plant[i].description->name, who);
  }
  puts(plants->count ? "" : "  no plant");
}

static pb_status probe_tell(output *out, const probe *p, pb_error *err) {
  pb_discovery seen = {0};
  pb_plants_seen plants = {0};
  size_t others = 0;
  pb_status status = pb_discovery_read(p->participant, p->topic, &seen, err);
  for (size_t i = 0; i < seen.peers; i++) others += !seen.peer[i].own;
  if (!status && others > 0)
    status = pb_plants_find(p->participant, p->topic[PB_TOPIC_DESCRIPTION], NULL, 1.0,
                            pb_interrupted, &plants, err);
  if (!status && others > 0) {
    out->found++;
    if (out->as_json)
      tell_json(out, p, &seen, &plants);
    else
      tell_text(p, &seen, &plants, others);
    fflush(stdout);
  }
  pb_plants_clear(&plants);
  pb_discovery_clear(&seen);
  return status;
}

static pb_status batch(const doctor_options *o, uint32_t first, uint32_t last, output *out,
                       pb_error *err) {
  probe p[BATCH];
  uint32_t count = 0;
  pb_status status = PB_OK;
  for (uint32_t domain = first; !status && domain <= last; domain++)
    status = probe_open(o, domain, &p[count++], err);
  // A participant announces itself every second, and at once to one that is new.
  const dds_time_t end = dds_time() + (dds_time_t)(o->timeout * 1e9);
  while (!status && dds_time() < end && !pb_interrupted()) dds_sleepfor(tick);
  for (uint32_t i = 0; i < count; i++) {
    if (!status && !pb_interrupted()) status = probe_tell(out, &p[i], err);
    if (p[i].participant > 0) dds_delete(dds_get_parent(p[i].participant));
  }
  return status;
}

pb_status doctor_scan(const doctor_options *o, pb_error *err) {
  output out = {.as_json = o->json};
  pb_status status = PB_OK;
  pb_jsonout_begin(&out.json, stdout);
  if (o->json) pb_jsonout_array(&out.json, NULL);
  for (uint32_t first = o->scan_first; !status && first <= o->scan_last && !pb_interrupted();
       first += BATCH) {
    const uint32_t last = first + BATCH - 1;
    status = batch(o, first, last < o->scan_last ? last : o->scan_last, &out, err);
  }
  if (o->json) {
    pb_jsonout_array_end(&out.json);
    pb_jsonout_end(&out.json);
  }
  if (!status && out.found == 0)
    return pb_fail(err, PB_ERR_STATE, "scan", "nobody is in the domains %u to %u", o->scan_first,
                   o->scan_last);
  return status;
}
