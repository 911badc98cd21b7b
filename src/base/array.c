// See array.h.
#include "base/array.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

static const size_t huge_page = (size_t)2 << 20;
static const size_t large = (size_t)512 << 10;  // from here on an array may fill a page of its own

void *pb_array_new(size_t count, size_t size) {
  if (size && count > (SIZE_MAX / 2) / size) return NULL;
  const size_t bytes = count * size;
  if (bytes < large) return malloc(bytes ? bytes : 1);
  const size_t whole = (bytes + huge_page - 1) / huge_page * huge_page;
  void *p = aligned_alloc(huge_page, whole);
#ifdef MADV_HUGEPAGE
  if (p) madvise(p, whole, MADV_HUGEPAGE);  // advice: whether it is taken changes nothing else
#endif
  return p;
}

void *pb_array_zero(size_t count, size_t size) {
  void *p = pb_array_new(count, size);
  if (p) memset(p, 0, count * size);
  return p;
}
