// See spans.h.
#include "spans.h"

#include <stdlib.h>

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
  *fresh =
      !span || x->epoch > span->epoch || (x->epoch == span->epoch && x->step > span->last_step);
  if (!*fresh) {
    s->repeats++;
    return PB_OK;
  }
  if (!span || x->epoch != span->epoch) {
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
