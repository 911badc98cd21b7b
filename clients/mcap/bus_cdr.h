// Messages of the bus as a file keeps them: CDR as DDS serialises it, with its four octets of
// encapsulation. Little-endian, of either edition (XCDR1 aligns to at most 8, XCDR2 to at most 4).
#ifndef PB_CLIENTS_BUS_CDR_H
#define PB_CLIENTS_BUS_CDR_H

#include "bytes.h"
#include "plantbus.h"

// False when the octets are not such a message; *out is then not defined. [any]
bool pb_cdr_sample(pb_view data, plantbus_Sample *out);

// The texts are views into data.
typedef struct pb_cdr_event_view {
  uint64_t number, step;
  uint32_t epoch;
  pb_view kind, client_name, channel, message;
} pb_cdr_event_view;
bool pb_cdr_event(pb_view data, pb_cdr_event_view *out);

// The step and epoch (0: not told) that a message of the topics command and status is for.
typedef struct pb_cdr_place {
  uint64_t step;
  uint32_t epoch;
} pb_cdr_place;
bool pb_cdr_command(pb_view data, pb_cdr_place *out);
bool pb_cdr_status(pb_view data, pb_cdr_place *out);

#endif
