// The fault flags in words: see bus_flags.h.
#include "bus_flags.h"

#include "plantbus.h"

static const struct {
  uint32_t flag;
  const char *name, *text;
} known[PB_FLAG_BITS] = {
    {plantbus_FLAG_HELD, "held",
     "samples at which an attached client had given no command for the last interval"},
    {plantbus_FLAG_LATE, "late", "samples at which a command acted later than its step"},
    {plantbus_FLAG_NON_FINITE, "non_finite", "samples with an output that is not finite"},
    {plantbus_FLAG_OVERRUN, "overrun", "samples that began later than one interval"},
    {plantbus_FLAG_SATURATED, "saturated",
     "samples at which an input was cut by its electronics: range or slew"},
};

const char *pb_flag_name(unsigned bit) {
  return bit < PB_FLAG_BITS ? known[bit].name : "unknown";
}

const char *pb_flag_text(unsigned bit) {
  return bit < PB_FLAG_BITS ? known[bit].text : "samples with an unknown flag";
}

void pb_flags_count(uint32_t flags, uint64_t *count) {
  for (unsigned bit = 0; bit < PB_FLAG_BITS; bit++) count[bit] += (flags & known[bit].flag) != 0;
}
