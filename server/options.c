// See options.h.
#include "options.h"

#include <argp.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
  KEY_SPEED = 256,
  KEY_ALLOW_SHUTDOWN,
  KEY_LEASE,
  KEY_GUARD,
  KEY_CONFIG,
  KEY_INTERFACE,
  KEY_PRIORITY,
  KEY_CPU,
  KEY_LOCK_MEMORY,
  KEY_OVERRUN,
  KEY_PLANT,
  KEY_STATE,
  KEY_RESTORE
};

static const struct argp_option option_list[] = {
    {"plant", KEY_PLANT, "FILE", 0, "Plant file to serve; or FILE alone", 0},
    // Older command lines; -p is the name of a plant in every client, and one letter means one
    // thing.
    {NULL, 'p', "FILE", OPTION_HIDDEN, NULL, 0},
    {"mode", 'm', "MODE", 0, "lockstep (default), realtime or paused", 0},
    {"speed", KEY_SPEED, "X", 0, "Real time: plant seconds per second (default 1)", 0},
    {"lease", KEY_LEASE, "S", 0,
     "Plant time without a command after which a client is dropped, when it does not say "
     "(default 1)",
     0},
    {"guard", KEY_GUARD, "S", 0,
     "Wall-clock time that lockstep waits for a client, when it does not say (default 2)", 0},
    {"overrun", KEY_OVERRUN, "POLICY", 0,
     "Real time, when a deadline is missed: catch-up (default), skip or stop", 0},
    {"state", KEY_STATE, "DIR", 0,
     "Directory of snapshot files (without it clients cannot have any written or read)", 0},
    {"restore", KEY_RESTORE, "FILE", 0, "Go on from this snapshot file", 0},
    {"allow-shutdown", KEY_ALLOW_SHUTDOWN, NULL, 0, "Clients may end the daemon", 0},
    {NULL, 0, NULL, 0, "Network:", 1},
    {"domain", 'd', "N", 0, "DDS domain, 0 (default) to 230", 1},
    {"interface", KEY_INTERFACE, "NAME", 0, "Network interface (default lo: this host only)", 1},
    {"config", KEY_CONFIG, "FILE", 0, "Cyclone DDS configuration; else CYCLONEDDS_URI", 1},
    {NULL, 0, NULL, 0, "Real time (what is obtained is told in the status):", 2},
    {"rt-priority", KEY_PRIORITY, "N", 0, "SCHED_FIFO priority 1 to 99 of the step thread", 2},
    {"cpu", KEY_CPU, "N", 0, "Processor of the step thread", 2},
    {"lock-memory", KEY_LOCK_MEMORY, NULL, 0, "Keep all memory resident", 2},
    {0}};

static double number(struct argp_state *state, const char *name, const char *text, double low,
                     double high) {
  char *end;
  errno = 0;
  const double value = strtod(text, &end);
  if (end == text || *end || errno || !(value >= low && value <= high))
    argp_error(state, "--%s: expected a number from %g to %g, got '%s'", name, low, high, text);
  return value;
}

static int whole(struct argp_state *state, const char *name, const char *text, int low, int high) {
  const double value = number(state, name, text, low, high);
  if (value != floor(value)) argp_error(state, "--%s: expected a whole number", name);
  return (int)value;
}

static error_t parse_network(int key, char *arg, struct argp_state *state,
                             pb_daemon_options *options) {
  switch (key) {
  case 'd':
    options->domain = (uint32_t)whole(state, "domain", arg, 0, 230);
    return 0;
  case KEY_CONFIG:
    options->config = arg;
    return 0;
  case KEY_INTERFACE:
    options->interface = arg;
    return 0;
  case KEY_PRIORITY:
    options->priority = whole(state, "rt-priority", arg, 1, 99);
    return 0;
  case KEY_CPU:
    options->cpu = whole(state, "cpu", arg, 0, 1023);
    return 0;
  case KEY_LOCK_MEMORY:
    options->lock_memory = true;
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

static error_t parse(int key, char *arg, struct argp_state *state) {
  pb_daemon_options *options = state->input;
  switch (key) {
  case KEY_PLANT:
  case 'p':
    options->plant = arg;
    return 0;
  case 'm': {
    const int drive = pb_drive_parse(arg);
    if (drive < 0) argp_error(state, "--mode: expected lockstep, realtime or paused");
    options->mode = (pb_drive)drive;
    return 0;
  }
  case KEY_SPEED:
    options->speed = number(state, "speed", arg, 1e-3, 1e3);
    return 0;
  case KEY_LEASE:
    options->lease = number(state, "lease", arg, 1e-4, 1e6);
    return 0;
  case KEY_GUARD:
    options->guard = number(state, "guard", arg, 1e-3, 3600.0);
    return 0;
  case KEY_OVERRUN: {
    const int policy = pb_overrun_parse(arg);
    if (policy < 0) argp_error(state, "--overrun: expected catch-up, skip or stop");
    options->overrun = (pb_overrun)policy;
    return 0;
  }
  case KEY_STATE:
    options->state_directory = arg;
    return 0;
  case KEY_RESTORE:
    options->restore = arg;
    return 0;
  case KEY_ALLOW_SHUTDOWN:
    options->allow_shutdown = true;
    return 0;
  case ARGP_KEY_ARG:
    if (options->plant)
      argp_error(state, "unexpected argument '%s': one plant file is served", arg);
    options->plant = arg;
    return 0;
  case ARGP_KEY_END:
    if (!options->plant) argp_error(state, "no plant file is named: plantbusd [OPTION...] FILE");
    if (options->config && options->interface)
      argp_error(state, "--interface has no meaning with --config, which names the interface");
    return 0;
  default:
    return parse_network(key, arg, state, options);
  }
}

void pb_options_parse(int argc, char **argv, pb_daemon_options *options) {
  static const struct argp argp = {
      option_list,
      parse,
      "FILE",
      "Serves a plant model on DDS: steps it in lockstep with its clients or in real time.",
      NULL,
      NULL,
      NULL};
  *options = (pb_daemon_options){
      .mode = PB_DRIVE_LOCKSTEP, .speed = 1.0, .lease = 1.0, .guard = 2.0, .cpu = -1};
  argp_program_version = "plantbusd " PB_VERSION;
  argp_err_exit_status = 2;
  argp_parse(&argp, argc, argv, 0, NULL, options);
}
