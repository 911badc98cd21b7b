// plantbus-monitor: a plant on the bus, live in the terminal, or a line a status in a pipe.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/json.h"
#include "escapes.h"
#include "feed.h"
#include "interrupt.h"
#include "standard_output.h"
#include "terminal.h"

enum { KEY_ONCE = 0x100, KEY_JSON, KEY_RATE, KEY_TIMEOUT };

typedef struct monitor_options {
  pb_common_options common;
  bool once, json;
  double rate, timeout;  // Hz, s
} monitor_options;

static const struct argp_option option_table[] = {
    {"rate", KEY_RATE, "HZ", 0, "Redraw so often (default 5)", 1},
    {"once", KEY_ONCE, NULL, 0, "Print one view and end", 1},
    {"json", KEY_JSON, NULL, 0, "Print a JSON object a status, each on a line", 1},
    {"timeout", KEY_TIMEOUT, "S", 0, "Wait this long for the plant (default 5)", 1},
    {0}};

static const char description[] =
    "Shows a plant on the bus: who acts on it, its clock, faults, events and signals.\v"
    "On a terminal the view is redrawn until q or Ctrl-C; in a pipe it is a line a status. The "
    "monitor only listens: no client and no step waits for it. The least and the most of a signal "
    "are those of the samples that it looked at.\n\n"
    "Exit codes: 0 done, 1 no plant, several plants or the daemon has gone, 2 wrong command "
    "line.\n";

static error_t parse(int key, char *text, struct argp_state *state) {
  monitor_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->common;
    return 0;
  case KEY_RATE:
    o->rate = pb_option_double(state, "--rate", text, 0.1, 60);
    return 0;
  case KEY_ONCE:
    o->once = true;
    return 0;
  case KEY_JSON:
    o->json = true;
    return 0;
  case KEY_TIMEOUT:
    o->timeout = pb_option_double(state, "--timeout", text, 1e-3, 86400);
    return 0;
  case ARGP_KEY_ARG:
    argp_error(state, "unexpected argument '%s'", text);
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

static double clock_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// ---- in a pipe, and once ------------------------------------------------------------------------

static pb_status print_json(const monitor_state *state, pb_error *err) {
  cJSON *json = monitor_json(state);
  char *text = NULL;
  pb_status status = json ? pb_json_print_compact(json, &text, err) : pb_fail_memory(err, "status");
  if (!status) puts(text);
  free(text);
  cJSON_Delete(json);
  return status;
}

static pb_status print(const monitor_options *o, const monitor_state *state, pb_error *err) {
  pb_status status = PB_OK;
  screen s = {0};
  size_t height;
  if (o->once && isatty(STDOUT_FILENO)) terminal_size(&s.width, &height);
  if (o->json) {
    status = print_json(state, err);
  } else {
    if (o->once)
      monitor_view(state, &s);
    else
      monitor_line(state, &s);
    if (s.text.failed) status = pb_fail_memory(err, "view");
    if (!status) fputs(s.text.text, stdout);
  }
  free(s.text.text);
  return status ? status : pb_stdout_flush(err);
}

// A plant that stands still publishes no sample: a status alone must do after a moment.
static pb_status run_once(const monitor_options *o, feed *f, pb_error *err) {
  const monitor_state *state = feed_state(f);
  const double end = clock_seconds() + o->timeout;
  double patience = 0.0;
  for (;;) {
    feed_take(f);
    const double now = clock_seconds();
    if (state->status && patience == 0.0) patience = now + 0.3;
    if (state->status && (state->has_sample || now > patience)) return print(o, state, err);
    if (pb_interrupted()) return PB_OK;
    if (now > end)
      return pb_fail(err, PB_ERR_STATE, state->description->name, "no status came within %g s",
                     o->timeout);
    feed_wait(f, 0.02);
  }
}

static pb_status run_stream(const monitor_options *o, feed *f, pb_error *err) {
  const monitor_state *state = feed_state(f);
  pb_status status = PB_OK;
  while (!status && !pb_interrupted()) {
    if (feed_take(f)) status = print(o, state, err);
    if (!status && state->gone)
      status = pb_fail(err, PB_ERR_STATE, state->description->name, "the daemon has gone");
    if (!status) feed_wait(f, 0.1);
  }
  return status;
}

// ---- on a terminal ------------------------------------------------------------------------------

static pb_status draw(const monitor_state *state, pb_error *err) {
  screen s = {.terminal = true, .plain = !pb_colours()};
  terminal_size(&s.width, &s.height);
  const size_t height = s.height--;  // the last line is for what does not fit
  pb_text_append(&s.text, "\033[H");
  monitor_view(state, &s);
  s.height = height;
  if (s.left_out > 0) pb_text_append(&s.text, "\r\n");
  if (s.left_out > 0) screen_put(&s, SCREEN_DIM, "… and %zu lines more", s.left_out);
  if (s.row < s.height) pb_text_append(&s.text, "\033[J");
  const pb_status status = s.text.failed ? pb_fail_memory(err, "view") : PB_OK;
  if (!status) fputs(s.text.text, stdout);
  free(s.text.text);
  return status ? status : pb_stdout_flush(err);
}

static pb_status run_live(const monitor_options *o, feed *f, pb_error *err) {
  pb_status status = PB_OK;
  bool quit = false;
  terminal_begin();
  while (!status && !quit && !pb_interrupted()) {
    const double next = clock_seconds() + 1.0 / o->rate;
    feed_take(f);
    status = draw(feed_state(f), err);
    for (double left; !quit && !pb_interrupted() && (left = next - clock_seconds()) > 0.0;)
      quit = terminal_wait(left);
  }
  terminal_end();
  return status;
}

int main(int argc, char **argv) {
  static const struct argp_child children[] = {{&pb_common_argp, 0, NULL, 0}, {0}};
  static const struct argp argp = {option_table, parse, NULL, description, children, NULL, NULL};
  monitor_options options = {.rate = 5.0, .timeout = 5.0};
  feed *f = NULL;
  pb_error err = {0};
  pb_options_parse(&argp, argc, argv, &options);
  pb_interrupt_install();
  pb_status status = feed_open(&options.common, options.timeout, &f, &err);
  if (status || pb_interrupted())
    ;
  else if (options.once)
    status = run_once(&options, f, &err);
  else if (options.json || !pb_escapes(stdout))
    status = run_stream(&options, f, &err);
  else
    status = run_live(&options, f, &err);
  feed_close(f);
  if (status) pb_print_error(stderr, &err);
  return status ? PB_EXIT_FAILED : PB_EXIT_DONE;
}
