// What a Cyclone DDS configuration says about networks and processes.
#ifndef PB_CLIENTS_DOCTOR_CONFIG_H
#define PB_CLIENTS_DOCTOR_CONFIG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

enum { CONFIG_INTERFACES = 8 };

typedef struct config_interface {
  char name[64];        // empty: chosen by the middleware
  char address[64];     // empty: not given
  bool multicast_told;  // the configuration says whether it can
  bool multicast;
} config_interface;

typedef struct config_facts {
  size_t interfaces;  // 0: chosen by the middleware
  config_interface interface[CONFIG_INTERFACES];
  bool multicast;   // discovery may use it
  bool index_auto;  // each process takes a port of its own
  uint32_t index_max;
  size_t peers;
} config_facts;

// Reads a configuration text: XML, or pieces as CYCLONEDDS_URI has them ("file://NAME", a name, or
// XML, separated by commas outside of XML). Fails with PB_ERR_IO (a file), PB_ERR_SYNTAX (with the
// line), naming the piece. [init]
pb_status config_read(const char *text, config_facts *out, pb_error *err);

#endif
