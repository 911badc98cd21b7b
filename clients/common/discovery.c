// Participants, readers and writers that the middleware has discovered: see discovery.h.
#include "discovery.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dds/ddsi/ddsi_sertype.h"  // brings the functions on types in the order they need

// Appends room for one more element, zeroed; NULL: out of memory.
static void *grow(void **list, size_t *count, size_t size) {
  char *grown = realloc(*list, (*count + 1) * size);
  if (!grown) return NULL;
  *list = grown;
  memset(grown + *count * size, 0, size);
  return grown + (*count)++ * size;
}

static void property(const dds_qos_t *qos, const char *name, char *out, size_t size) {
  char *value = NULL;
  if (!dds_qget_prop(qos, name, &value) || !value) return;
  snprintf(out, size, "%s", value);
  dds_free(value);
}

static bool peer_add(pb_discovery *out, const dds_builtintopic_participant_t *p,
                     const dds_guid_t *own) {
  pb_peer *peer = grow((void **)&out->peer, &out->peers, sizeof *peer);
  if (!peer) return false;
  peer->guid = p->key;
  peer->own = memcmp(&p->key, own, sizeof *own) == 0;
  property(p->qos, "__Hostname", peer->host, sizeof peer->host);
  property(p->qos, "__ProcessName", peer->process, sizeof peer->process);
  property(p->qos, "__Pid", peer->pid, sizeof peer->pid);
  return true;
}

static void partitions(const dds_qos_t *qos, char *out, size_t size) {
  uint32_t count = 0;
  char **name = NULL;
  if (!dds_qget_partition(qos, &count, &name)) return;
  size_t used = 0;
  for (uint32_t i = 0; i < count; i++) {
    if (used < size)
      used += (size_t)snprintf(out + used, size - used, "%s%s", i ? "," : "", name[i]);
    dds_free(name[i]);
  }
  dds_free(name);
}

// Without type information on either side nothing can be said but by name.
static void types_compare(dds_builtintopic_endpoint_t *e, dds_entity_t topic, pb_endpoint *out) {
  const dds_typeinfo_t *theirs = NULL;
  dds_typeinfo_t *ours = NULL;
  if (dds_builtintopic_get_endpoint_type_info(e, &theirs) != DDS_RETCODE_OK || !theirs) return;
  if (dds_get_typeinfo(topic, &ours) != DDS_RETCODE_OK || !ours) return;
  ddsi_typeid_t *a = ddsi_typeinfo_typeid(theirs, DDSI_TYPEID_KIND_MINIMAL);
  ddsi_typeid_t *b = ddsi_typeinfo_typeid(ours, DDSI_TYPEID_KIND_MINIMAL);
  out->has_type_info = a && b && !ddsi_typeid_is_none(a) && !ddsi_typeid_is_none(b);
  out->same_type = out->has_type_info && ddsi_typeid_compare(a, b) == 0;
  if (a) ddsi_typeid_fini(a);
  if (b) ddsi_typeid_fini(b);
  dds_free(a);
  dds_free(b);
  dds_free_typeinfo(ours);
}

static bool endpoint_add(pb_discovery *out, dds_builtintopic_endpoint_t *e, bool writer,
                         const dds_entity_t topic[PB_TOPIC_COUNT]) {
  pb_endpoint *made = grow((void **)&out->endpoint, &out->endpoints, sizeof *made);
  if (!made) return false;
  made->participant = e->participant_key;
  made->writer = writer;
  snprintf(made->topic, sizeof made->topic, "%s", e->topic_name);
  snprintf(made->type, sizeof made->type, "%s", e->type_name);
  partitions(e->qos, made->partition, sizeof made->partition);
  for (int t = 0; t < PB_TOPIC_COUNT; t++)
    if (strcmp(made->topic, pb_topic_name((pb_topic)t)) == 0) types_compare(e, topic[t], made);
  made->qos = dds_create_qos();
  return made->qos && dds_copy_qos(made->qos, e->qos) == DDS_RETCODE_OK;
}

enum { BATCH = 32 };

typedef struct collector {
  pb_discovery *out;
  const dds_entity_t *topic;
  dds_guid_t own;
} collector;

static bool take_one(const collector *c, dds_entity_t pseudo_topic, void *sample) {
  if (pseudo_topic == DDS_BUILTIN_TOPIC_DCPSPARTICIPANT) return peer_add(c->out, sample, &c->own);
  dds_builtintopic_endpoint_t *e = sample;
  if (strncmp(e->topic_name, "plantbus/", 9) != 0) return true;
  if (memcmp(&e->participant_key, &c->own, sizeof c->own) == 0) return true;
  return endpoint_add(c->out, e, pseudo_topic == DDS_BUILTIN_TOPIC_DCPSPUBLICATION, c->topic);
}

static pb_status collect(const collector *c, dds_entity_t participant, dds_entity_t pseudo_topic,
                         pb_error *err) {
  const dds_entity_t reader = dds_create_reader(participant, pseudo_topic, NULL, NULL);
  if (reader < 0) return pb_fail(err, PB_ERR_IO, "DDS", "%s", dds_strretcode(-reader));
  bool good = true;
  for (;;) {
    void *sample[BATCH] = {NULL};
    dds_sample_info_t info[BATCH];
    const dds_return_t count = dds_take(reader, sample, info, BATCH, BATCH);
    for (dds_return_t i = 0; good && i < count; i++)
      if (info[i].valid_data && info[i].instance_state == DDS_IST_ALIVE)
        good = take_one(c, pseudo_topic, sample[i]);
    if (count > 0) dds_return_loan(reader, sample, count);
    if (count < BATCH || !good) break;
  }
  dds_delete(reader);
  return good ? PB_OK : pb_fail_memory(err, "discovery");
}

pb_status pb_discovery_read(dds_entity_t participant, const dds_entity_t topic[PB_TOPIC_COUNT],
                            pb_discovery *out, pb_error *err) {
  collector c = {.out = out, .topic = topic};
  *out = (pb_discovery){0};
  if (dds_get_guid(participant, &c.own) != DDS_RETCODE_OK)
    return pb_fail(err, PB_ERR_IO, "DDS", "the participant has no identity");
  pb_status status = collect(&c, participant, DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, err);
  if (!status) status = collect(&c, participant, DDS_BUILTIN_TOPIC_DCPSPUBLICATION, err);
  if (!status) status = collect(&c, participant, DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION, err);
  if (status) pb_discovery_clear(out);
  return status;
}

void pb_discovery_clear(pb_discovery *d) {
  for (size_t i = 0; i < d->endpoints; i++) dds_delete_qos(d->endpoint[i].qos);
  free(d->endpoint);
  free(d->peer);
  *d = (pb_discovery){0};
}

const pb_peer *pb_discovery_peer(const pb_discovery *d, const dds_guid_t *guid) {
  for (size_t i = 0; i < d->peers; i++)
    if (memcmp(&d->peer[i].guid, guid, sizeof *guid) == 0) return &d->peer[i];
  return NULL;
}

void pb_peer_format(const pb_peer *peer, char *text, size_t size) {
  if (!peer || (!peer->process[0] && !peer->host[0])) {
    snprintf(text, size, "an unknown process");
    return;
  }
  snprintf(text, size, "%s%s%s%s%s%s", peer->process[0] ? peer->process : "a process",
           peer->pid[0] ? "[" : "", peer->pid, peer->pid[0] ? "]" : "", peer->host[0] ? " on " : "",
           peer->host);
}
