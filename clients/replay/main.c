// plantbus-replay: what to do with a recording.
#include <math.h>
#include <string.h>

#include "interrupt.h"
#include "replay.h"

enum {
  KEY_JSON = 0x100,
  KEY_CSV,
  KEY_MAT,
  KEY_PLANT_OUT,
  KEY_REVISION,
  KEY_EPOCH,
  KEY_FROM,
  KEY_TO,
  KEY_SIGNALS,
  KEY_TOLERANCE,
  KEY_CHECK,
  KEY_OUT,
};

#define BIT(key) (1u << ((key)-KEY_JSON))

typedef struct command {
  const char *name;
  pb_status (*run)(const replay_options *options, const pb_recording *recording, pb_error *err);
  unsigned options;
  // How the recording is opened; NULL: `mend` does without.
  pb_status (*open)(const char *path, pb_recording **out, pb_error *err);
  pb_status (*mend)(const replay_options *options, pb_error *err);
} command;

static const command commands[] = {
    {"info", command_info, BIT(KEY_JSON) | BIT(KEY_CHECK), pb_recording_open_index, NULL},
    {"export", command_export,
     BIT(KEY_CSV) | BIT(KEY_MAT) | BIT(KEY_PLANT_OUT) | BIT(KEY_REVISION) | BIT(KEY_EPOCH) |
         BIT(KEY_FROM) | BIT(KEY_TO) | BIT(KEY_SIGNALS),
     pb_recording_open, NULL},
    {"play", command_play, BIT(KEY_JSON) | BIT(KEY_EPOCH) | BIT(KEY_TOLERANCE), pb_recording_open,
     NULL},
    {"verify", command_verify, BIT(KEY_JSON) | BIT(KEY_EPOCH) | BIT(KEY_TOLERANCE),
     pb_recording_open, NULL},
    {"repair", NULL, BIT(KEY_OUT), NULL, command_repair},
};

static const struct argp_option option_table[] = {
    {"json", KEY_JSON, NULL, 0, "info, play, verify: print JSON", 1},
    {"csv", KEY_CSV, "FILE", 0, "export: the samples as CSV", 2},
    {"mat", KEY_MAT, "FILE", 0, "export: the samples as a MAT file", 2},
    {"plant-out", KEY_PLANT_OUT, "FILE", 0, "export: the plant file (default: the first revision)",
     2},
    {"revision", KEY_REVISION, "N", 0, "export: this revision only", 3},
    {"epoch", KEY_EPOCH, "N", 0,
     "export: this epoch only; play, verify: this one (default: the first that is whole)", 3},
    {"from", KEY_FROM, "T", 0, "export: from T seconds of plant time on", 3},
    {"to", KEY_TO, "T", 0, "export: up to T seconds of plant time", 3},
    {"signals", KEY_SIGNALS, "NAMES", 0, "export: these inputs and outputs (default: all)", 3},
    {"tolerance", KEY_TOLERANCE, "X", 0,
     "play, verify: fail when an output deviates by more than X in its unit (default: report "
     "only)",
     4},
    {"check", KEY_CHECK, NULL, 0, "info: read all of the file, not only its summary", 4},
    {"output", 'o', "FILE", 0, "repair: the file to write (needed)", 4},
    {0},
};

static const char description[] =
    "Looks into recordings of plantbus-record, exports them and plays them back.\v"
    "Commands:\n"
    "  info    plant, revisions, epochs, gaps, signals, events\n"
    "  export  samples as CSV or MAT; the plant file\n"
    "  play    the recorded inputs again, on a daemon with the same plant, from rest in lockstep; "
    "how far the outputs are from the recorded ones\n"
    "  verify  the same with the compiled model in the recording, without a daemon\n"
    "  repair  a complete file of one that is cut or damaged\n\n"
    "Exit codes: 0 done, 1 failed, 2 wrong command line.\n\n"
    "Examples:\n"
    "  plantbus-replay info run.mcap\n"
    "  plantbus-replay export run.mcap --mat run.mat --from 1 --to 2\n"
    "  plantbus-replay play run.mcap --tolerance 0\n"
    "  plantbus-replay repair cut.mcap -o whole.mcap\n";

typedef struct line {
  replay_options options;
  const command *command;
  unsigned given;
} line;

static void argument(line *l, char *text, struct argp_state *state) {
  if (l->command && l->options.path) argp_error(state, "unexpected argument '%s'", text);
  if (l->command) {
    l->options.path = text;
    return;
  }
  for (size_t i = 0; i < sizeof commands / sizeof *commands; i++)
    if (strcmp(commands[i].name, text) == 0) l->command = &commands[i];
  if (!l->command) argp_error(state, "'%s' is not info, export, play, verify or repair", text);
}

static void check(line *l, struct argp_state *state) {
  replay_options *o = &l->options;
  if (!l->command) argp_error(state, "a command is missing");
  if (!o->path) argp_error(state, "the recording is missing");
  for (const struct argp_option *p = option_table; p->name; p++)
    if (l->given & BIT(p->key == 'o' ? KEY_OUT : p->key) & ~l->command->options)
      argp_error(state, "--%s does not go with %s", p->name, l->command->name);
  if (l->command->mend && !o->out) argp_error(state, "repair into which file? --output");
  if (l->command->run == command_export && !o->csv && !o->mat && !o->plant_out)
    argp_error(state, "export where to? --csv, --mat or --plant-out");
  if (o->choice.from > o->choice.to) argp_error(state, "--from is later than --to");
  o->choice.limited = l->given & (BIT(KEY_FROM) | BIT(KEY_TO));
  o->choice.signal = (const char *const *)o->signals.name;
  o->choice.signals = o->signals.count;
}

static error_t parse(int key, char *text, struct argp_state *state) {
  line *l = state->input;
  replay_options *o = &l->options;
  if (key == 'o') key = KEY_OUT;
  if (key >= KEY_JSON && key <= KEY_OUT) l->given |= BIT(key);
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->common;
    break;
  case KEY_JSON:
    o->json = true;
    break;
  case KEY_CSV:
    o->csv = text;
    break;
  case KEY_MAT:
    o->mat = text;
    break;
  case KEY_PLANT_OUT:
    o->plant_out = text;
    break;
  case KEY_REVISION:
    o->choice.revision = (uint32_t)pb_option_uint64(state, "--revision", text, 1, UINT32_MAX);
    break;
  case KEY_EPOCH:
    o->choice.epoch = (uint32_t)pb_option_uint64(state, "--epoch", text, 1, UINT32_MAX);
    break;
  case KEY_FROM:
    o->choice.from = pb_option_double(state, "--from", text, 0, 1e12);
    break;
  case KEY_TO:
    o->choice.to = pb_option_double(state, "--to", text, 0, 1e12);
    break;
  case KEY_SIGNALS:
    pb_option_names(state, "--signals", text, &o->signals);
    break;
  case KEY_CHECK:
    o->check = true;
    break;
  case KEY_OUT:
    o->out = text;
    break;
  case KEY_TOLERANCE:
    o->tolerance = pb_option_double(state, "--tolerance", text, 0, 1e300);
    break;
  case ARGP_KEY_ARG:
    argument(l, text, state);
    break;
  case ARGP_KEY_END:
    check(l, state);
    break;
  default:
    return ARGP_ERR_UNKNOWN;
  }
  return 0;
}

static void tell_cut(const pb_recording *r) {
  if (r->file.complete) return;
  fprintf(stderr,
          "%s: warning: %s: is not complete (its recorder was killed?): read up to byte %llu of "
          "%llu; plantbus-replay repair makes a complete file of it\n",
          program_invocation_short_name, r->path, (unsigned long long)r->file.read_to,
          (unsigned long long)r->file.bytes);
}

static pb_status run(const line *l, pb_recording **recording, pb_error *err) {
  const replay_options *o = &l->options;
  if (l->command->mend) return l->command->mend(o, err);
  pb_status status = (o->check ? pb_recording_open : l->command->open)(o->path, recording, err);
  if (status) return status;
  tell_cut(*recording);
  return l->command->run(o, *recording, err);
}

int main(int argc, char **argv) {
  static const struct argp_child children[] = {{&pb_common_argp, 0, "Bus (play):", 9}, {0}};
  static const struct argp argp = {option_table, parse, "COMMAND FILE", description, children,
                                   NULL,         NULL};
  line l = {.options = {.tolerance = -1.0, .choice = {.to = INFINITY}}};
  pb_recording *recording = NULL;
  pb_error err = {0};
  pb_options_parse(&argp, argc, argv, &l);
  pb_interrupt_install();
  pb_status status = run(&l, &recording, &err);
  if (status) pb_print_error(stderr, &err);
  pb_recording_free(recording);
  pb_name_list_free(&l.options.signals);
  return status == PB_OK ? PB_EXIT_DONE : PB_EXIT_FAILED;
}
