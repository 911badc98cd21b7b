// Finding the plant on the bus and waiting for partners.
#include <stdio.h>
#include <string.h>

#include "discovery.h"
#include "session_internal.h"

static const int64_t settle_ns = 100000000;  // to hear of other plants, when none is named
static const int64_t poll_ns = 20000000;     // between looks for the daemon among the partners

static uint32_t partners(dds_entity_t entity, bool writer) {
  dds_publication_matched_status_t p = {0};
  dds_subscription_matched_status_t q = {0};
  if (writer) {
    dds_get_publication_matched_status(entity, &p);
    return p.current_count;
  }
  dds_get_subscription_matched_status(entity, &q);
  return q.current_count;
}

// Takes what is there and counts it; keeps the first that is wanted. *other: a second name was
// seen.
static uint32_t descriptions_take(pb_session *s, dds_entity_t reader, const char *plant,
                                  char *other) {
  uint32_t taken = 0;
  for (;;) {
    plantbus_PlantDescription *d = plantbus_PlantDescription__alloc();
    if (!d) return taken;
    memset(d, 0, sizeof *d);
    void *sample[1] = {d};
    dds_sample_info_t info;
    const dds_return_t n = dds_take(reader, sample, &info, 1, 1);
    taken += n == 1 && info.valid_data;
    if (n == 1 && info.valid_data && (!plant || strcmp(d->name, plant) == 0)) {
      if (!s->received) {
        s->received = d;
        continue;
      }
      if (strcmp(d->name, s->received->name) != 0) snprintf(other, 65, "%s", d->name);
    }
    plantbus_PlantDescription_free(d, DDS_FREE_ALL);
    if (n != 1) return taken;
  }
}

// When no plant is named, the time to hear of others must be over, and every daemon that was heard
// of must have told its plant: a large description takes longer than a small one.
static bool all_heard(dds_entity_t reader, uint32_t taken, int64_t settled) {
  return pb_session_clock() >= settled && taken >= partners(reader, false);
}

static pb_status description_wait(pb_session *s, dds_entity_t reader, const char *plant,
                                  pb_error *err) {
  char other[65] = "";
  const int64_t deadline = pb_session_clock() + (int64_t)(s->timeout * 1e9);
  const dds_entity_t waitset = dds_create_waitset(s->participant);
  const dds_entity_t condition = dds_create_readcondition(reader, DDS_ANY_STATE);
  dds_waitset_attach(waitset, condition, 0);
  int64_t settled = 0;
  uint32_t taken = 0;
  for (;;) {
    const int64_t now = pb_session_clock();
    const int64_t until = settled > now ? settled : deadline;
    if (now >= deadline) break;
    dds_waitset_wait(waitset, NULL, 0, (until < deadline ? until : deadline) - now);
    taken += descriptions_take(s, reader, plant, other);
    if (!s->received) continue;
    if (plant || other[0]) break;
    if (settled == 0) settled = pb_session_clock() + settle_ns;
    if (all_heard(reader, taken, settled)) break;
  }
  dds_delete(waitset);
  dds_delete(condition);
  if (!s->received)
    return pb_plants_none(s->participant, s->topic[PB_TOPIC_DESCRIPTION], plant, s->domain,
                          s->timeout, err);
  if (other[0])
    return pb_fail(err, PB_ERR_STATE, "plant", "'%s' and '%s' are served on domain %u: name one",
                   s->received->name, other, s->domain);
  return PB_OK;
}

pb_status pb_session_find(pb_session *s, const char *plant, pb_error *err) {
  const dds_entity_t subscriber = pb_partition_create(s->participant, plant ? plant : "*", false);
  if (subscriber < 0) return pb_fail(err, PB_ERR_IO, "DDS", "%s", dds_strretcode(-subscriber));
  const dds_entity_t reader =
      pb_reader_create(subscriber, s->topic[PB_TOPIC_DESCRIPTION], PB_TOPIC_DESCRIPTION, 0, NULL);
  pb_status status = reader < 0 ? pb_fail(err, PB_ERR_IO, "DDS", "%s", dds_strretcode(-reader))
                                : description_wait(s, reader, plant, err);
  dds_delete(subscriber);
  return status;
}

pb_status pb_session_match(pb_session *s, dds_entity_t entity, bool writer, bool only,
                           int64_t deadline, pb_error *err) {
  const dds_entity_t waitset = dds_create_waitset(s->participant);
  dds_set_status_mask(entity,
                      writer ? DDS_PUBLICATION_MATCHED_STATUS : DDS_SUBSCRIPTION_MATCHED_STATUS);
  dds_waitset_attach(waitset, entity, 0);
  uint32_t count;
  for (;;) {
    count = partners(entity, writer);
    const int64_t now = pb_session_clock();
    if (count > 0 || now >= deadline) break;
    dds_waitset_wait(waitset, NULL, 0, deadline - now);
  }
  dds_delete(waitset);
  if (count == 0)
    return pb_fail(err, PB_ERR_STATE, s->received->name, "the daemon does not answer on the bus");
  if (count > 1 && only)
    return pb_fail(err, PB_ERR_STATE, s->received->name, "%u daemons serve a plant of this name",
                   count);
  return PB_OK;
}

// Whether one of the writer's readers belongs to the participant that also writes the replies.
static bool daemon_reads(const pb_session *s, dds_entity_t writer) {
  enum { MOST = 64 };
  dds_instance_handle_t peer, list[MOST];
  if (dds_get_matched_publications(s->reply, &peer, 1) < 1) return false;
  dds_builtintopic_endpoint_t *daemon = dds_get_matched_publication_data(s->reply, peer);
  if (!daemon) return false;
  dds_return_t count = dds_get_matched_subscriptions(writer, list, MOST);
  bool found = false;
  for (dds_return_t i = 0; i < count && i < MOST && !found; i++) {
    dds_builtintopic_endpoint_t *reader = dds_get_matched_subscription_data(writer, list[i]);
    if (!reader) continue;
    found = memcmp(&reader->participant_key, &daemon->participant_key,
                   sizeof daemon->participant_key) == 0;
    dds_builtintopic_free_endpoint(reader);
  }
  dds_builtintopic_free_endpoint(daemon);
  return found;
}

// Recorders may read the commands too: more than one reader is no second daemon.
pb_status pb_session_match_daemon(pb_session *s, dds_entity_t writer, int64_t deadline,
                                  pb_error *err) {
  const dds_entity_t waitset = dds_create_waitset(s->participant);
  dds_set_status_mask(writer, DDS_PUBLICATION_MATCHED_STATUS);
  dds_waitset_attach(waitset, writer, 0);
  bool found;
  while (!(found = daemon_reads(s, writer))) {
    uint32_t changed;
    const int64_t now = pb_session_clock();
    if (now >= deadline) break;
    dds_waitset_wait(waitset, NULL, 0, deadline - now < poll_ns ? deadline - now : poll_ns);
    dds_take_status(writer, &changed, DDS_PUBLICATION_MATCHED_STATUS);
  }
  dds_delete(waitset);
  if (!found)
    return pb_fail(err, PB_ERR_STATE, s->received->name, "the daemon does not answer on the bus");
  return PB_OK;
}
