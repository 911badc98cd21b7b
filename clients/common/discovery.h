// Who is in a DDS domain, as the middleware has discovered it: processes, and their readers and
// writers of the bus. For tools that look at the bus; a client finds its plant with session.h.
#ifndef PB_CLIENTS_DISCOVERY_H
#define PB_CLIENTS_DISCOVERY_H

#include <stdbool.h>
#include <stddef.h>

#include "base/status.h"
#include "bus_qos.h"

// A participant; texts are empty when it does not tell.
typedef struct pb_peer {
  dds_guid_t guid;
  bool own;  // of this process' participant
  char host[64], process[64], pid[16];
} pb_peer;

// A reader or writer of a topic of the bus ("plantbus/…").
typedef struct pb_endpoint {
  dds_guid_t participant;
  bool writer;
  char topic[128], type[128];
  char partition[160];            // joined by commas; empty: the default one
  dds_qos_t *qos;                 // owned
  bool has_type_info, same_type;  // same_type: as this program was built with
} pb_endpoint;

// Zero-initialise; free with pb_discovery_clear.
typedef struct pb_discovery {
  size_t peers, endpoints;
  pb_peer *peer;          // [peers]
  pb_endpoint *endpoint;  // [endpoints] of other participants
} pb_discovery;

// What is known at this moment. topic: the bus' topics of this participant, to compare types with.
// Fails with PB_ERR_IO, PB_ERR_MEMORY. [init]
pb_status pb_discovery_read(dds_entity_t participant, const dds_entity_t topic[PB_TOPIC_COUNT],
                            pb_discovery *out, pb_error *err);
void pb_discovery_clear(pb_discovery *discovery);

// The participant of this id, or NULL.
const pb_peer *pb_discovery_peer(const pb_discovery *discovery, const dds_guid_t *guid);

// "process[pid] on host", or as much of it as is known, into text. peer may be NULL. [any]
void pb_peer_format(const pb_peer *peer, char *text, size_t size);

// A plant that a daemon describes.
typedef struct pb_plant_seen {
  plantbus_PlantDescription *description;  // owned
  dds_instance_handle_t writer;
  dds_guid_t participant;  // of the daemon
} pb_plant_seen;

typedef struct pb_plants_seen {
  size_t count;
  pb_plant_seen *plant;  // [count], by name; two daemons of one name are two
} pb_plants_seen;

// Waits up to `timeout` seconds for descriptions: of the plant named, or, with plant NULL, until
// every daemon heard of has described its own. None in time is no failure. interrupted may be NULL.
// Fails with PB_ERR_IO, PB_ERR_MEMORY. [init]
pb_status pb_plants_find(dds_entity_t participant, dds_entity_t description_topic,
                         const char *plant, double timeout, bool (*interrupted)(void),
                         pb_plants_seen *out, pb_error *err);
void pb_plants_clear(pb_plants_seen *plants);

// The failure of a search that found nothing on this domain in this time: PB_ERR_STATE, with the
// plants that are served there when another one was named. [init]
pb_status pb_plants_none(dds_entity_t participant, dds_entity_t description_topic,
                         const char *plant, uint32_t domain, double waited, pb_error *err);

#endif
