// The fault flags of the bus (FLAG_… in plantbus.idl) in words.
#ifndef PB_BUS_FLAGS_H
#define PB_BUS_FLAGS_H

#include <stdint.h>

enum { PB_FLAG_BITS = 5 };

// The name of a bit ("held", "late", "non_finite", "overrun", "saturated"); "unknown" beyond. [any]
const char *pb_flag_name(unsigned bit);

// What it says of a sample, to follow a count: "samples at which an input was cut …". [any]
const char *pb_flag_text(unsigned bit);

// Counts the flags of a sample into count [PB_FLAG_BITS]. [any]
void pb_flags_count(uint32_t flags, uint64_t *count);

#endif
