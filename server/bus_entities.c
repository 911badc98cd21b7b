// The daemon's topics, writers and readers, all in the partition of the plant.
#include "daemon.h"

#include <string.h>

#include "bus_domain.h"

static pb_status failed(pb_error *err, const char *what, dds_entity_t code) {
  return pb_fail(err, PB_ERR_IO, what, "cannot be created: %s", dds_strretcode(-code));
}

static pb_status writers_create(pb_daemon *d, pb_error *err) {
  const struct {
    dds_entity_t *writer;
    pb_topic topic;
  } list[] = {{&d->description, PB_TOPIC_DESCRIPTION},
              {&d->status, PB_TOPIC_STATUS},
              {&d->sample, PB_TOPIC_SAMPLE},
              {&d->reply, PB_TOPIC_REPLY},
              {&d->event, PB_TOPIC_EVENT},
              {&d->block_reply, PB_TOPIC_BLOCK_REPLY}};
  for (size_t i = 0; i < sizeof list / sizeof *list; i++) {
    const pb_topic t = list[i].topic;
    *list[i].writer = pb_writer_create(d->publisher, d->topic[t], t, 0.0);
    if (*list[i].writer < 0) return failed(err, pb_topic_name(t), *list[i].writer);
  }
  return pb_trace_create(d, err);
}

// The listener is given with the creation: one set later would miss what has already arrived.
static pb_status readers_create(pb_daemon *d, pb_error *err) {
  dds_listener_t *listener = dds_create_listener(d);
  if (!listener) return pb_fail_memory(err, "listener");
  dds_lset_data_available(listener, pb_bus_on_command);
  d->command =
      pb_reader_create(d->subscriber, d->topic[PB_TOPIC_COMMAND], PB_TOPIC_COMMAND, 0, listener);
  dds_delete_listener(listener);
  if (d->command < 0) return failed(err, pb_topic_name(PB_TOPIC_COMMAND), d->command);
  d->request =
      pb_reader_create(d->subscriber, d->topic[PB_TOPIC_REQUEST], PB_TOPIC_REQUEST, 0, NULL);
  if (d->request < 0) return failed(err, pb_topic_name(PB_TOPIC_REQUEST), d->request);
  d->block_request = pb_reader_create(d->subscriber, d->topic[PB_TOPIC_BLOCK_REQUEST],
                                      PB_TOPIC_BLOCK_REQUEST, 0, NULL);
  if (d->block_request < 0)
    return failed(err, pb_topic_name(PB_TOPIC_BLOCK_REQUEST), d->block_request);
  return PB_OK;
}

pb_status pb_bus_create(pb_daemon *d, pb_error *err) {
  const pb_domain_options options = {d->options.domain, d->options.config, d->options.interface};
  pb_status status = pb_domain_join(&options, &d->participant, err);
  if (status) return status;
  for (int t = 0; t < PB_TOPIC_COUNT; t++) {
    d->topic[t] = pb_topic_create(d->participant, (pb_topic)t);
    if (d->topic[t] < 0) return failed(err, pb_topic_name((pb_topic)t), d->topic[t]);
  }
  d->publisher = pb_partition_create(d->participant, d->name, true);
  if (d->publisher < 0) return failed(err, "publisher", d->publisher);
  d->subscriber = pb_partition_create(d->participant, d->name, false);
  if (d->subscriber < 0) return failed(err, "subscriber", d->subscriber);
  d->wake = dds_create_guardcondition(d->participant);
  if (d->wake < 0) return failed(err, "guard condition", d->wake);
  d->receive_stop = dds_create_guardcondition(d->participant);
  if (d->receive_stop < 0) return failed(err, "guard condition", d->receive_stop);
  status = writers_create(d, err);
  return status ? status : readers_create(d, err);
}

bool pb_bus_writer_is(dds_entity_t reader, dds_instance_handle_t writer, const uint8_t client[16],
                      uint8_t actual[16]) {
  dds_builtintopic_endpoint_t *endpoint = dds_get_matched_publication_data(reader, writer);
  memset(actual, 0, 16);
  if (!endpoint) return false;
  memcpy(actual, endpoint->participant_key.v, 16);
  dds_builtintopic_free_endpoint(endpoint);
  return memcmp(actual, client, 16) == 0;
}
