// What a row of samples covers: one span for each epoch, its steps, and the gaps in them.
#ifndef PB_CLIENTS_SPANS_H
#define PB_CLIENTS_SPANS_H

#include <cjson/cJSON.h>

#include "base/status.h"
#include "plantbus.h"

typedef struct pb_span {
  uint32_t epoch;
  uint32_t first_revision, last_revision;
  uint64_t first_step, last_step;
  int64_t first_ns, last_ns;
  uint32_t decimation;  // of the last sample
  bool decimated;       // some sample was more than one step from the next
  uint64_t samples;
  uint64_t gaps, missing;  // places where samples are missing, and how many
} pb_span;

typedef struct pb_spans {
  size_t count, capacity;
  pb_span *span;     // [count]
  uint64_t samples;  // of all
  uint64_t gaps, missing;
  uint64_t repeats;  // samples that were there already: lockstep publishes them again
  bool anew;         // the next sample begins a span, whatever its epoch
} pb_spans;

// Adds a sample. *fresh: it is neither a repetition nor from before a reset. Fails with
// PB_ERR_MEMORY. [init]
pb_status pb_spans_add(pb_spans *spans, const plantbus_Sample *sample, bool *fresh, pb_error *err);

// What follows comes from another daemon, which counts its epochs anew. [any]
void pb_spans_part(pb_spans *spans);

// A span as JSON, and back; NULL: out of memory, false: it is none. [init]
cJSON *pb_span_to_json(const pb_span *span);
bool pb_span_from_json(const cJSON *json, pb_span *out);

// Plant time covered by all of them, s: each sample counts up to the next. [any]
double pb_spans_seconds(const pb_spans *spans, double sample_rate);

void pb_spans_free(pb_spans *spans);

#endif
