// Opening and closing a session. See session.h.
#include "session.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <time.h>
#include <unistd.h>

#include "bus_domain.h"
#include "session_internal.h"

int64_t pb_session_clock(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

// The id of this client is the GUID of its participant: the daemon checks it against the writer of
// each request, so that nobody can use another's. Request ids start at random: a restarted client
// that is given the same GUID does not repeat them.
static pb_status identity_make(pb_session *s, pb_error *err) {
  dds_guid_t guid;
  if (dds_get_guid(s->participant, &guid) < 0 ||
      getrandom(&s->next_request, sizeof s->next_request, 0) != sizeof s->next_request)
    return pb_fail(err, PB_ERR_IO, "client", "no identity");
  memcpy(s->client, guid.v, sizeof s->client);
  snprintf(s->client_name, sizeof s->client_name, "%.40s[%d]", program_invocation_short_name,
           (int)getpid());
  return PB_OK;
}

static pb_status join(pb_session *s, pb_error *err) {
  const pb_domain_options options = {
      .domain = s->domain, .config = s->config, .interface = s->interface};
  pb_status status = pb_domain_join(&options, &s->participant, err);
  for (int t = 0; !status && t < PB_TOPIC_COUNT; t++) {
    s->topic[t] = pb_topic_create(s->participant, (pb_topic)t);
    if (s->topic[t] < 0)
      status =
          pb_fail(err, PB_ERR_IO, pb_topic_name((pb_topic)t), "%s", dds_strretcode(-s->topic[t]));
  }
  return status ? status : identity_make(s, err);
}

static pb_status entities_make(pb_session *s, pb_error *err) {
  const char *plant = s->received->name;
  s->publisher = pb_partition_create(s->participant, plant, true);
  s->subscriber = pb_partition_create(s->participant, plant, false);
  s->request = pb_writer_create(s->publisher, s->topic[PB_TOPIC_REQUEST], PB_TOPIC_REQUEST, 0.0);
  s->reply = pb_reader_create(s->subscriber, s->topic[PB_TOPIC_REPLY], PB_TOPIC_REPLY, 0, NULL);
  s->event = pb_reader_create(s->subscriber, s->topic[PB_TOPIC_EVENT], PB_TOPIC_EVENT, 0, NULL);
  s->request_wait = dds_create_waitset(s->participant);
  if (s->request < 0 || s->reply < 0 || s->event < 0 || s->request_wait < 0)
    return pb_fail(err, PB_ERR_IO, "DDS", "readers and writers cannot be created");
  const dds_entity_t condition = dds_create_readcondition(s->reply, DDS_ANY_STATE);
  if (condition < 0 || dds_waitset_attach(s->request_wait, condition, 0) < 0)
    return pb_fail(err, PB_ERR_IO, "DDS", "conditions cannot be created");
  const int64_t deadline = pb_session_clock() + (int64_t)(s->timeout * 1e9);
  pb_status status = pb_session_match(s, s->request, true, true, deadline, err);
  if (!status) status = pb_session_match(s, s->reply, false, true, deadline, err);
  return status ? status : pb_session_match(s, s->event, false, true, deadline, err);
}

static pb_status description_read(pb_session *s, pb_error *err) {
  const plantbus_PlantDescription *d = s->received;
  if (d->input_names._length != d->input_units._length ||
      d->output_names._length != d->output_units._length)
    return pb_fail(err, PB_ERR_SYNTAX, d->name, "names and units differ in number");
  s->description = (pb_description){.name = d->name,
                                    .version = d->software_version,
                                    .plant_text = d->plant_text,
                                    .plant_sha256 = d->plant_sha256,
                                    .revision = d->revision,
                                    .epoch = d->epoch,
                                    .mode = (pb_run_mode)d->mode,
                                    .speed = d->speed};
  pb_status status = pb_model_unpack(
      d->model._buffer, d->model._length, d->name, (const char *const *)d->input_names._buffer,
      (const char *const *)d->input_units._buffer, (const char *const *)d->output_names._buffer,
      (const char *const *)d->output_units._buffer, &s->model, err);
  if (status) return status;
  if (s->model->nu != d->input_names._length || s->model->ny != d->output_names._length ||
      s->model->nu > plantbus_MAX_INPUTS || s->model->ny > plantbus_MAX_OUTPUTS)
    return pb_fail(err, PB_ERR_SYNTAX, d->name, "names and matrices differ in number");
  return PB_OK;
}

static pb_session *session_new(const pb_session_options *options) {
  pb_session *s = calloc(1, sizeof *s);
  if (!s) return NULL;
  s->domain = options ? options->domain : 0;
  s->config = options ? options->config : NULL;
  s->interface = options ? options->interface : NULL;
  s->timeout = options && options->timeout > 0.0 ? options->timeout : 5.0;
  s->history = options ? (int)options->history : 0;
  pthread_condattr_t attr;
  pthread_condattr_init(&attr);
  pthread_condattr_setclock(&attr, CLOCK_MONOTONIC);
  pthread_cond_init(&s->ended, &attr);
  pthread_condattr_destroy(&attr);
  pthread_mutex_init(&s->lock, NULL);
  return s;
}

pb_status pb_session_open(const pb_session_options *options, pb_session **out, pb_error *err) {
  *out = NULL;
  const char *plant = options ? options->plant : NULL;
  pb_session *s = session_new(options);
  if (!s) return pb_fail_memory(err, "session");
  pb_status status = PB_OK;
  if (plant && !pb_plant_name_valid(plant))
    status = pb_fail(err, PB_ERR_ARGUMENT, plant, "is not the name of a plant");
  if (!status) status = join(s, err);
  if (!status) status = pb_session_find(s, plant, err);
  if (!status) status = description_read(s, err);
  if (!status) status = entities_make(s, err);
  if (status) {
    pb_session_close(s);
    return status;
  }
  *out = s;
  return PB_OK;
}

void pb_session_close(pb_session *s) {
  if (!s) return;
  pb_session_detach(s);
  if (s->participant > 0) dds_delete(s->participant);
  pb_model_free(s->model);
  if (s->received) plantbus_PlantDescription_free(s->received, DDS_FREE_ALL);
  pthread_cond_destroy(&s->ended);
  pthread_mutex_destroy(&s->lock);
  free(s);
}

const pb_model *pb_session_model(const pb_session *s) {
  return s->model;
}

const pb_description *pb_session_description(const pb_session *s) {
  return &s->description;
}
