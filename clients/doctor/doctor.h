// plantbus-doctor: what its checks share. They run in this order and stop where nothing further can
// be seen.
#ifndef PB_CLIENTS_DOCTOR_H
#define PB_CLIENTS_DOCTOR_H

#include "config.h"
#include "discovery.h"
#include "options.h"
#include "report.h"

typedef struct doctor_options {
  pb_common_options common;
  double timeout;  // s
  bool json, scan;
  uint32_t scan_first, scan_last;
} doctor_options;

typedef struct doctor {
  const doctor_options *options;
  report report;
  config_facts facts;
  bool loopback;  // the configuration stays on this host
  dds_entity_t participant, topic[PB_TOPIC_COUNT];
  pb_discovery seen;
  pb_plants_seen plants;
} doctor;

// --- host.c: what this host says, before the domain is joined. False: there is no configuration.
bool doctor_configuration(doctor *d);
void doctor_interfaces(doctor *d);
void doctor_ports(doctor *d);
void doctor_buffers(doctor *d);   // after doctor_plants
void doctor_firewall(doctor *d);  // at the end: whether it is worth a word depends on what was seen

// --- bus.c ---
bool doctor_join(doctor *d);
void doctor_discover(doctor *d);
void doctor_participants(doctor *d);
void doctor_plants(doctor *d);
void doctor_endpoints(doctor *d);

// Participants but our own.
size_t doctor_others(const doctor *d);

// --- flow.c: asks each plant (or the one named) and watches its samples.
void doctor_flow(doctor *d);

// --- scan.c: participants and plants of a range of domains, as a list or JSON.
pb_status doctor_scan(const doctor_options *options, pb_error *err);

#endif
