// Joining a DDS domain: the configuration both sides use when the user gives none, and a
// participant.
#ifndef PB_BUS_DOMAIN_H
#define PB_BUS_DOMAIN_H

#include <stddef.h>
#include <stdbool.h>
#include <stdint.h>

#include "dds/dds.h"

#include "base/status.h"

typedef struct pb_domain_options {
  uint32_t domain;
  const char *config;     // file name of a Cyclone DDS configuration; NULL: none
  const char *interface;  // network interface of the built-in configuration; NULL: lo
} pb_domain_options;

// Installs the log that cannot block (bus_log.h) and creates a participant. The configuration is,
// in this order: options->config, the environment's CYCLONEDDS_URI, the built-in one. The built-in
// one stays on this host unless an interface is named. A domain that this process has already
// opened keeps its configuration. Threads of the middleware inherit the caller's scheduling. [init]
// Fails with PB_ERR_IO: DDS, the file.
pb_status pb_domain_join(const pb_domain_options *options, dds_entity_t *participant,
                         pb_error *err);

// The built-in configuration for an interface as XML into text. [any]
void pb_domain_config(const char *interface, char *text, size_t size);

#endif
