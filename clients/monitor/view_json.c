// A plant's state as JSON. What does not fit a double, or is not a number to reckon with (the
// hash), is a hexadecimal text.
#include <inttypes.h>
#include <math.h>
#include <stdio.h>

#include "histogram.h"
#include "bus_flags.h"
#include "monitor.h"

static bool number(cJSON *object, const char *key, double value) {
  return isfinite(value) ? cJSON_AddNumberToObject(object, key, value) != NULL
                         : cJSON_AddNullToObject(object, key) != NULL;
}

static bool text(cJSON *object, const char *key, const char *value) {
  return cJSON_AddStringToObject(object, key, value ? value : "") != NULL;
}

static bool flag(cJSON *object, const char *key, bool value) {
  return cJSON_AddBoolToObject(object, key, value) != NULL;
}

// A new object at the end of an array; NULL: out of memory.
static cJSON *item(cJSON *array) {
  cJSON *made = array ? cJSON_CreateObject() : NULL;
  if (made && cJSON_AddItemToArray(array, made)) return made;
  cJSON_Delete(made);
  return NULL;
}

static bool members(cJSON *root, const plantbus_PlantStatus *p) {
  cJSON *list = cJSON_AddArrayToObject(root, "members");
  bool good = list != NULL;
  for (uint32_t i = 0; good && i < p->attached._length; i++) {
    const plantbus_Attached *a = &p->attached._buffer[i];
    cJSON *m = item(list);
    good = m && text(m, "client", a->client_name) && text(m, "channel", a->channel) &&
           number(m, "priority", a->priority) && flag(m, "acting", a->acting) &&
           flag(m, "barrier", a->barrier) && flag(m, "waited", a->waited) &&
           number(m, "commands", (double)a->commands) && number(m, "late", (double)a->late) &&
           number(m, "age", (double)a->age) && number(m, "age_max", (double)a->age_max);
  }
  return good;
}

static bool hosted(cJSON *root, const plantbus_PlantStatus *p) {
  cJSON *list = cJSON_AddArrayToObject(root, "hosted");
  bool good = list != NULL;
  for (uint32_t i = 0; good && i < p->hosted._length; i++) {
    const plantbus_Hosted *h = &p->hosted._buffer[i];
    cJSON *m = item(list);
    good = m && text(m, "channel", h->channel) && text(m, "kind", h->kind) &&
           flag(m, "done", h->done) && text(m, "client", h->client_name);
  }
  return good;
}

static bool refused(cJSON *root, const plantbus_Refusals *r) {
  cJSON *object = cJSON_AddObjectToObject(root, "refused");
  bool good = object != NULL;
  uint64_t count = 0;
  for (size_t i = 0; good && monitor_refusal(r, i, &count); i++)
    good = number(object, monitor_refusal(r, i, &count), (double)count);
  return good;
}

static bool faults(cJSON *root, const plantbus_PlantStatus *p) {
  cJSON *list = cJSON_AddArrayToObject(root, "faults");
  bool good = list != NULL;
  for (unsigned bit = 0; good && bit < 32; bit++) {
    if (!(p->faults >> bit & 1)) continue;
    cJSON *m = item(list);
    good = m && text(m, "fault", pb_flag_name(bit)) &&
           number(m, "first_step",
                  bit < p->fault_steps._length ? (double)p->fault_steps._buffer[bit] : NAN);
  }
  return good;
}

static bool histogram(cJSON *root, const char *key, const plantbus_Histogram *h) {
  cJSON *object = cJSON_AddObjectToObject(root, key);
  return object && number(object, "count", (double)h->count) &&
         number(object, "p50", pb_histogram_percentile(h, 0.5)) &&
         number(object, "p99", pb_histogram_percentile(h, 0.99)) &&
         number(object, "max", h->count ? h->largest : NAN) &&
         number(object, "mean", h->count ? h->sum / (double)h->count : NAN);
}

static bool status_add(cJSON *root, const monitor_state *m) {
  const plantbus_PlantStatus *p = m->status;
  char hash[24];
  snprintf(hash, sizeof hash, "%016" PRIx64, (uint64_t)p->hash);
  return text(root, "mode", monitor_mode(p->mode)) && number(root, "speed", p->speed) &&
         number(root, "decimation", p->decimation) && number(root, "epoch", p->epoch) &&
         number(root, "revision", p->revision) && number(root, "step", (double)p->step) &&
         number(root, "steps_per_second", p->steps_per_second) &&
         number(root, "nominal_steps_per_second", monitor_nominal(m)) && text(root, "hash", hash) &&
         number(root, "hash_step", (double)p->hash_step) &&
         flag(root, "configuring", p->configuring) && members(root, p) && hosted(root, p) &&
         refused(root, &p->refused) && number(root, "late", (double)p->late) &&
         number(root, "overruns", (double)p->overruns) &&
         number(root, "skipped", (double)p->skipped) &&
         number(root, "dropped_samples", (double)p->dropped_samples) &&
         text(root, "overrun_policy", p->overrun_policy) &&
         histogram(root, "step_time", &p->step_time) && histogram(root, "jitter", &p->jitter) &&
         text(root, "real_time", p->real_time) && faults(root, p);
}

static bool signals(cJSON *root, const char *key, const dds_sequence_string *names,
                    const dds_sequence_string *units, const monitor_state *m, const double *value,
                    size_t known, size_t first) {
  cJSON *list = cJSON_AddArrayToObject(root, key);
  bool good = list != NULL;
  for (uint32_t i = 0; good && i < names->_length; i++) {
    const bool has = m->has_sample && i < known;
    cJSON *s = item(list);
    good = s && text(s, "name", names->_buffer[i]) && text(s, "unit", units->_buffer[i]) &&
           number(s, "value", has ? value[i] : NAN) &&
           number(s, "least", has ? m->least[first + i] : NAN) &&
           number(s, "most", has ? m->most[first + i] : NAN);
  }
  return good;
}

static bool events(cJSON *root, const monitor_state *m) {
  cJSON *list = cJSON_AddArrayToObject(root, "events");
  bool good = list != NULL;
  for (size_t i = 0; good && i < m->events; i++) {
    const monitor_event *e = &m->event[i];
    cJSON *x = item(list);
    good = x && text(x, "kind", e->kind) && number(x, "epoch", e->epoch) &&
           number(x, "step", (double)e->step) && text(x, "message", e->message);
  }
  return good;
}

cJSON *monitor_json(const monitor_state *m) {
  const plantbus_PlantDescription *d = m->description;
  cJSON *root = cJSON_CreateObject();
  bool good = root && text(root, "plant", d->name) && text(root, "daemon", m->daemon) &&
              number(root, "sample_rate", d->sample_rate) && number(root, "states", d->states);
  if (good && m->status) good = status_add(root, m);
  if (good && m->has_sample) good = number(root, "sample_step", (double)m->sample.step);
  good = good &&
         signals(root, "inputs", &d->input_names, &d->input_units, m, m->sample.input,
                 m->sample.input_count, 0) &&
         signals(root, "outputs", &d->output_names, &d->output_units, m, m->sample.output,
                 m->sample.output_count, plantbus_MAX_INPUTS) &&
         events(root, m);
  if (good) return root;
  cJSON_Delete(root);
  return NULL;
}
