// info: what a recording holds.
#include <string.h>
#include <time.h>

#include "jsonout.h"
#include "replay.h"
#include "table.h"

// Wall clock as text, UTC.
static void time_text(uint64_t ns, char *text, size_t size) {
  const time_t seconds = (time_t)(ns / 1000000000u);
  struct tm utc;
  if (!gmtime_r(&seconds, &utc) || strftime(text, size, "%Y-%m-%dT%H:%M:%SZ", &utc) == 0)
    snprintf(text, size, "unknown");
}

// ---- text ---------------------------------------------------------------------------------------

static pb_status print_epochs(const pb_recording *r, pb_error *err) {
  static const char *const head[] = {"epoch",   "revision", "first step", "last step",
                                     "samples", "gaps",     "missing"};
  pb_table table = {0};
  for (size_t i = 0; i < sizeof head / sizeof *head; i++)
    pb_table_number_column(&table, head[i], NULL, 9);
  pb_table_number_column(&table, "from", "s", 9);
  pb_table_number_column(&table, "to", "s", 9);
  for (size_t i = 0; i < r->spans.count; i++) {
    const pb_span *s = &r->spans.span[i];
    const uint64_t value[] = {s->epoch,   s->last_revision, s->first_step, s->last_step,
                              s->samples, s->gaps,          s->missing};
    for (size_t k = 0; k < sizeof value / sizeof *value; k++) pb_table_count(&table, value[k]);
    pb_table_number(&table, (double)s->first_ns * 1e-9);
    pb_table_number(&table, (double)s->last_ns * 1e-9);
  }
  const pb_status status = pb_table_print(&table, stdout, 2, err);
  pb_table_free(&table);
  return status;
}

static void print_names(const char *what, const pb_recorded_names *names) {
  printf("  %s:", what);
  for (size_t i = 0; i < names->count; i++)
    printf("%s %s [%s]", i > 0 ? "," : "", names->name[i], names->unit[i]);
  putchar('\n');
}

static void print_events(const pb_recording *r) {
  if (r->events > 0) puts("events:");
  for (size_t i = 0; i < r->events; i++) {
    const pb_recorded_event *e = &r->event[i];
    printf("  epoch %u step %llu: %s%s%s: %s\n", e->epoch, (unsigned long long)e->step, e->kind,
           e->client_name[0] ? " " : "", e->client_name, e->message);
  }
}

static pb_status print_text(const pb_recording *r, pb_error *err) {
  char begun[32];
  time_text(r->log_first, begun, sizeof begun);
  printf("%s: plant %s, %llu samples, %g s of plant time", r->path, r->plant,
         (unsigned long long)r->spans.samples, pb_spans_seconds(&r->spans, pb_recording_rate(r)));
  if (r->spans.samples > 0) printf(", from %s", begun);
  putchar('\n');
  for (size_t i = 0; i < r->revisions; i++) {
    const pb_recorded_revision *v = &r->revision[i];
    printf("revision %u: %g Hz, plantbus %s, SHA-256 %s\n", v->revision, v->sample_rate,
           v->software, v->sha256);
    print_names("inputs", &v->inputs);
    print_names("outputs", &v->outputs);
  }
  puts("epochs:");
  const pb_status status = print_epochs(r, err);
  print_events(r);
  printf("%llu statuses, %llu commands, %.2f MB%s\n", (unsigned long long)r->statuses,
         (unsigned long long)r->commands, (double)r->file.bytes * 1e-6,
         r->file.complete ? "" : ", not complete");
  return status;
}

// ---- JSON ---------------------------------------------------------------------------------------

static void json_revision(pb_jsonout *json, const pb_recorded_revision *v) {
  const struct {
    const char *key;
    const pb_recorded_names *names;
  } list[] = {{"inputs", &v->inputs}, {"outputs", &v->outputs}};
  pb_jsonout_object(json, NULL);
  pb_jsonout_integer(json, "revision", v->revision);
  pb_jsonout_number(json, "sample_rate", v->sample_rate);
  pb_jsonout_text(json, "software", v->software);
  pb_jsonout_text(json, "sha256", v->sha256);
  pb_jsonout_boolean(json, "plant_file", v->plant_text != NULL);
  for (size_t k = 0; k < 2; k++) {
    pb_jsonout_array(json, list[k].key);
    for (size_t i = 0; i < list[k].names->count; i++) {
      pb_jsonout_object(json, NULL);
      pb_jsonout_text(json, "name", list[k].names->name[i]);
      pb_jsonout_text(json, "unit", list[k].names->unit[i]);
      pb_jsonout_object_end(json);
    }
    pb_jsonout_array_end(json);
  }
  pb_jsonout_object_end(json);
}

static void json_epoch(pb_jsonout *json, const pb_span *s) {
  pb_jsonout_object(json, NULL);
  pb_jsonout_integer(json, "epoch", s->epoch);
  pb_jsonout_integer(json, "first_revision", s->first_revision);
  pb_jsonout_integer(json, "last_revision", s->last_revision);
  pb_jsonout_integer(json, "first_step", s->first_step);
  pb_jsonout_integer(json, "last_step", s->last_step);
  pb_jsonout_integer(json, "samples", s->samples);
  pb_jsonout_integer(json, "gaps", s->gaps);
  pb_jsonout_integer(json, "missing", s->missing);
  pb_jsonout_number(json, "from", (double)s->first_ns * 1e-9);
  pb_jsonout_number(json, "to", (double)s->last_ns * 1e-9);
  pb_jsonout_object_end(json);
}

static void json_event(pb_jsonout *json, const pb_recorded_event *e) {
  pb_jsonout_object(json, NULL);
  pb_jsonout_integer(json, "epoch", e->epoch);
  pb_jsonout_integer(json, "step", e->step);
  pb_jsonout_text(json, "kind", e->kind);
  pb_jsonout_text(json, "client", e->client_name);
  pb_jsonout_text(json, "message", e->message);
  pb_jsonout_object_end(json);
}

static void print_json(const pb_recording *r) {
  pb_jsonout json;
  pb_jsonout_begin(&json, stdout);
  pb_jsonout_object(&json, NULL);
  pb_jsonout_text(&json, "file", r->path);
  pb_jsonout_text(&json, "plant", r->plant);
  pb_jsonout_boolean(&json, "complete", r->file.complete);
  pb_jsonout_integer(&json, "bytes", r->file.bytes);
  pb_jsonout_integer(&json, "readable_bytes", r->file.read_to);
  pb_jsonout_integer(&json, "samples", r->spans.samples);
  pb_jsonout_integer(&json, "gaps", r->spans.gaps);
  pb_jsonout_integer(&json, "missing", r->spans.missing);
  pb_jsonout_number(&json, "plant_seconds", pb_spans_seconds(&r->spans, pb_recording_rate(r)));
  pb_jsonout_number(&json, "wall_begin", (double)r->log_first * 1e-9);
  pb_jsonout_number(&json, "wall_end", (double)r->log_last * 1e-9);
  pb_jsonout_integer(&json, "statuses", r->statuses);
  pb_jsonout_integer(&json, "commands", r->commands);
  pb_jsonout_array(&json, "revisions");
  for (size_t i = 0; i < r->revisions; i++) json_revision(&json, &r->revision[i]);
  pb_jsonout_array_end(&json);
  pb_jsonout_array(&json, "epochs");
  for (size_t i = 0; i < r->spans.count; i++) json_epoch(&json, &r->spans.span[i]);
  pb_jsonout_array_end(&json);
  pb_jsonout_array(&json, "events");
  for (size_t i = 0; i < r->events; i++) json_event(&json, &r->event[i]);
  pb_jsonout_array_end(&json);
  pb_jsonout_object_end(&json);
  pb_jsonout_end(&json);
}

pb_status command_info(const replay_options *o, const pb_recording *r, pb_error *err) {
  if (!o->json) return print_text(r, err);
  print_json(r);
  return PB_OK;
}
