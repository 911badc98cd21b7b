// The items at work: see host.h. Nothing here allocates or fails.
#include <math.h>
#include <string.h>

#include "control/lti_ops.h"
#include "host_set.h"
#include "signal/random.h"

_Static_assert(sizeof(pb_random) == 6 * sizeof(uint64_t), "states are 64-bit words");

size_t pb_host_def_bytes(const pb_host_def *def) {
  size_t states = 0;
  if (def->kind == PB_HOST_WHITE) return def->inputs * sizeof(pb_random);
  if (def->kind > PB_HOST_LTI) return sizeof(uint64_t);  // the item's own step
  for (size_t p = 0; p < def->parts; p++) states += def->part[p].nx;
  return states * sizeof(double);
}

static void controller_run(const pb_host_item *item, double *x, double *scratch, const double *y,
                           double *v) {
  const pb_host_def *def = item->def;
  double in[PB_STEPPER_OUTPUTS];
  for (size_t o = 0; o < def->outputs; o++) in[o] = y[item->output[o]];
  const double *from = in;
  for (size_t p = 0; p < def->parts; p++) {
    const pb_lti *part = &def->part[p];
    pb_lti_step(part, x, scratch, from, v);
    x += part->nx;
    from += part->nu;
    v += part->ny;
  }
}

static void white_run(const pb_host_def *def, pb_random *random, double *v) {
  for (size_t i = 0; i < def->inputs; i++) v[i] = def->amplitude * pb_random_gaussian(&random[i]);
}

static void table_run(const pb_host_def *def, uint64_t *step, double *v) {
  const double *row = def->table + *step * def->columns;
  for (size_t i = 0; i < def->inputs; i++) v[i] = row[def->columns == 1 ? 0 : i];
  ++*step;
  if (def->repeat && *step == def->rows) *step = 0;
}

// The whole cycles are dropped before anything is rounded: k × high is exact as product + rest.
static double sine_value(const pb_host_def *def, uint64_t step) {
  const double k = (double)step, product = k * def->cycles[0];
  const double rest = fma(k, def->cycles[0], -product) + k * def->cycles[1];
  const double cycles = product - nearbyint(product) + rest;
  return def->amplitude * sin(2 * M_PI * cycles + def->phase);
}

static void waveform_run(const pb_host_def *def, uint64_t *step, double *v) {
  const double value = def->kind == PB_HOST_SINE ? sine_value(def, *step)
                       : *step >= def->start     ? def->amplitude
                                                 : 0;
  for (size_t i = 0; i < def->inputs; i++) v[i] = value;
  ++*step;
}

static bool at_end(const pb_host_item *item, const void *state) {
  return item->def->table && !item->def->repeat && *(const uint64_t *)state >= item->def->rows;
}

// What is done adds nothing, not even a zero: removing it does not change the sign of one.
static void item_run(pb_host_item *item, void *state, double *scratch, const double *y, double *u) {
  const pb_host_def *def = item->def;
  double v[PB_STEPPER_INPUTS];
  if (at_end(item, state)) return;
  if (def->kind <= PB_HOST_LTI)
    controller_run(item, state, scratch, y, v);
  else if (def->kind == PB_HOST_WHITE)
    white_run(def, state, v);
  else if (def->table)
    table_run(def, state, v);
  else
    waveform_run(def, state, v);
  for (size_t i = 0; i < def->inputs; i++) u[item->input[i]] += v[i];
  if (at_end(item, state)) atomic_store_explicit(&item->done, true, memory_order_relaxed);
}

void pb_host_run(pb_host *host, const double *y, double *u) {
  if (!host) return;
  for (size_t i = 0; i < host->count; i++) {
    pb_host_item *item = &host->item[host->order[i]];
    item_run(item, host->state + item->offset, host->scratch, y, u);
  }
}

static void done_refresh(pb_host *host) {
  for (size_t i = 0; i < host->count; i++) {
    pb_host_item *item = &host->item[i];
    atomic_store_explicit(&item->done, at_end(item, host->state + item->offset),
                          memory_order_relaxed);
  }
}

void pb_host_reset(pb_host *host) {
  if (!host) return;
  memset(host->state, 0, host->bytes);
  for (size_t i = 0; i < host->count; i++) {
    const pb_host_item *item = &host->item[i];
    if (item->def->kind != PB_HOST_WHITE) continue;
    pb_random *random = (pb_random *)(host->state + item->offset);
    for (size_t k = 0; k < item->def->inputs; k++) pb_random_seed(&random[k], item->def->seed, k);
  }
  done_refresh(host);
}

void pb_host_take_state(pb_host *host, const pb_host *old) {
  if (!host || !old) return;
  for (size_t i = 0; i < host->count; i++) {
    const pb_host_item *to = &host->item[i];
    for (size_t k = 0; k < old->count; k++) {
      const pb_host_item *from = &old->item[k];
      if (from->def == to->def)
        memcpy(host->state + to->offset, old->state + from->offset, to->bytes);
    }
  }
  done_refresh(host);
}

size_t pb_host_bytes(const pb_host *host) {
  return host ? host->bytes : 0;
}

void pb_host_save(const pb_host *host, void *to) {
  if (pb_host_bytes(host) > 0) memcpy(to, host->state, host->bytes);
}

void pb_host_load(pb_host *host, const void *from) {
  if (pb_host_bytes(host) == 0) return;
  memcpy(host->state, from, host->bytes);
  for (size_t i = 0; i < host->count; i++) {
    const pb_host_item *item = &host->item[i];
    if (!item->def->repeat) continue;
    uint64_t *step = (uint64_t *)(host->state + item->offset);
    *step %= item->def->rows;  // whatever a file says, within the table
  }
  done_refresh(host);
}
