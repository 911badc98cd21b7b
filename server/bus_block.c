// Block requests: N steps with inputs given in advance, answered by the N samples that follow, on a
// plant that nobody else steps.
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "daemon.h"
#include "fpenv.h"

enum { BLOCK_OCTETS = 7 << 20 };  // of a reply; the bus carries samples of up to 8 MiB

static pb_status block_check(const pb_daemon *d, const plantbus_BlockRequest *in, pb_error *err) {
  const pb_model *m = d->live->model;
  const size_t row = sizeof(uint32_t) + (m->nu + m->ny) * sizeof(double);
  if (in->steps < 1 || in->steps > PB_DAEMON_BLOCK || in->steps * row > BLOCK_OCTETS)
    return pb_fail(err, PB_ERR_ARGUMENT, "/steps", "%u steps; this plant answers 1 to %zu at once",
                   in->steps,
                   BLOCK_OCTETS / row < PB_DAEMON_BLOCK ? BLOCK_OCTETS / row : PB_DAEMON_BLOCK);
  if (in->inputs._length > m->nu)
    return pb_fail(err, PB_ERR_ARGUMENT, "/inputs", "%u inputs, the plant has %zu",
                   in->inputs._length, m->nu);
  for (uint32_t i = 0; i < in->inputs._length; i++)
    if (in->inputs._buffer[i] >= m->nu)
      return pb_fail(err, PB_ERR_ARGUMENT, "/inputs", "index %u, the plant has %zu inputs",
                     in->inputs._buffer[i], m->nu);
  if (in->values._length != (uint64_t)in->inputs._length * in->steps)
    return pb_fail(err, PB_ERR_ARGUMENT, "/values", "%u values for %u inputs and %u steps",
                   in->values._length, in->inputs._length, in->steps);
  for (uint32_t i = 0; i < in->values._length; i++)
    if (!isfinite(in->values._buffer[i]))
      return pb_fail(err, PB_ERR_ARGUMENT, "/values", "value %u is not finite", i);
  return PB_OK;
}

// Under lock.
static pb_status block_admit(const pb_daemon *d, const plantbus_BlockRequest *in, pb_error *err) {
  const pb_engine *e = &d->engine;
  pb_status status = pb_request_may_step(e, err);
  if (status) return status;
  if (in->epoch != 0 && in->epoch != e->epoch)
    return pb_fail(err, PB_ERR_STATE, "/epoch", "the plant is in epoch %u", e->epoch);
  if (in->step != UINT64_MAX && in->step != e->step)
    return pb_fail(err, PB_ERR_STATE, "/step", "the plant is at step %" PRIu64, e->step);
  return block_check(d, in, err);
}

static bool block_allocate(plantbus_BlockReply *out, size_t nu, size_t ny) {
  const uint32_t n = out->steps;
  out->flags._buffer = malloc(n * sizeof(uint32_t));
  out->input._buffer = malloc(n * nu * sizeof(double));
  out->output._buffer = malloc(n * ny * sizeof(double));
  out->flags._length = out->flags._maximum = n;
  out->input._length = out->input._maximum = (uint32_t)(n * nu);
  out->output._length = out->output._maximum = (uint32_t)(n * ny);
  return out->flags._buffer && out->input._buffer && out->output._buffer;
}

static void block_free(plantbus_BlockReply *out) {
  free(out->flags._buffer);
  free(out->input._buffer);
  free(out->output._buffer);
}

static void row_take(pb_daemon *d, const plantbus_BlockRequest *in, uint32_t r,
                     plantbus_BlockReply *out) {
  const uint32_t wanted = in->inputs._length;
  const size_t nu = d->live->model->nu, ny = d->live->model->ny;
  double u[PB_STEPPER_INPUTS] = {0};
  for (uint32_t i = 0; i < wanted; i++)
    u[in->inputs._buffer[i]] += in->values._buffer[(size_t)r * wanted + i];
  pb_bus_step(d, u);
  out->flags._buffer[r] = d->current.flags;
  memcpy(out->input._buffer + r * nu, d->current.u, nu * sizeof(double));
  memcpy(out->output._buffer + r * ny, d->current.y, ny * sizeof(double));
}

// Under lock, which is given up while recorders have no room for a sample.
static void row_trace(pb_daemon *d) {
  const struct timespec pause = {0, 1000000};
  if (!pb_trace_followed(d) || d->current.step % d->engine.decimation != 0) return;
  const plantbus_Sample sample = pb_bus_sample(d);
  pb_trace_put(d, &sample);
  while (pb_trace_owed(d)) {
    pthread_mutex_unlock(&d->lock);
    nanosleep(&pause, NULL);
    pthread_mutex_lock(&d->lock);
  }
}

// Under lock, which is given up for a moment now and then: the listener must not wait for a long
// block. Nothing but this thread could begin another step or change the model meanwhile.
static void block_run(pb_daemon *d, const plantbus_BlockRequest *in, plantbus_BlockReply *out) {
  const uint64_t saved = pb_flush_denormals();
  for (uint32_t r = 0; r < in->steps; r++) {
    if (r % PB_DAEMON_BLOCK_SLICE == PB_DAEMON_BLOCK_SLICE - 1) {
      pthread_mutex_unlock(&d->lock);
      pthread_mutex_lock(&d->lock);
    }
    row_take(d, in, r, out);
    row_trace(d);
  }
  pb_restore_denormals(saved);
}

static bool change_within(const pb_daemon *d, uint64_t steps) {
  const pb_pending *p = &d->pending;
  return p->armed && p->is_model && p->change.at_step < d->engine.step + steps;
}

static pb_status block_serve(pb_daemon *d, const plantbus_BlockRequest *in,
                             plantbus_BlockReply *out, pb_error *err) {
  pthread_mutex_lock(&d->lock);
  pb_status status = block_admit(d, in, err);
  if (!status && change_within(d, in->steps))
    status = pb_fail(err, PB_ERR_STATE, "/steps", "the model changes at step %" PRIu64 " within it",
                     d->pending.change.at_step);
  out->steps = in->steps;
  if (!status && !block_allocate(out, d->live->model->nu, d->live->model->ny))
    status = pb_fail_memory(err, "reply");
  if (!status) {
    out->epoch = d->engine.epoch;
    out->revision = d->live->number;
    out->step = d->engine.step;
    block_run(d, in, out);
    pb_bus_publish_sample(d);
  }
  pthread_mutex_unlock(&d->lock);
  return status;
}

static void block_answer(pb_daemon *d, const plantbus_BlockRequest *in) {
  pb_error err = {PB_OK, "", ""};
  plantbus_BlockReply out = {.id = in->id};
  memcpy(out.client, in->client, sizeof out.client);
  const bool refused = block_serve(d, in, &out, &err) != PB_OK;
  if (refused) {
    block_free(&out);
    out.flags._buffer = NULL;
    out.input._buffer = out.output._buffer = NULL;
    out.flags._length = out.input._length = out.output._length = out.steps = 0;
  }
  out.status = refused ? "refused" : "ok";
  out.pointer = err.where;
  out.message = err.message;
  dds_write(d->block_reply, &out);
  if (!refused) block_free(&out);
}

void pb_bus_take_blocks(pb_daemon *d) {
  for (int i = 0; i < PB_DAEMON_REQUESTS; i++) {
    void *sample[1] = {NULL};
    dds_sample_info_t info;
    uint8_t actual[16];
    if (dds_take(d->block_request, sample, &info, 1, 1) != 1) return;
    const plantbus_BlockRequest *in = sample[0];
    if (info.valid_data &&
        pb_bus_writer_is(d->block_request, info.publication_handle, in->client, actual) &&
        !pb_bus_answered_before(d, in->client, in->id))
      block_answer(d, in);
    if (info.instance_state != DDS_IST_ALIVE) {
      plantbus_BlockReply key = {0};
      memcpy(key.client, in->client, sizeof key.client);
      dds_unregister_instance(d->block_reply, &key);
    }
    dds_return_loan(d->block_request, sample, 1);
  }
}
