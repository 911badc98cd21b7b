// Bytes as MCAP files hold them: a buffer that grows, and a cursor that reads one. Little-endian,
// texts and maps preceded by their length in 32 bits.
#ifndef PB_CLIENTS_BYTES_H
#define PB_CLIENTS_BYTES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

// Zero-initialise. A failed allocation is remembered in `failed`; what follows it is not stored.
typedef struct pb_bytes {
  uint8_t *p;
  size_t size, capacity;
  bool failed;
} pb_bytes;

// Room for `size` more octets, not yet set; NULL when there is no memory.
uint8_t *pb_bytes_grow(pb_bytes *b, size_t size);
void pb_bytes_raw(pb_bytes *b, const void *data, size_t size);
void pb_bytes_u8(pb_bytes *b, uint8_t value);
void pb_bytes_u16(pb_bytes *b, uint16_t value);
void pb_bytes_u32(pb_bytes *b, uint32_t value);
void pb_bytes_u64(pb_bytes *b, uint64_t value);
void pb_bytes_text(pb_bytes *b, const char *text);
void pb_bytes_free(pb_bytes *b);

// Overwrites what was stored at `at` (a length that is known only afterwards).
void pb_bytes_set_u32(pb_bytes *b, size_t at, uint32_t value);
void pb_bytes_set_u64(pb_bytes *b, size_t at, uint64_t value);

// A text or block inside a buffer that it does not own; not terminated.
typedef struct pb_view {
  const uint8_t *p;
  size_t size;
} pb_view;

bool pb_view_is(pb_view view, const char *text);

// A terminated copy, owned by the caller; NULL: out of memory.
char *pb_view_copy(pb_view view);

// Reads past the end give zero and set `bad`, so that a record is read without checks in between.
typedef struct pb_cursor {
  const uint8_t *p;
  size_t left;
  bool bad;
} pb_cursor;

uint8_t pb_cursor_u8(pb_cursor *c);
uint16_t pb_cursor_u16(pb_cursor *c);
uint32_t pb_cursor_u32(pb_cursor *c);
uint64_t pb_cursor_u64(pb_cursor *c);
pb_view pb_cursor_take(pb_cursor *c, uint64_t size);
pb_view pb_cursor_text(pb_cursor *c);  // also a map or an array: its length and what it holds

// CRC-32 (IEEE 802.3) of a and then of data: pb_crc32(pb_crc32(0, a), b) is that of both. [any]
uint32_t pb_crc32(uint32_t crc, const void *data, size_t size);

#endif
