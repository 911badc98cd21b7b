// plantbus-record: records what a plant's bus carries into an MCAP file.
#include <stdio.h>
#include <string.h>

#include "interrupt.h"
#include "jsonout.h"
#include "recorder.h"
#include "recording_export.h"

enum {
  KEY_JSON = 0x100,
  KEY_DURATION,
  KEY_STEPS,
  KEY_TOPICS,
  KEY_CSV,
  KEY_MAT,
  KEY_STRICT,
  KEY_ALLOW_GAPS,
  KEY_UNTIL_GONE,
  KEY_FORCE,
  KEY_SPLIT_SIZE,
  KEY_SPLIT_TIME,
  KEY_MIN_FREE,
  KEY_SYNC,
  KEY_COMPRESSION,
};

static const struct argp_option option_table[] = {
    {"output", 'o', "FILE", 0, "Record into FILE (needed; .mcap)", 1},
    {"force", KEY_FORCE, NULL, 0, "Replace files that are there already", 1},
    {"compression", KEY_COMPRESSION, "NAME", 0, "Of the chunks: none (default), lz4 or zstd", 1},
    {"csv", KEY_CSV, "FILE", 0, "Export the samples to CSV at the end", 1},
    {"mat", KEY_MAT, "FILE", 0, "Export the samples to a MAT file at the end", 1},
    {"json", KEY_JSON, NULL, 0, "Print the report as JSON", 1},
    {"duration", KEY_DURATION, "S", 0, "End after S seconds of plant time", 2},
    {"steps", KEY_STEPS, "N", 0, "End after N samples", 2},
    {"topics", KEY_TOPICS, "NAMES", 0,
     "Of sample, event, status, command (default: sample,event,status)", 2},
    {"until-gone", KEY_UNTIL_GONE, NULL, 0,
     "End with the daemon (default: wait until it is back, and go on)", 2},
    {"allow-gaps", KEY_ALLOW_GAPS, NULL, 0, "Missing samples are told, but no failure", 2},
    {"strict", KEY_STRICT, NULL, OPTION_HIDDEN, NULL, 2},  // what is now the default
    {"split-size", KEY_SPLIT_SIZE, "SIZE", 0,
     "Begin another file when one has SIZE octets (suffix k, M, G): run-2.mcap follows run.mcap",
     3},
    {"split-time", KEY_SPLIT_TIME, "S", 0, "… or S seconds of plant time", 3},
    {"min-free", KEY_MIN_FREE, "SIZE", 0,
     "End while so much of the disk is free (default 100M; 0: never)", 3},
    {"sync", KEY_SYNC, "S", 0, "Wait for the disk every S seconds (default: never)", 3},
    {0},
};

static const char description[] =
    "Records samples, events and status of a plant, with its plant file, into MCAP files.\v"
    "It attaches to no channel. In lockstep no sample is missed: the plant waits for the recorder, "
    "up to four seconds for one that takes nothing. Recording ends at --duration or --steps, with "
    "SIGINT, SIGTERM or SIGHUP, with a full disk, or with --until-gone when the daemon ends; the "
    "files are complete then. One that is killed leaves a file that can be read up to its last "
    "second, and mended by plantbus-replay repair.\n\n"
    "Exit codes: 0 done, 1 failed (also: samples are missing, or the recording ended before its "
    "limit), 2 wrong command line.\n\n"
    "Examples:\n"
    "  plantbus-record -o run.mcap --duration 10 --mat run.mat\n"
    "  plantbus-record -o run.mcap --topics sample,command --compression zstd --json\n"
    "  plantbus-record -o day.mcap --split-time 3600 --sync 10 --min-free 5G\n";

// Octets, with a suffix of powers of 1000.
static uint64_t size_parse(struct argp_state *state, const char *flag, const char *text) {
  static const char suffix[] = "kMG";
  char digits[32];
  const size_t length = strlen(text);
  const char *unit = length > 0 ? strchr(suffix, text[length - 1]) : NULL;
  uint64_t value = 0, scale = 1;
  for (long i = unit ? unit - suffix : -1; i >= 0; i--) scale *= 1000;
  snprintf(digits, sizeof digits, "%.*s", (int)(length - (unit != NULL)), text);
  if (length >= sizeof digits || !pb_parse_uint64(digits, &value) || value > UINT64_MAX / scale)
    argp_error(state, "%s: '%s' is not a size, such as 500M", flag, text);
  return value * scale;
}

static pb_mcap_compression compression_parse(struct argp_state *state, const char *text) {
  const pb_view name = {(const uint8_t *)text, strlen(text)};
  if (strcmp(text, "none") == 0) return PB_MCAP_NONE;
  const pb_mcap_compression kind =
      name.size > 0 ? pb_mcap_compression_of(name) : PB_MCAP_COMPRESSIONS;
  if (kind == PB_MCAP_COMPRESSIONS)
    argp_error(state, "--compression: '%s' is not none, lz4 or zstd", text);
  return kind;
}

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

static error_t parse_files(int key, char *text, struct argp_state *state, record_options *o) {
  switch (key) {
  case 'o':
    o->path = text;
    return 0;
  case KEY_CSV:
    o->csv = text;
    return 0;
  case KEY_MAT:
    o->mat = text;
    return 0;
  case KEY_FORCE:
    o->force = true;
    return 0;
  case KEY_COMPRESSION:
    o->compression = compression_parse(state, text);
    return 0;
  case KEY_SPLIT_SIZE:
    o->split_bytes = size_parse(state, "--split-size", text);
    return 0;
  case KEY_SPLIT_TIME:
    o->split_seconds = pb_option_double(state, "--split-time", text, 1e-3, 1e9);
    return 0;
  case KEY_MIN_FREE:
    o->min_free = size_parse(state, "--min-free", text);
    return 0;
  case KEY_SYNC:
    o->sync = pb_option_double(state, "--sync", text, 0, 1e6);
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

static void check(const record_options *o, struct argp_state *state) {
  if (!o->path) argp_error(state, "--output is missing: where to?");
  const bool samples = o->csv || o->mat || o->steps || o->duration > 0.0 || o->split_seconds > 0.0;
  if (!(o->topics & RECORD_SAMPLE) && samples)
    argp_error(state, "--csv, --mat, --steps, --duration and --split-time need the topic sample");
}

static error_t parse(int key, char *text, struct argp_state *state) {
  record_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->common;
    return 0;
  case KEY_JSON:
    o->json = true;
    return 0;
  case KEY_STRICT:
    return 0;
  case KEY_ALLOW_GAPS:
    o->allow_gaps = true;
    return 0;
  case KEY_UNTIL_GONE:
    o->until_gone = true;
    return 0;
  case KEY_DURATION:
    o->duration = pb_option_double(state, "--duration", text, 1e-6, 1e9);
    return 0;
  case KEY_STEPS:
    o->steps = pb_option_uint64(state, "--steps", text, 1, UINT64_MAX);
    return 0;
  case KEY_TOPICS:
    o->topics = topics_parse(state, text);
    return 0;
  case ARGP_KEY_ARG:
    argp_error(state, "unexpected argument '%s'", text);
    return 0;
  case ARGP_KEY_END:
    check(o, state);
    return 0;
  default:
    return parse_files(key, text, state, o);
  }
}

// ---- report -------------------------------------------------------------------------------------

static const char *end_name(record_end end) {
  static const char *const name[] = {"limit", "interrupted", "daemon gone", "disk full"};
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
  pb_jsonout_integer(&json, "files", r->files);
  pb_jsonout_integer(&json, "outages", r->outages);
  pb_jsonout_number(&json, "outage_seconds", r->outage_seconds);
  pb_jsonout_integer(&json, "foreign", r->foreign);
  pb_jsonout_boolean(&json, "untraced", r->untraced);
  pb_jsonout_text(&json, "ended_by", end_name(r->end));
  pb_jsonout_object_end(&json);
  pb_jsonout_end(&json);
}

static void print_text(const record_options *o, const record_report *r) {
  printf("%llu samples, %g s of plant time in %.2f s, %zu epoch%s, %u revision%s\n",
         (unsigned long long)r->spans.samples, pb_spans_seconds(&r->spans, r->sample_rate),
         r->seconds, r->spans.count, r->spans.count == 1 ? "" : "s", r->revisions,
         r->revisions == 1 ? "" : "s");
  printf("%llu events, %llu statuses, %llu commands, %.2f MB in %s", (unsigned long long)r->events,
         (unsigned long long)r->statuses, (unsigned long long)r->commands, (double)r->bytes * 1e-6,
         o->path);
  if (r->files > 1) printf(" and %u more", r->files - 1);
  putchar('\n');
  if (r->outages > 0)
    printf("the daemon was away %u time%s, %.1f s in all\n", r->outages, r->outages == 1 ? "" : "s",
           r->outage_seconds);
  if (r->spans.gaps == 0) puts("no gaps");
  printf("ended by: %s\n", end_name(r->end));
}

static void warn(const record_report *r) {
  const char *me = program_invocation_short_name;
  if (r->spans.gaps > 0)
    fprintf(stderr, "%s: warning: %llu samples are missing, in %llu places\n", me,
            (unsigned long long)r->spans.missing, (unsigned long long)r->spans.gaps);
  if (r->undescribed > 0)
    fprintf(stderr, "%s: warning: %llu samples came before the description of their revision\n", me,
            (unsigned long long)r->undescribed);
  if (r->foreign > 0)
    fprintf(stderr,
            "%s: warning: another daemon serves a plant of this name: %llu of its messages "
            "are left out\n",
            me, (unsigned long long)r->foreign);
  if (r->untraced)
    fprintf(stderr,
            "%s: warning: the daemon offers no trace: lockstep did not wait for the recorder\n",
            me);
}

static pb_status export_part(const record_options *o, uint32_t part, pb_error *err) {
  const pb_export_choice all = {0};
  char path[1024], csv[1024], mat[1024];
  pb_recording *recording = NULL;
  if (!record_part_path(o->path, part, path, sizeof path) ||
      (o->csv && !record_part_path(o->csv, part, csv, sizeof csv)) ||
      (o->mat && !record_part_path(o->mat, part, mat, sizeof mat)))
    return pb_fail(err, PB_ERR_ARGUMENT, o->path, "the path is too long");
  pb_status status = pb_recording_open(path, &recording, err);
  if (!status && o->csv) status = pb_export_csv(recording, &all, csv, err);
  if (!status && o->mat) status = pb_export_mat(recording, &all, mat, err);
  pb_recording_free(recording);
  return status;
}

static pb_status export(const record_options *o, const record_report *r, pb_error *err) {
  pb_status status = PB_OK;
  for (uint32_t part = 1; part <= r->files && !status && (o->csv || o->mat); part++)
    status = export_part(o, part, err);
  return status;
}

// What the report says decides, when the recording itself went well.
static pb_status judge(const record_options *o, const record_report *r, pb_error *err) {
  static const char *const why[] = {[RECORD_END_INTERRUPTED] = "it was interrupted",
                                    [RECORD_END_GONE] = "the daemon ended",
                                    [RECORD_END_SPACE] = "the disk has too little space left"};
  const bool limited = o->steps > 0 || o->duration > 0.0;
  if (r->end == RECORD_END_SPACE || (limited && r->end != RECORD_END_LIMIT))
    return pb_fail(err, PB_ERR_STATE, r->plant, "%s before the recording was to end", why[r->end]);
  if (!o->allow_gaps && r->spans.gaps > 0)
    return pb_fail(err, PB_ERR_STATE, o->path, "%llu samples are missing",
                   (unsigned long long)r->spans.missing);
  return PB_OK;
}

int main(int argc, char **argv) {
  static const struct argp_child children[] = {{&pb_common_argp, 0, NULL, 0}, {0}};
  static const struct argp argp = {option_table, parse, NULL, description, children, NULL, NULL};
  record_options options = {.topics = RECORD_SAMPLE | RECORD_EVENT | RECORD_STATUS,
                            .min_free = 100000000};
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
    const pb_status exported = export(&options, &report, &later);
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
