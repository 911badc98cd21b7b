// See spans.h.
#include "spans.h"

#include <inttypes.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static pb_status span_begin(pb_spans *s, const plantbus_Sample *x, pb_error *err) {
  if (s->count == s->capacity) {
    const size_t capacity = 2 * s->capacity + 8;
    pb_span *grown = realloc(s->span, capacity * sizeof *grown);
    if (!grown) return pb_fail_memory(err, "epochs");
    s->span = grown;
    s->capacity = capacity;
  }
  s->span[s->count++] = (pb_span){.epoch = x->epoch,
                                  .first_revision = x->revision,
                                  .first_step = x->step,
                                  .first_ns = x->time_ns};
  return PB_OK;
}

// A sample tells how far it is to the next one.
static void gap_count(pb_spans *s, pb_span *span, uint64_t step) {
  const uint64_t decimation = span->decimation > 0 ? span->decimation : 1;
  if (step <= span->last_step + decimation) return;
  const uint64_t missing = (step - span->last_step - 1) / decimation;
  span->gaps++;
  span->missing += missing;
  s->gaps++;
  s->missing += missing;
}

pb_status pb_spans_add(pb_spans *s, const plantbus_Sample *x, bool *fresh, pb_error *err) {
  pb_span *span = s->count > 0 ? &s->span[s->count - 1] : NULL;
  *fresh = !span || s->anew || x->epoch > span->epoch ||
           (x->epoch == span->epoch && x->step > span->last_step);
  if (!*fresh) {
    s->repeats++;
    return PB_OK;
  }
  if (!span || s->anew || x->epoch != span->epoch) {
    s->anew = false;
    const pb_status status = span_begin(s, x, err);
    if (status) return status;
    span = &s->span[s->count - 1];
  } else {
    gap_count(s, span, x->step);
  }
  span->last_revision = x->revision;
  span->last_step = x->step;
  span->last_ns = x->time_ns;
  span->decimation = x->decimation;
  span->decimated = span->decimated || x->decimation > 1;
  span->samples++;
  s->samples++;
  return PB_OK;
}

void pb_spans_part(pb_spans *s) {
  s->anew = s->count > 0;
}

// ---- JSON ---------------------------------------------------------------------------------------

// Numbers of a span by name; texts keep what a double cannot.
typedef struct field {
  const char *key;
  size_t offset, size;
} field;

#define FIELD(name) \
  { #name, offsetof(pb_span, name), sizeof((pb_span *)0)->name }
static const field fields[] = {
    FIELD(epoch),     FIELD(first_revision), FIELD(last_revision), FIELD(first_step),
    FIELD(last_step), FIELD(first_ns),       FIELD(last_ns),       FIELD(decimation),
    FIELD(samples),   FIELD(gaps),           FIELD(missing),
};
#undef FIELD

cJSON *pb_span_to_json(const pb_span *span) {
  cJSON *json = cJSON_CreateObject();
  bool good = json && cJSON_AddBoolToObject(json, "decimated", span->decimated);
  for (size_t i = 0; good && i < sizeof fields / sizeof *fields; i++) {
    char text[24];
    uint64_t value = 0;
    memcpy(&value, (const char *)span + fields[i].offset, fields[i].size);
    snprintf(text, sizeof text, "%" PRIu64, value);
    good = cJSON_AddStringToObject(json, fields[i].key, text) != NULL;
  }
  if (good) return json;
  cJSON_Delete(json);
  return NULL;
}

bool pb_span_from_json(const cJSON *json, pb_span *out) {
  *out = (pb_span){.decimated = cJSON_IsTrue(cJSON_GetObjectItemCaseSensitive(json, "decimated"))};
  for (size_t i = 0; i < sizeof fields / sizeof *fields; i++) {
    const cJSON *item = cJSON_GetObjectItemCaseSensitive(json, fields[i].key);
    char *end = NULL;
    if (!cJSON_IsString(item)) return false;
    const uint64_t value = strtoull(item->valuestring, &end, 10);
    if (end == item->valuestring || *end) return false;
    memcpy((char *)out + fields[i].offset, &value, fields[i].size);
  }
  return true;
}

double pb_spans_seconds(const pb_spans *s, double sample_rate) {
  double steps = 0.0;
  for (size_t i = 0; i < s->count; i++) {
    const pb_span *p = &s->span[i];
    steps += (double)(p->last_step - p->first_step) + (p->decimation > 0 ? p->decimation : 1);
  }
  return sample_rate > 0.0 ? steps / sample_rate : 0.0;
}

void pb_spans_free(pb_spans *s) {
  free(s->span);
  *s = (pb_spans){0};
}
