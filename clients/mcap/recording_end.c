// What a recording tells of itself at its end, written and read. See recording.h.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/json.h"
#include "recording.h"

// One object an epoch, so that a reader need not go through the samples.
static char *spans_print(const pb_spans *s) {
  cJSON *list = cJSON_CreateArray();
  char *text = NULL;
  bool good = list != NULL;
  for (size_t i = 0; good && i < s->count; i++) {
    cJSON *item = pb_span_to_json(&s->span[i]);
    good = item && cJSON_AddItemToArray(list, item);
  }
  pb_error ignored;
  if (good) pb_json_print_compact(list, &text, &ignored);
  cJSON_Delete(list);
  return text;
}

pb_status pb_recording_end_write(pb_mcap_writer *writer, const pb_spans *s, const char *plant,
                                 uint32_t part, const char *ended_by, pb_error *err) {
  char samples[24], gaps[24], missing[24], repeats[24], epochs[24], number[24];
  char *spans = spans_print(s);
  if (!spans) return pb_fail_memory(err, "epochs");
  snprintf(samples, sizeof samples, "%llu", (unsigned long long)s->samples);
  snprintf(gaps, sizeof gaps, "%llu", (unsigned long long)s->gaps);
  snprintf(missing, sizeof missing, "%llu", (unsigned long long)s->missing);
  snprintf(repeats, sizeof repeats, "%llu", (unsigned long long)s->repeats);
  snprintf(epochs, sizeof epochs, "%zu", s->count);
  snprintf(number, sizeof number, "%u", part);
  const pb_mcap_pair pairs[] = {{"plant", plant},     {"samples", samples}, {"gaps", gaps},
                                {"missing", missing}, {"repeats", repeats}, {"epochs", epochs},
                                {"spans", spans},     {"part", number},     {"ended_by", ended_by}};
  const pb_status status =
      pb_mcap_writer_metadata(writer, PB_RECORDING_END, pairs, sizeof pairs / sizeof *pairs, err);
  free(spans);
  return status;
}

static pb_status spans_read(pb_view text, pb_spans *out, pb_error *err) {
  cJSON *list = NULL;
  pb_status status = pb_json_parse((const char *)text.p, text.size, &list, err);
  if (status) return status;
  const size_t count = cJSON_IsArray(list) ? (size_t)cJSON_GetArraySize(list) : 0;
  out->span = calloc(count + 1, sizeof *out->span);
  if (!out->span) status = pb_fail_memory(err, "epochs");
  const cJSON *item;
  cJSON_ArrayForEach(item, list) {
    if (status || out->count == count) break;
    pb_span *s = &out->span[out->count];
    if (!pb_span_from_json(item, s)) {
      status = pb_fail(err, PB_ERR_SYNTAX, PB_RECORDING_END, "an epoch is not as it should be");
      break;
    }
    out->count++;
    out->samples += s->samples;
    out->gaps += s->gaps;
    out->missing += s->missing;
  }
  out->capacity = count + 1;
  cJSON_Delete(list);
  return status;
}

pb_status pb_recording_end_read(pb_view pairs, pb_spans *out, bool *found, pb_error *err) {
  pb_cursor c = {pairs.p, pairs.size, false};
  pb_view key, value;
  *found = false;
  while (pb_mcap_pair_next(&c, &key, &value)) {
    if (!pb_view_is(key, "spans") || *found) continue;
    *found = true;
    const pb_status status = spans_read(value, out, err);
    if (status) return status;
  }
  return PB_OK;
}
