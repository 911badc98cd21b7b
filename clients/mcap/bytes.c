// See bytes.h.
#include "bytes.h"

#include <stdlib.h>
#include <string.h>

uint8_t *pb_bytes_grow(pb_bytes *b, size_t size) {
  if (b->failed || size > SIZE_MAX / 4 - b->size) {
    b->failed = true;
    return NULL;
  }
  if (b->size + size > b->capacity) {
    const size_t capacity = 2 * (b->size + size) + 64;
    uint8_t *grown = realloc(b->p, capacity);
    if (!grown) {
      b->failed = true;
      return NULL;
    }
    b->p = grown;
    b->capacity = capacity;
  }
  uint8_t *at = b->p + b->size;
  b->size += size;
  return at;
}

void pb_bytes_raw(pb_bytes *b, const void *data, size_t size) {
  uint8_t *at = pb_bytes_grow(b, size);
  if (at && size > 0) memcpy(at, data, size);
}

static void put(uint8_t *at, uint64_t value, int octets) {
  for (int i = 0; i < octets; i++) at[i] = (uint8_t)(value >> 8 * i);
}

static void append(pb_bytes *b, uint64_t value, int octets) {
  uint8_t *at = pb_bytes_grow(b, (size_t)octets);
  if (at) put(at, value, octets);
}

void pb_bytes_u8(pb_bytes *b, uint8_t value) {
  append(b, value, 1);
}

void pb_bytes_u16(pb_bytes *b, uint16_t value) {
  append(b, value, 2);
}

void pb_bytes_u32(pb_bytes *b, uint32_t value) {
  append(b, value, 4);
}

void pb_bytes_u64(pb_bytes *b, uint64_t value) {
  append(b, value, 8);
}

void pb_bytes_text(pb_bytes *b, const char *text) {
  const size_t size = strlen(text);
  if (size > UINT32_MAX) b->failed = true;
  pb_bytes_u32(b, (uint32_t)size);
  pb_bytes_raw(b, text, size);
}

void pb_bytes_free(pb_bytes *b) {
  free(b->p);
  *b = (pb_bytes){0};
}

void pb_bytes_set_u32(pb_bytes *b, size_t at, uint32_t value) {
  if (!b->failed) put(b->p + at, value, 4);
}

void pb_bytes_set_u64(pb_bytes *b, size_t at, uint64_t value) {
  if (!b->failed) put(b->p + at, value, 8);
}

bool pb_view_is(pb_view view, const char *text) {
  return view.size == strlen(text) && memcmp(view.p, text, view.size) == 0;
}

char *pb_view_copy(pb_view view) {
  char *text = malloc(view.size + 1);
  if (!text) return NULL;
  if (view.size > 0) memcpy(text, view.p, view.size);
  text[view.size] = '\0';
  return text;
}

pb_view pb_cursor_take(pb_cursor *c, uint64_t size) {
  if (c->bad || size > c->left) {
    c->bad = true;
    return (pb_view){(const uint8_t *)"", 0};
  }
  const pb_view view = {c->p, (size_t)size};
  c->p += size;
  c->left -= (size_t)size;
  return view;
}

static uint64_t number(pb_cursor *c, int octets) {
  const pb_view view = pb_cursor_take(c, (uint64_t)octets);
  uint64_t value = 0;
  for (size_t i = 0; i < view.size; i++) value |= (uint64_t)view.p[i] << 8 * i;
  return value;
}

uint8_t pb_cursor_u8(pb_cursor *c) {
  return (uint8_t)number(c, 1);
}

uint16_t pb_cursor_u16(pb_cursor *c) {
  return (uint16_t)number(c, 2);
}

uint32_t pb_cursor_u32(pb_cursor *c) {
  return (uint32_t)number(c, 4);
}

uint64_t pb_cursor_u64(pb_cursor *c) {
  return number(c, 8);
}

pb_view pb_cursor_text(pb_cursor *c) {
  return pb_cursor_take(c, pb_cursor_u32(c));
}

// Polynomial 0xEDB88320 (reflected), four bits at a time: the table is 64 bytes and needs no
// initialisation at run time.
uint32_t pb_crc32(uint32_t crc, const void *data, size_t size) {
  static const uint32_t table[16] = {0x00000000, 0x1db71064, 0x3b6e20c8, 0x26d930ac,
                                     0x76dc4190, 0x6b6b51f4, 0x4db26158, 0x5005713c,
                                     0xedb88320, 0xf00f9344, 0xd6d6a3e8, 0xcb61b38c,
                                     0x9b64c2b0, 0x86d3d2d4, 0xa00ae278, 0xbdbdf21c};
  const uint8_t *p = data;
  crc = ~crc;
  for (size_t i = 0; i < size; i++) {
    crc ^= p[i];
    crc = crc >> 4 ^ table[crc & 15];
    crc = crc >> 4 ^ table[crc & 15];
  }
  return ~crc;
}
