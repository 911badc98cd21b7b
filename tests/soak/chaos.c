// What the driver asks of the daemon, politely and otherwise. See soak.h.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bus_domain.h"
#include "patch.h"
#include "soak.h"

static const double answer_within = 5.0;  // s; a daemon that takes longer is counted

bool soak_join(soak *s) {
  const pb_session_options options = {.domain = s->domain, .timeout = 10.0};
  const pb_domain_options domain = {.domain = s->domain};
  pb_error err;
  if (pb_session_open(&options, &s->session, &err) ||
      pb_domain_join(&domain, &s->participant, &err)) {
    fprintf(stderr, "soak: %s: %s\n", err.where, err.message);
    return false;
  }
  const char *plant = pb_session_description(s->session)->name;
  const dds_entity_t in = pb_partition_create(s->participant, plant, false);
  const dds_entity_t out = pb_partition_create(s->participant, plant, true);
  const dds_entity_t p = s->participant;
  s->status = pb_reader_create(in, pb_topic_create(p, PB_TOPIC_STATUS), PB_TOPIC_STATUS, 0, NULL);
  s->event = pb_reader_create(in, pb_topic_create(p, PB_TOPIC_EVENT), PB_TOPIC_EVENT, 4096, NULL);
  s->command = pb_writer_create(out, pb_topic_create(p, PB_TOPIC_COMMAND), PB_TOPIC_COMMAND, 0.0);
  s->request = pb_writer_create(out, pb_topic_create(p, PB_TOPIC_REQUEST), PB_TOPIC_REQUEST, 0.0);
  return s->status > 0 && s->event > 0 && s->command > 0 && s->request > 0;
}

static soak_count *count_of(soak *s, const char *kind) {
  int i = 0;
  while (i < SOAK_KINDS - 1 && s->count[i].kind && strcmp(s->count[i].kind, kind) != 0) i++;
  s->count[i].kind = kind;
  return &s->count[i];
}

soak_count *soak_request(soak *s, const char *kind, const char *body, char **result) {
  soak_count *c = count_of(s, kind);
  pb_error err;
  c->sent++;
  if (!pb_session_request(s->session, kind, body, answer_within, result, &err)) {
    c->done++;
  } else if (strstr(err.message, "is not a request this daemon serves")) {
    c->unknown++;
  } else if (strstr(err.message, "did not answer within")) {
    c->unanswered++;
  } else {
    if (c->refused++ == 0)
      snprintf(c->refusal, sizeof c->refusal, "%.60s: %.90s", err.where, err.message);
  }
  return c;
}

// Now and then back to a model that there was, by its number; else through the patches in turn, so
// that every quarter of a run sees plants of the same sizes and its memory can be compared.
void soak_configure(soak *s) {
  char patch[SOAK_PATCH_TEXT], body[SOAK_PATCH_TEXT + 64];
  if (s->seen.revision > 1 && soak_draw(s, 8) == 0) {
    snprintf(body, sizeof body, "{\"revision\":%u}", 1 + soak_draw(s, s->seen.revision - 1));
    soak_request(s, "revert", body, NULL);
    return;
  }
  soak_patch((int)(s->patches++ % SOAK_PATCHES), pb_random_uniform(&s->random), patch);
  snprintf(body, sizeof body, "{\"patch\":%s,\"comment\":\"soak\"}", patch);
  soak_request(s, "configure", body, NULL);
}

static void mode_change(soak *s) {
  static const char *const body[] = {
      "{\"mode\":\"lockstep\"}", "{\"mode\":\"realtime\",\"speed\":1}", "{\"mode\":\"lockstep\"}",
      "{\"mode\":\"realtime\",\"speed\":0.2}"};
  soak_request(s, "set_mode", body[soak_draw(s, 4)], NULL);
}

static void snapshot_or_restore(soak *s) {
  char body[64];
  const uint64_t made = count_of(s, "snapshot")->done;
  if (made == 0 || soak_draw(s, 2)) {
    soak_request(s, "snapshot", NULL, NULL);
  } else {
    snprintf(body, sizeof body, "{\"snapshot\":%llu}", (unsigned long long)made);
    soak_request(s, "restore", body, NULL);
  }
}

// Gains at which nothing can grow: IFF of collocated pairs, and a low-pass filter far below them.
static void hosted_change(soak *s) {
  char body[400];
  const uint32_t leg = 1 + soak_draw(s, 6);
  switch (soak_draw(s, 4)) {
  case 0:
    snprintf(body, sizeof body,
             "{\"channel\":\"hosted%u\",\"type\":\"iff\",\"inputs\":[\"Va%u\"],\"outputs\":"
             "[\"Vs%u\"],\"gain\":%u}",
             leg, leg, leg, 1 + soak_draw(s, 50));
    soak_request(s, "host_controller", body, NULL);
    break;
  case 1:
    snprintf(body, sizeof body,
             "{\"channel\":\"hosted%u\",\"type\":\"lti\",\"inputs\":[\"Va%u\"],\"outputs\":"
             "[\"dL%u\"],\"a\":[[-100]],\"b\":[[100]],\"c\":[[-1]],\"d\":[[0]],\"dt\":0}",
             leg, leg, leg);
    soak_request(s, "host_controller", body, NULL);
    break;
  case 2:
    snprintf(body, sizeof body,
             "{\"channel\":\"excited\",\"inputs\":[\"Va%u\"],\"type\":\"white\",\"rms\":0.05,"
             "\"seconds\":%u,\"seed\":%u,\"repeat\":true}",
             leg, 1 + soak_draw(s, 3), soak_draw(s, 1000));
    soak_request(s, "excite", body, NULL);
    break;
  default:
    snprintf(body, sizeof body, "{\"channel\":\"hosted%u\"}", leg);
    if (soak_draw(s, 3) == 0) snprintf(body, sizeof body, "{\"channel\":\"excited\"}");
    soak_request(s, "remove_controller", body, NULL);
  }
}

void soak_disturb(soak *s) {
  switch (soak_draw(s, 8)) {
  case 0:
  case 1:
    mode_change(s);
    break;
  case 2:
    soak_request(s, "reset", NULL, NULL);
    break;
  case 3:
    snapshot_or_restore(s);
    break;
  case 4:
    soak_request(s, soak_draw(s, 2) ? "get_description" : "history", NULL, NULL);
    break;
  case 5:
    soak_request(s, "step", "{\"n\":10}", NULL);
    break;
  default:
    hosted_change(s);
  }
}

static void request_forged(soak *s, const char *kind, const char *body) {
  plantbus_Request request = {
      .id = pb_random_bits(&s->random), .kind = (char *)kind, .body = (char *)body};
  for (int i = 0; i < 16; i++) request.client[i] = (uint8_t)pb_random_bits(&s->random);
  dds_write(s->request, &request);
}

static void command_wild(soak *s) {
  static const double value[] = {NAN, INFINITY, 1e308, -1e300, 0.0};
  plantbus_Command c = {.session = soak_draw(s, 2) ? pb_random_bits(&s->random) : soak_draw(s, 9),
                        .step = soak_draw(s, 2) ? UINT64_MAX : soak_draw(s, 1000),
                        .channel = soak_draw(s, 2) ? UINT32_MAX : soak_draw(s, 8),
                        .count = soak_draw(s, 2) ? UINT32_MAX : soak_draw(s, 40)};
  for (int i = 0; i < 32; i++) c.input[i] = value[soak_draw(s, 5)];
  dds_write(s->command, &c);
}

static void request_large(soak *s) {
  enum { LARGE = 200000 };
  char *body = malloc(LARGE + 1);
  if (!body) return;
  memset(body, '[', LARGE);
  body[LARGE] = '\0';
  soak_request(s, "attach", body, NULL);
  free(body);
}

void soak_hostile(soak *s) {
  s->hostile++;
  switch (soak_draw(s, 6)) {
  case 0:
    request_forged(s, "reset", "{}");
    break;
  case 1:
    request_forged(s, "detach", "{\"session\":\"0123456789abcdef\"}");
    break;
  case 2:
    soak_request(s, "nonsense", "{\"a\":1e999}", NULL);
    break;
  case 3:
    soak_request(s, "configure?", "{\"patch\":{\"models\":null}", NULL);
    break;
  case 4:
    request_large(s);
    break;
  default:
    for (int i = 0; i < 20; i++) command_wild(s);
  }
}
