// A set of items (internal to host*.c).
#ifndef PB_HOST_SET_H
#define PB_HOST_SET_H

#include "host_item.h"

struct pb_host {
  double sample_rate;  // Hz
  size_t count;
  pb_host_item item[PB_HOST_ITEMS];  // in order of creation
  uint8_t order[PB_HOST_ITEMS];      // by name of channel
  size_t bytes;
  unsigned char *state;  // [bytes] of all items
  double *scratch;       // [most states of a part] for a controller's step
};

#endif
