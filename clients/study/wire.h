// What became of a point, as bytes between processes of the same program.
#ifndef PB_STUDY_WIRE_H
#define PB_STUDY_WIRE_H

#include "study/point.h"

typedef struct study_message {
  size_t index;  // of the point
  pb_status status;
  pb_error err;          // of a failure
  pb_study_point point;  // of a success; owned
} study_message;

// *bytes [*size] is the caller's (free). [init] PB_ERR_MEMORY.
pb_status study_message_pack(const study_message *message, void **bytes, size_t *size,
                             pb_error *err);

// PB_ERR_SYNTAX: the bytes are not a message. [init]
pb_status study_message_unpack(const void *bytes, size_t size, study_message *out, pb_error *err);

#endif
