// The topics of the bus and their qualities of service: one table, used by both sides.
#ifndef PB_BUS_QOS_H
#define PB_BUS_QOS_H

#include <stdbool.h>

#include "dds/dds.h"

#include "plantbus.h"

typedef enum pb_topic {
  PB_TOPIC_DESCRIPTION,
  PB_TOPIC_STATUS,
  PB_TOPIC_SAMPLE,
  PB_TOPIC_COMMAND,
  PB_TOPIC_REQUEST,
  PB_TOPIC_REPLY,
  PB_TOPIC_EVENT,
  PB_TOPIC_BLOCK_REQUEST,
  PB_TOPIC_BLOCK_REPLY,
  PB_TOPIC_TRACE,
  PB_TOPIC_COUNT
} pb_topic;

// "plantbus/v1/…" [any]
const char *pb_topic_name(pb_topic topic);

// The topic entity in a participant; a negative DDS code on failure. [init]
dds_entity_t pb_topic_create(dds_entity_t participant, pb_topic topic);

// The qualities of service of the topic's writers and readers, owned by the caller
// (dds_delete_qos). NULL: out of memory. [init]
dds_qos_t *pb_topic_qos(pb_topic topic);

// A publisher (or subscriber) in the partition of a plant; "*" listens to every plant. [init]
dds_entity_t pb_partition_create(dds_entity_t participant, const char *plant, bool publisher);

// Writer and reader with the table's qualities of service. `lease` (seconds, 0: none) is the time
// after which a command writer that gives no sign of life counts as dead. `depth` > 0 replaces the
// history depth (recorders of a topic that keeps the last). [init]
dds_entity_t pb_writer_create(dds_entity_t publisher, dds_entity_t topic_entity, pb_topic topic,
                              double lease);
dds_entity_t pb_reader_create(dds_entity_t subscriber, dds_entity_t topic_entity, pb_topic topic,
                              int depth, const dds_listener_t *listener);

// True when a plant's name can be a partition: no wildcard, no control character, 1 to 64
// octets. [any]
bool pb_plant_name_valid(const char *name);

#endif
