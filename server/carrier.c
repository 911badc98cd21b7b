// See carrier.h.
#include "carrier.h"

#include <math.h>
#include <string.h>

#include "fpenv.h"

size_t pb_carrier_steps(const pb_transfer *transfer, double rate) {
  enum { MOST = 256 };
  const double wakes = 2e-3, octets_a_second = 1e10, part_of_a_step = 0.2;
  if (!transfer->x || !(rate > 0.0)) return 0;
  const double octets = 8.0 * (double)transfer->from->nx * (double)transfer->to->nx;
  const double product = octets / octets_a_second;
  if (product * rate < part_of_a_step) return 0;
  const double steps = ceil((wakes + product) * rate);
  return steps < MOST ? (size_t)steps + 1 : MOST;
}

static void *carry(void *context) {
  pb_carrier *c = context;
  while (sem_wait(&c->begun) != 0) continue;
  if (atomic_load(&c->cancelled)) return NULL;
  pb_flush_denormals();
  pb_handover_carry(c->handover);
  atomic_store_explicit(&c->carried, true, memory_order_release);
  return NULL;
}

bool pb_carrier_start(pb_carrier *c, pb_handover *handover) {
  memset(c, 0, sizeof *c);
  if (sem_init(&c->begun, 0, 0) != 0) return false;
  c->handover = handover;
  if (pthread_create(&c->thread, NULL, carry, c) != 0) {
    sem_destroy(&c->begun);
    c->handover = NULL;
    return false;
  }
  pthread_setname_np(c->thread, "pb-carrier");
  return true;
}

void pb_carrier_end(pb_carrier *c) {
  if (!c->handover) return;
  atomic_store(&c->cancelled, true);
  sem_post(&c->begun);
  pthread_join(c->thread, NULL);
  sem_destroy(&c->begun);
  pb_handover_free(c->handover);
  memset(c, 0, sizeof *c);
}
