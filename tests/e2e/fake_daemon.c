// See fake_daemon.h.
#include "fake_daemon.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/text.h"
#include "bus_domain.h"

static void describe(fake_daemon *f, dds_entity_t publisher) {
  pb_model *m = NULL;
  pb_error err = {0};
  double *packed = NULL;
  size_t count = 0, length;
  char *text = NULL, *name[4], *unit[4];
  if (pb_model_load(E2E_BENCH, NULL, &m, &err) || pb_model_pack(m, &packed, &count, &err) ||
      pb_text_read(E2E_BENCH, &text, &length, &err))
    fail_msg("%s: %s", err.where, err.message);
  assert_true(m->nu == 2 && m->ny == 2);
  for (size_t i = 0; i < 2; i++) {
    name[i] = m->input[i].name, unit[i] = m->input[i].unit;
    name[2 + i] = m->output[i].name, unit[2 + i] = m->output[i].unit;
  }
  plantbus_PlantDescription d = {.name = m->name,
                                 .revision = 3,
                                 .epoch = 1,
                                 .sample_rate = m->sample_rate,
                                 .input_names = {2, 2, name, false},
                                 .input_units = {2, 2, unit, false},
                                 .output_names = {2, 2, name + 2, false},
                                 .output_units = {2, 2, unit + 2, false},
                                 .plant_text = text,
                                 .plant_sha256 = "",
                                 .software_version = "",
                                 .model = {(uint32_t)count, (uint32_t)count, packed, false}};
  const dds_entity_t topic = pb_topic_create(f->participant, PB_TOPIC_DESCRIPTION);
  const dds_entity_t writer = pb_writer_create(publisher, topic, PB_TOPIC_DESCRIPTION, 0.0);
  assert_int_equal(dds_write(writer, &d), DDS_RETCODE_OK);
  free(packed);
  free(text);
  pb_model_free(m);
}

fake_daemon fake_daemon_start(void (*answer)(const char *kind, const char *body,
                                             fake_answer *out)) {
  fake_daemon f = {.domain = e2e_domain(), .answer = answer};
  const pb_domain_options options = {.domain = f.domain};
  pb_error err = {0};
  if (pb_domain_join(&options, &f.participant, &err)) fail_msg("%s", err.message);
  const dds_entity_t publisher = pb_partition_create(f.participant, "bus-bench", true);
  const dds_entity_t subscriber = pb_partition_create(f.participant, "bus-bench", false);
  describe(&f, publisher);
  f.request = pb_reader_create(subscriber, pb_topic_create(f.participant, PB_TOPIC_REQUEST),
                               PB_TOPIC_REQUEST, 0, NULL);
  f.reply = pb_writer_create(publisher, pb_topic_create(f.participant, PB_TOPIC_REPLY),
                             PB_TOPIC_REPLY, 0.0);
  f.event = pb_writer_create(publisher, pb_topic_create(f.participant, PB_TOPIC_EVENT),
                             PB_TOPIC_EVENT, 0.0);
  assert_true(f.request > 0 && f.reply > 0 && f.event > 0);
  return f;
}

void fake_daemon_end(fake_daemon *f) {
  dds_delete(f->participant);
}

static void serve(fake_daemon *f, const plantbus_Request *q) {
  char ping[96];
  fake_answer a = {.status = "ok", .pointer = "", .message = "", .result = "{}"};
  snprintf(ping, sizeof ping, "{\"step\":0,\"epoch\":1,\"mode\":\"paused\",\"event\":%llu}",
           (unsigned long long)f->events);
  if (strcmp(q->kind, "ping") == 0)
    a.result = ping;
  else
    f->answer(q->kind, q->body, &a);
  plantbus_Reply reply = {.id = q->id,
                          .status = (char *)a.status,
                          .pointer = (char *)a.pointer,
                          .message = (char *)a.message,
                          .result = (char *)a.result};
  memcpy(reply.client, q->client, sizeof reply.client);
  assert_int_equal(dds_write(f->reply, &reply), DDS_RETCODE_OK);
  if (!a.event) return;
  plantbus_Event event = {.sequence_number = f->events++,
                          .plant = "bus-bench",
                          .kind = (char *)a.event,
                          .epoch = 1,
                          .step = a.event_step,
                          .client_name = "",
                          .channel = "",
                          .message = (char *)a.event_message};
  assert_int_equal(dds_write(f->event, &event), DDS_RETCODE_OK);
}

// Copies of a request that the client sends again are not served again.
static void serve_all(fake_daemon *f, uint64_t *last) {
  void *sample[1] = {NULL};
  dds_sample_info_t info;
  while (dds_take(f->request, sample, &info, 1, 1) == 1) {
    const plantbus_Request *q = sample[0];
    if (info.valid_data && q->id != *last) {
      *last = q->id;
      serve(f, q);
    }
    dds_return_loan(f->request, sample, 1);
    sample[0] = NULL;
  }
}

tool_result fake_daemon_run(fake_daemon *f, const char *name, const char *line) {
  tool_process t = tool_start(name, f->domain, NULL, line);
  const dds_time_t end = dds_time() + DDS_SECS(30);
  uint64_t last = 0;
  int code;
  while (!tool_ended(&t, &code)) {
    serve_all(f, &last);
    if (dds_time() > end) {
      kill(t.pid, SIGKILL);
      fail_msg("%s %s did not end within 30 s", name, line);
    }
    dds_sleepfor(DDS_MSECS(1));
  }
  return tool_collect(&t, code);
}
