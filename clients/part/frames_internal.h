// What the files that read frames share.
#ifndef PB_CLIENTS_PART_FRAMES_INTERNAL_H
#define PB_CLIENTS_PART_FRAMES_INTERNAL_H

#include <stdbool.h>

#include "frames.h"
#include "plant/reader.h"

// What a frame's keys are read with.
typedef struct frame_source {
  const char *name;  // file or flag, for messages
  const char *sets;  // deck with node sets; NULL: none
  double length;     // m per unit of the file
  pb_fem *fem;
  bool *chosen;  // [nodes] for selections
} frame_source;

// frame->node and ->nodes by the keys nodes, set, box, plane and cylinder; several of them
// intersect. A list keeps its order, which is that of its weights.
pb_status frame_choose_nodes(const frame_source *s, const pb_reader *r, pb_fem_frame *frame,
                             pb_error *err);

#endif
