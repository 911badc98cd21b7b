// The plants that daemons describe: see discovery.h.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "discovery.h"

static const dds_duration_t settle = DDS_MSECS(200);  // to hear of other daemons
static const dds_duration_t tick = DDS_MSECS(50);

static bool known(const pb_plants_seen *out, const char *name, dds_instance_handle_t writer) {
  for (size_t i = 0; i < out->count; i++)
    if (out->plant[i].writer == writer && strcmp(out->plant[i].description->name, name) == 0)
      return true;
  return false;
}

// Takes the description over, also on failure.
static bool keep(pb_plants_seen *out, plantbus_PlantDescription *d, dds_instance_handle_t writer,
                 dds_entity_t reader) {
  pb_plant_seen *grown = realloc(out->plant, (out->count + 1) * sizeof *grown);
  if (!grown) {
    plantbus_PlantDescription_free(d, DDS_FREE_ALL);
    return false;
  }
  out->plant = grown;
  pb_plant_seen *made = &grown[out->count++];
  *made = (pb_plant_seen){.description = d, .writer = writer};
  dds_builtintopic_endpoint_t *e = dds_get_matched_publication_data(reader, writer);
  if (e) made->participant = e->participant_key;
  if (e) dds_builtintopic_free_endpoint(e);
  return true;
}

static bool take(pb_plants_seen *out, dds_entity_t reader, const char *plant) {
  for (;;) {
    plantbus_PlantDescription *d = plantbus_PlantDescription__alloc();
    if (!d) return false;
    memset(d, 0, sizeof *d);
    void *sample[1] = {d};
    dds_sample_info_t info;
    const dds_return_t n = dds_take(reader, sample, &info, 1, 1);
    const bool wanted = n == 1 && info.valid_data && (!plant || strcmp(d->name, plant) == 0) &&
                        !known(out, d->name, info.publication_handle);
    if (wanted && !keep(out, d, info.publication_handle, reader)) return false;
    if (!wanted) plantbus_PlantDescription_free(d, DDS_FREE_ALL);
    if (n != 1) return true;
  }
}

static bool complete(const pb_plants_seen *out, dds_entity_t reader, const char *plant,
                     dds_time_t first) {
  dds_subscription_matched_status_t matched = {0};
  if (out->count == 0) return false;
  if (plant) return true;
  dds_get_subscription_matched_status(reader, &matched);
  return dds_time() >= first + settle && out->count >= matched.current_count;
}

static int by_name(const void *a, const void *b) {
  const pb_plant_seen *x = a, *y = b;
  return strcmp(x->description->name, y->description->name);
}

static pb_status wait_all(pb_plants_seen *out, dds_entity_t reader, dds_entity_t waitset,
                          const char *plant, double timeout, bool (*interrupted)(void),
                          pb_error *err) {
  const dds_time_t deadline = dds_time() + (dds_time_t)(timeout * 1e9);
  dds_time_t first = 0;
  for (;;) {
    if (!take(out, reader, plant)) return pb_fail_memory(err, "description");
    if (out->count > 0 && first == 0) first = dds_time();
    if (complete(out, reader, plant, first) || (interrupted && interrupted())) break;
    const dds_time_t left = deadline - dds_time();
    if (left <= 0) break;
    dds_waitset_wait(waitset, NULL, 0, left < tick ? left : tick);
  }
  if (out->count > 1) qsort(out->plant, out->count, sizeof *out->plant, by_name);
  return PB_OK;
}

pb_status pb_plants_find(dds_entity_t participant, dds_entity_t description_topic,
                         const char *plant, double timeout, bool (*interrupted)(void),
                         pb_plants_seen *out, pb_error *err) {
  *out = (pb_plants_seen){0};
  const dds_entity_t subscriber = pb_partition_create(participant, plant ? plant : "*", false);
  const dds_entity_t reader =
      pb_reader_create(subscriber, description_topic, PB_TOPIC_DESCRIPTION, 0, NULL);
  const dds_entity_t waitset = dds_create_waitset(participant);
  const dds_entity_t condition = dds_create_readcondition(reader, DDS_ANY_STATE);
  pb_status status = PB_OK;
  if (dds_waitset_attach(waitset, condition, 0) < 0)
    status = pb_fail(err, PB_ERR_IO, "DDS", "the descriptions cannot be read");
  if (!status) status = wait_all(out, reader, waitset, plant, timeout, interrupted, err);
  if (waitset > 0) dds_delete(waitset);
  if (subscriber > 0) dds_delete(subscriber);
  if (status) pb_plants_clear(out);
  return status;
}

void pb_plants_clear(pb_plants_seen *plants) {
  for (size_t i = 0; i < plants->count; i++)
    plantbus_PlantDescription_free(plants->plant[i].description, DDS_FREE_ALL);
  free(plants->plant);
  *plants = (pb_plants_seen){0};
}

pb_status pb_plants_none(dds_entity_t participant, dds_entity_t description_topic,
                         const char *plant, uint32_t domain, double waited, pb_error *err) {
  static const double listen =
      0.5;  // daemons that are there have had the search's time to be heard
  pb_plants_seen others = {0};
  pb_error ignored;
  char names[300] = "";
  size_t used = 0;
  if (plant) pb_plants_find(participant, description_topic, NULL, listen, NULL, &others, &ignored);
  for (size_t i = 0; i < others.count; i++) {
    const char *name = others.plant[i].description->name;
    if (used + strlen(name) + 26 > sizeof names) {
      snprintf(names + used, sizeof names - used, ", and more");
      break;
    }
    used += (size_t)snprintf(names + used, sizeof names - used, "%s%s",
                             i ? ", " : "; served there: ", name);
  }
  pb_plants_clear(&others);
  return pb_fail(err, PB_ERR_STATE, plant ? plant : "plant",
                 "no daemon serves it on domain %u (waited %g s)%s", domain, waited,
                 names[0] ? names : "; plantbus-doctor tells why");
}
