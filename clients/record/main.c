// plantbus-record: records what a plant's bus carries into an MCAP file.
#include <stdio.h>
#include <string.h>

#include "interrupt.h"
#include "jsonout.h"
#include "recorder.h"
#include "recording_export.h"

enum { KEY_JSON = 0x100, KEY_DURATION, KEY_STEPS, KEY_TOPICS, KEY_CSV, KEY_MAT, KEY_STRICT };

static const struct argp_option option_table[] = {
    {"output", 'o', "FILE", 0, "Record into FILE (needed; .mcap)", 1},
    {"csv", KEY_CSV, "FILE", 0, "Export the samples to CSV at the end", 1},
    {"mat", KEY_MAT, "FILE", 0, "Export the samples to a MAT file at the end", 1},
    {"json", KEY_JSON, NULL, 0, "Print the report as JSON", 1},
    {"duration", KEY_DURATION, "S", 0, "End after S seconds of plant time", 2},
    {"steps", KEY_STEPS, "N", 0, "End after N samples", 2},
    {"topics", KEY_TOPICS, "NAMES", 0,
     "Of sample, event, status, command (default: sample,event,status)", 2},
    {"strict", KEY_STRICT, NULL, 0, "Fail (exit code 1) when samples are missing", 2},
    {0},
};

static const char description[] =
    "Records samples, events and status of a plant, with its plant file, into an MCAP file.\v"
    "It reads only: lockstep does not wait for it. Recording ends at --duration or --steps, with "
    "SIGINT, or when the daemon ends; the file is complete then. One that is killed leaves a file "
    "that can be read up to its last second.\n\n"
    "Exit codes: 0 done, 1 failed (also: the daemon ended before the limit; with --strict: "
    "samples are missing), 2 wrong command line.\n\n"
    "Examples:\n"
    "  plantbus-record -o run.mcap --duration 10 --mat run.mat\n"
    "  plantbus-record -o run.mcap --topics sample,command --strict --json\n";

static unsigned topics_parse(struct argp_state *state, const char *text) {
  static const char *const name[] = {"sample", "event", "status", "command"};
  pb_name_list list = {0};
  unsigned topics = 0;
  pb_option_names(state, "--topics", text, &list);
  for (size_t i = 0; i < list.count; i++) {
    unsigned bit = 0;
    for (int k = 0; k < 4; k++)
      if (strcmp(list.name[i], name[k]) == 0) bit = 1u << k;
    if (!bit)
      argp_error(state, "--topics: '%s' is not sample, event, status or command", list.name[i]);
    topics |= bit;
  }
  pb_name_list_free(&list);
  return topics;
}

static error_t parse(int key, char *text, struct argp_state *state) {
  record_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->common;
    break;
  case 'o':
    o->path = text;
    break;
  case KEY_CSV:
    o->csv = text;
    break;
  case KEY_MAT:
    o->mat = text;
    break;
  case KEY_JSON:
    o->json = true;
    break;
  case KEY_STRICT:
    o->strict = true;
    break;
  case KEY_DURATION:
    o->duration = pb_option_double(state, "--duration", text, 1e-6, 1e9);
    break;
  case KEY_STEPS:
    o->steps = pb_option_uint64(state, "--steps", text, 1, UINT64_MAX);
    break;
  case KEY_TOPICS:
    o->topics = topics_parse(state, text);
    break;
  case ARGP_KEY_ARG:
    argp_error(state, "unexpected argument '%s'", text);
    break;
  case ARGP_KEY_END:
    if (!o->path) argp_error(state, "--output is missing: where to?");
    if (!(o->topics & RECORD_SAMPLE) && (o->csv || o->mat || o->steps || o->duration > 0.0))
      argp_error(state, "--csv, --mat, --steps and --duration need the topic sample");
    break;
  default:
    return ARGP_ERR_UNKNOWN;
  }
  return 0;
}

// ---- report -------------------------------------------------------------------------------------

static const char *end_name(record_end end) {
  static const char *const name[] = {"limit", "interrupted", "daemon gone"};
  return name[end];
}

static void ready(const record_options *o, const char *plant) {
  fprintf(o->json ? stderr : stdout, "recording %s to %s\n", plant, o->path);
  fflush(stdout);
}

static void print_json(const record_options *o, const record_report *r) {
  pb_jsonout json;
  pb_jsonout_begin(&json, stdout);
  pb_jsonout_object(&json, NULL);
  pb_jsonout_text(&json, "file", o->path);
  pb_jsonout_text(&json, "plant", r->plant);
  pb_jsonout_integer(&json, "samples", r->spans.samples);
  pb_jsonout_integer(&json, "gaps", r->spans.gaps);
  pb_jsonout_integer(&json, "missing", r->spans.missing);
  pb_jsonout_integer(&json, "repeats", r->spans.repeats);
  pb_jsonout_integer(&json, "epochs", r->spans.count);
  pb_jsonout_integer(&json, "revisions", r->revisions);
  pb_jsonout_integer(&json, "undescribed", r->undescribed);
  pb_jsonout_integer(&json, "events", r->events);
  pb_jsonout_integer(&json, "statuses", r->statuses);
  pb_jsonout_integer(&json, "commands", r->commands);
  pb_jsonout_number(&json, "plant_seconds", pb_spans_seconds(&r->spans, r->sample_rate));
  pb_jsonout_number(&json, "seconds", r->seconds);
  pb_jsonout_integer(&json, "bytes", r->bytes);
  pb_jsonout_text(&json, "ended_by", end_name(r->end));
  pb_jsonout_object_end(&json);
  pb_jsonout_end(&json);
}

static void print_text(const record_options *o, const record_report *r) {
  printf("%llu samples, %g s of plant time in %.2f s, %zu epoch%s, %u revision%s\n",
         (unsigned long long)r->spans.samples, pb_spans_seconds(&r->spans, r->sample_rate),
         r->seconds, r->spans.count, r->spans.count == 1 ? "" : "s", r->revisions,
         r->revisions == 1 ? "" : "s");
  printf("%llu events, %llu statuses, %llu commands, %.2f MB in %s\n",
         (unsigned long long)r->events, (unsigned long long)r->statuses,
         (unsigned long long)r->commands, (double)r->bytes * 1e-6, o->path);
  if (r->spans.gaps == 0) puts("no gaps");
}

static void warn(const record_report *r) {
  const char *me = program_invocation_short_name;
  if (r->spans.gaps > 0)
    fprintf(stderr, "%s: warning: %llu samples are missing, in %llu places\n", me,
            (unsigned long long)r->spans.missing, (unsigned long long)r->spans.gaps);
  if (r->undescribed > 0)
    fprintf(stderr, "%s: warning: %llu samples came before the description of their revision\n", me,
            (unsigned long long)r->undescribed);
}

static pb_status export(const record_options *o, pb_error *err) {
  const pb_export_choice all = {0};
  pb_recording *recording = NULL;
  if (!o->csv && !o->mat) return PB_OK;
  pb_status status = pb_recording_open(o->path, &recording, err);
  if (!status && o->csv) status = pb_export_csv(recording, &all, o->csv, err);
  if (!status && o->mat) status = pb_export_mat(recording, &all, o->mat, err);
  pb_recording_free(recording);
  return status;
}

// What the report says decides, when the recording itself went well.
static pb_status judge(const record_options *o, const record_report *r, pb_error *err) {
  const bool limited = o->steps > 0 || o->duration > 0.0;
  if (limited && r->end == RECORD_END_GONE)
    return pb_fail(err, PB_ERR_STATE, r->plant, "the daemon ended before the recording did");
  if (o->strict && r->spans.gaps > 0)
    return pb_fail(err, PB_ERR_STATE, o->path, "%llu samples are missing",
                   (unsigned long long)r->spans.missing);
  return PB_OK;
}

int main(int argc, char **argv) {
  static const struct argp_child children[] = {{&pb_common_argp, 0, NULL, 0}, {0}};
  static const struct argp argp = {option_table, parse, NULL, description, children, NULL, NULL};
  record_options options = {.topics = RECORD_SAMPLE | RECORD_EVENT | RECORD_STATUS};
  record_report report;
  pb_error err = {0};
  pb_options_parse(&argp, argc, argv, &options);
  pb_interrupt_install();
  pb_status status = record_run(&options, ready, &report, &err);
  if (!status) {
    (options.json ? print_json : print_text)(&options, &report);
    warn(&report);
    status = judge(&options, &report, &err);
    pb_error later = {0};
    const pb_status exported = export(&options, &later);
    if (exported) pb_print_error(stderr, &later);
    if (!status && exported)
      status = exported;
    else if (status)
      pb_print_error(stderr, &err);
  } else {
    pb_print_error(stderr, &err);
  }
  pb_spans_free(&report.spans);
  return status == PB_OK ? PB_EXIT_DONE : PB_EXIT_FAILED;
}
