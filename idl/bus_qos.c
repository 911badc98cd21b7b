// See bus_qos.h. Reasons for the values:
// - KEEP_LAST writers never block on a reader that stopped; only requests, where each one counts,
//   are kept all, and then the client is the one that may block. The trace is kept all, too: its
//   writer does not block but refuses, and lockstep waits with the next step.
// - everything is ordered by reception: clocks of two hosts need not agree, and what comes after a
//   wall clock was set back is not older than what a reader has.
// - reply and block_reply are TRANSIENT_LOCAL: an answer survives a match that is completed late.
//   A client has one block on its way, so that one answer is kept for each.
// - latency budgets stay 0: a positive one would hold a sample back until the next write.
#include "bus_qos.h"

#include <string.h>

typedef struct topic_row {
  const char *name;
  const dds_topic_descriptor_t *descriptor;
  dds_durability_kind_t durability;
  int depth;        // of the history; 0: keep all
  int limit;        // of samples held when all are kept
  int blocking_ms;  // longest time a write may block
  bool manual_liveliness;
} topic_row;

static const topic_row table[PB_TOPIC_COUNT] = {
    [PB_TOPIC_DESCRIPTION] = {"plantbus/v1/description", &plantbus_PlantDescription_desc,
                              DDS_DURABILITY_TRANSIENT_LOCAL, 1, 0, 50, false},
    [PB_TOPIC_STATUS] = {"plantbus/v1/status", &plantbus_PlantStatus_desc,
                         DDS_DURABILITY_TRANSIENT_LOCAL, 1, 0, 5, false},
    [PB_TOPIC_SAMPLE] = {"plantbus/v1/sample", &plantbus_Sample_desc, DDS_DURABILITY_VOLATILE, 1, 0,
                         5, false},
    [PB_TOPIC_COMMAND] = {"plantbus/v1/command", &plantbus_Command_desc, DDS_DURABILITY_VOLATILE, 1,
                          0, 5, true},
    [PB_TOPIC_REQUEST] = {"plantbus/v1/request", &plantbus_Request_desc, DDS_DURABILITY_VOLATILE, 0,
                          1024, 1000, false},
    [PB_TOPIC_REPLY] = {"plantbus/v1/reply", &plantbus_Reply_desc, DDS_DURABILITY_TRANSIENT_LOCAL,
                        4, 0, 5, false},
    [PB_TOPIC_EVENT] = {"plantbus/v1/event", &plantbus_Event_desc, DDS_DURABILITY_VOLATILE, 256, 0,
                        5, false},
    [PB_TOPIC_BLOCK_REQUEST] = {"plantbus/v1/block_request", &plantbus_BlockRequest_desc,
                                DDS_DURABILITY_VOLATILE, 8, 0, 50, false},
    [PB_TOPIC_BLOCK_REPLY] = {"plantbus/v1/block_reply", &plantbus_BlockReply_desc,
                              DDS_DURABILITY_TRANSIENT_LOCAL, 1, 0, 50, false},
    [PB_TOPIC_TRACE] = {"plantbus/v1/trace", &plantbus_Sample_desc, DDS_DURABILITY_VOLATILE, 0,
                        DDS_LENGTH_UNLIMITED, 0, false},
};

const char *pb_topic_name(pb_topic topic) {
  return table[topic].name;
}

dds_entity_t pb_topic_create(dds_entity_t participant, pb_topic topic) {
  return dds_create_topic(participant, table[topic].descriptor, table[topic].name, NULL, NULL);
}

dds_qos_t *pb_topic_qos(pb_topic topic) {
  const topic_row *row = &table[topic];
  dds_qos_t *qos = dds_create_qos();
  if (!qos) return NULL;
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_MSECS(row->blocking_ms));
  dds_qset_durability(qos, row->durability);
  if (row->depth > 0) {
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, row->depth);
  } else {
    dds_qset_history(qos, DDS_HISTORY_KEEP_ALL, 0);
    dds_qset_resource_limits(qos, row->limit, DDS_LENGTH_UNLIMITED, row->limit);
  }
  // What a late reader gets back of a TRANSIENT_LOCAL topic: as much as the history.
  if (row->durability == DDS_DURABILITY_TRANSIENT_LOCAL)
    dds_qset_durability_service(qos, 0, DDS_HISTORY_KEEP_LAST, row->depth, DDS_LENGTH_UNLIMITED,
                                DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  dds_qset_destination_order(qos, DDS_DESTINATIONORDER_BY_RECEPTION_TIMESTAMP);
  // A reader that asks for an infinite lease matches a writer with any.
  if (row->manual_liveliness)
    dds_qset_liveliness(qos, DDS_LIVELINESS_MANUAL_BY_TOPIC, DDS_INFINITY);
  // Unregistering an instance must not dispose it: the daemon tells a hand-over from a disposal.
  dds_qset_writer_data_lifecycle(qos, false);
  return qos;
}

dds_entity_t pb_partition_create(dds_entity_t participant, const char *plant, bool publisher) {
  dds_qos_t *qos = dds_create_qos();
  if (!qos) return DDS_RETCODE_OUT_OF_RESOURCES;
  dds_qset_partition1(qos, plant);
  dds_entity_t entity = publisher ? dds_create_publisher(participant, qos, NULL)
                                  : dds_create_subscriber(participant, qos, NULL);
  dds_delete_qos(qos);
  return entity;
}

dds_entity_t pb_writer_create(dds_entity_t publisher, dds_entity_t topic_entity, pb_topic topic,
                              double lease) {
  dds_qos_t *qos = pb_topic_qos(topic);
  if (!qos) return DDS_RETCODE_OUT_OF_RESOURCES;
  if (lease > 0.0 && table[topic].manual_liveliness)
    dds_qset_liveliness(qos, DDS_LIVELINESS_MANUAL_BY_TOPIC, (dds_duration_t)(lease * 1e9));
  dds_entity_t writer = dds_create_writer(publisher, topic_entity, qos, NULL);
  dds_delete_qos(qos);
  return writer;
}

dds_entity_t pb_reader_create(dds_entity_t subscriber, dds_entity_t topic_entity, pb_topic topic,
                              int depth, const dds_listener_t *listener) {
  dds_qos_t *qos = pb_topic_qos(topic);
  if (!qos) return DDS_RETCODE_OUT_OF_RESOURCES;
  if (depth > 0) dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, depth);
  dds_entity_t reader = dds_create_reader(subscriber, topic_entity, qos, listener);
  dds_delete_qos(qos);
  return reader;
}

bool pb_plant_name_valid(const char *name) {
  const size_t length = strlen(name);
  for (size_t i = 0; i < length; i++)
    if ((unsigned char)name[i] < ' ' || name[i] == 0x7f) return false;
  return length > 0 && length <= 64 && strpbrk(name, "*?[]") == NULL;
}
