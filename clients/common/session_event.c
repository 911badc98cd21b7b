// Waiting for an event: the end of what a request has begun.
#include <stdio.h>
#include <string.h>

#include "session_internal.h"

static const int64_t tick_ns = 50000000;  // between two looks at what is no event

// True when the word is one of the words of a list that blanks separate.
static bool word_in(const char *list, const char *word) {
  const size_t length = strlen(word);
  for (const char *at = list; *at;) {
    const size_t n = strcspn(at, " ");
    if (n == length && n > 0 && strncmp(at, word, n) == 0) return true;
    at += n;
    at += strspn(at, " ");
  }
  return false;
}

static bool event_wanted(const pb_session *s, const plantbus_Event *e, const char *kinds,
                         uint64_t first) {
  static const uint8_t nobody[16];
  const bool ours = memcmp(e->client, s->client, sizeof s->client) == 0 ||
                    memcmp(e->client, nobody, sizeof nobody) == 0;
  return ours && e->sequence_number >= first && word_in(kinds, e->kind);
}

static void event_copy(const plantbus_Event *e, pb_session_event *out) {
  *out = (pb_session_event){.number = e->sequence_number, .epoch = e->epoch, .step = e->step};
  snprintf(out->kind, sizeof out->kind, "%s", e->kind);
  snprintf(out->client_name, sizeof out->client_name, "%s", e->client_name);
  snprintf(out->channel, sizeof out->channel, "%s", e->channel);
  snprintf(out->message, sizeof out->message, "%s", e->message);
}

static bool event_take(pb_session *s, const char *kinds, uint64_t first, pb_session_event *out) {
  for (bool found = false; !found;) {
    void *sample[1] = {NULL};
    dds_sample_info_t info;
    if (dds_take(s->event, sample, &info, 1, 1) != 1) return false;
    found = info.valid_data && event_wanted(s, sample[0], kinds, first);
    if (found) event_copy(sample[0], out);
    dds_return_loan(s->event, sample, 1);
  }
  return true;
}

static pb_status event_wait(pb_session *s, dds_entity_t waitset, const char *kinds, uint64_t first,
                            double timeout, bool (*interrupted)(void), pb_session_event *out,
                            pb_error *err) {
  const int64_t deadline = pb_session_clock() + (int64_t)(timeout * 1e9);
  for (;;) {
    dds_subscription_matched_status_t matched;
    const bool gone = dds_get_subscription_matched_status(s->event, &matched) == DDS_RETCODE_OK &&
                      matched.current_count == 0;
    if (event_take(s, kinds, first, out)) return PB_OK;  // also one that came just before the end
    if (gone) return pb_fail(err, PB_ERR_STATE, s->received->name, "the daemon has gone");
    if (interrupted && interrupted())
      return pb_fail(err, PB_ERR_STATE, s->received->name, "interrupted");
    const int64_t left = deadline - pb_session_clock();
    if (left <= 0)
      return pb_fail(err, PB_ERR_STATE, s->received->name, "no event '%s' came within %g s", kinds,
                     timeout);
    dds_waitset_wait(waitset, NULL, 0, left < tick_ns ? left : tick_ns);
  }
}

pb_status pb_session_wait_event(pb_session *s, const char *kinds, uint64_t first, double timeout,
                                bool (*interrupted)(void), pb_session_event *out, pb_error *err) {
  *out = (pb_session_event){0};
  const dds_entity_t waitset = dds_create_waitset(s->participant);
  const dds_entity_t condition = dds_create_readcondition(s->event, DDS_ANY_STATE);
  pb_status status = PB_OK;
  if (waitset < 0 || condition < 0 || dds_waitset_attach(waitset, condition, 0) < 0)
    status = pb_fail(err, PB_ERR_IO, "event", "conditions cannot be created");
  if (!status)
    status = event_wait(s, waitset, kinds, first, timeout > 0.0 ? timeout : s->timeout, interrupted,
                        out, err);
  if (waitset > 0) dds_delete(waitset);
  if (condition > 0) dds_delete(condition);
  return status;
}
