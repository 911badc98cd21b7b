// Storage for matrices. Touching fresh memory in pages of 4 KiB can cost more than what is computed
// in it; large arrays are therefore aligned to huge pages and ask for them, where the system gives
// them on request (madvise). Free with free().
#ifndef PB_BASE_ARRAY_H
#define PB_BASE_ARRAY_H

#include <stddef.h>

// count × size octets, uninitialised or zeroed; never of zero length. NULL: out of memory, or the
// product overflows. [init]
void *pb_array_new(size_t count, size_t size);
void *pb_array_zero(size_t count, size_t size);

#endif
