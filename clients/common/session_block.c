// Blocks of steps: see session.h.
#include <stdlib.h>
#include <string.h>

#include "session_internal.h"

static const int64_t resend_ns =
    300000000;  // the daemon serves a block once, however often it comes

static pb_status entities_make(pb_session *s, pb_error *err) {
  if (s->block_wait > 0) return PB_OK;
  s->block_request =
      pb_writer_create(s->publisher, s->topic[PB_TOPIC_BLOCK_REQUEST], PB_TOPIC_BLOCK_REQUEST, 0.0);
  s->block_reply = pb_reader_create(s->subscriber, s->topic[PB_TOPIC_BLOCK_REPLY],
                                    PB_TOPIC_BLOCK_REPLY, 0, NULL);
  const dds_entity_t wait = dds_create_waitset(s->participant);
  const dds_entity_t condition = dds_create_readcondition(s->block_reply, DDS_ANY_STATE);
  if (s->block_request < 0 || wait < 0 || condition < 0 ||
      dds_waitset_attach(wait, condition, 0) < 0)
    return pb_fail(err, PB_ERR_IO, "block", "readers and writers cannot be created");
  const int64_t deadline = pb_session_clock() + (int64_t)(s->timeout * 1e9);
  pb_status status = pb_session_match(s, s->block_request, true, true, deadline, err);
  if (!status) status = pb_session_match(s, s->block_reply, false, true, deadline, err);
  if (!status) s->block_wait = wait;
  return status;
}

static bool reply_take(pb_session *s, uint64_t id, plantbus_BlockReply **reply) {
  for (;;) {
    void *sample[1] = {NULL};
    dds_sample_info_t info;
    if (dds_take(s->block_reply, sample, &info, 1, 1) != 1) return false;
    plantbus_BlockReply *r = sample[0];
    if (info.valid_data && r->id == id && memcmp(r->client, s->client, sizeof s->client) == 0) {
      *reply = r;
      return true;
    }
    dds_return_loan(s->block_reply, sample, 1);
  }
}

static bool reply_wait(pb_session *s, const plantbus_BlockRequest *request, int64_t deadline,
                       plantbus_BlockReply **reply) {
  int64_t resend = 0;
  for (;;) {
    const int64_t now = pb_session_clock();
    if (now >= deadline) return false;
    if (now >= resend) {
      dds_write(s->block_request, request);
      resend = now + resend_ns;
    }
    const int64_t until = resend < deadline ? resend : deadline;
    dds_waitset_wait(s->block_wait, NULL, 0, until - now);
    if (reply_take(s, request->id, reply)) return true;
  }
}

static void *copy(const void *data, size_t count, size_t size) {
  void *out = malloc(count ? count * size : 1);
  if (out && count) memcpy(out, data, count * size);
  return out;
}

static pb_status reply_read(const plantbus_BlockReply *r, uint32_t steps, pb_block *out,
                            pb_error *err) {
  if (strcmp(r->status, "ok") != 0)
    return pb_fail(err, PB_ERR_STATE, r->pointer, "block refused: %s", r->message);
  if (r->steps != steps || r->flags._length != steps || r->input._length % steps ||
      r->output._length % steps)
    return pb_fail(err, PB_ERR_SYNTAX, "block", "the answer does not fit the request");
  *out = (pb_block){.step = r->step,
                    .epoch = r->epoch,
                    .revision = r->revision,
                    .steps = steps,
                    .input_count = r->input._length / steps,
                    .output_count = r->output._length / steps,
                    .flags = copy(r->flags._buffer, steps, sizeof(uint32_t)),
                    .input = copy(r->input._buffer, r->input._length, sizeof(double)),
                    .output = copy(r->output._buffer, r->output._length, sizeof(double))};
  if (out->flags && out->input && out->output) return PB_OK;
  pb_block_clear(out);
  return pb_fail_memory(err, "block");
}

pb_status pb_session_block(pb_session *s, const uint32_t *inputs, uint32_t input_count,
                           const double *values, uint32_t steps, double timeout, pb_block *out,
                           pb_error *err) {
  *out = (pb_block){0};
  if (steps == 0) return pb_fail(err, PB_ERR_ARGUMENT, "steps", "a block has a step at least");
  pb_status status = entities_make(s, err);
  if (status) return status;
  if (timeout <= 0.0) timeout = s->timeout;
  plantbus_BlockRequest request = {
      .id = s->next_request++,
      .step = UINT64_MAX,
      .steps = steps,
      .inputs = {input_count, input_count, (uint32_t *)inputs, false},
      .values = {steps * input_count, steps * input_count, (double *)values, false}};
  memcpy(request.client, s->client, sizeof request.client);
  plantbus_BlockReply *reply = NULL;
  if (!reply_wait(s, &request, pb_session_clock() + (int64_t)(timeout * 1e9), &reply))
    return pb_fail(err, PB_ERR_STATE, "block", "plant '%s' did not answer within %g s",
                   s->received->name, timeout);
  status = reply_read(reply, steps, out, err);
  void *sample[1] = {reply};
  dds_return_loan(s->block_reply, sample, 1);
  return status;
}

void pb_block_clear(pb_block *block) {
  free(block->flags);
  free(block->input);
  free(block->output);
  *block = (pb_block){0};
}
