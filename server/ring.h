// A bounded queue between one thread that puts and one that takes, without locks (C11 atomics).
// Slots are of fixed size and owned by the caller; the capacity is a power of two.
#ifndef PB_RING_H
#define PB_RING_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

typedef struct pb_ring {
  unsigned char *slot;
  size_t size, mask;    // octets of a slot; capacity − 1
  char apart_head[64];  // the two ends lie on cache lines of their own
  atomic_size_t head;   // next to put; written by the producer only
  char apart_tail[64];
  atomic_size_t tail;  // next to take; written by the consumer only
} pb_ring;

static inline void pb_ring_init(pb_ring *ring, void *slots, size_t size, size_t capacity) {
  ring->slot = slots;
  ring->size = size;
  ring->mask = capacity - 1;
  atomic_init(&ring->head, 0);
  atomic_init(&ring->tail, 0);
}

// Producer: false when full. [rt]
static inline bool pb_ring_put(pb_ring *ring, const void *item) {
  const size_t head = atomic_load_explicit(&ring->head, memory_order_relaxed);
  const size_t tail = atomic_load_explicit(&ring->tail, memory_order_acquire);
  if (head - tail > ring->mask) return false;
  memcpy(ring->slot + (head & ring->mask) * ring->size, item, ring->size);
  atomic_store_explicit(&ring->head, head + 1, memory_order_release);
  return true;
}

// Consumer: false when empty. [rt]
static inline bool pb_ring_take(pb_ring *ring, void *item) {
  const size_t tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
  const size_t head = atomic_load_explicit(&ring->head, memory_order_acquire);
  if (head == tail) return false;
  memcpy(item, ring->slot + (tail & ring->mask) * ring->size, ring->size);
  atomic_store_explicit(&ring->tail, tail + 1, memory_order_release);
  return true;
}

#endif
