// plantbus-model: what a plant file describes, without a daemon.
#include <stdlib.h>
#include <string.h>

#include "tool.h"

enum {
  KEY_JSON = 0x100,
  KEY_INPUT,
  KEY_OUTPUT,
  KEY_FREQUENCIES,
  KEY_FROM,
  KEY_TO,
  KEY_POINTS,
  KEY_LINEAR,
  KEY_SAMPLED,
  KEY_DECIBEL,
  KEY_MAX,
  KEY_STEPS,
  KEY_AT,
  KEY_AMPLITUDE,
  KEY_END,
};

// The set of options a command understands, a bit an option.
#define BIT(key) (1u << ((key)-KEY_JSON))
#define GRID \
  (BIT(KEY_FREQUENCIES) | BIT(KEY_FROM) | BIT(KEY_TO) | BIT(KEY_POINTS) | BIT(KEY_LINEAR))
#define SIGNALS (BIT(KEY_INPUT) | BIT(KEY_OUTPUT))
#define RUN (BIT(KEY_STEPS) | BIT(KEY_AT) | BIT(KEY_AMPLITUDE))
#define DATA (FORMAT_JSON | FORMAT_CSV | FORMAT_MAT)

typedef struct command {
  const char *name;
  command_function *run;  // NULL: check, which loads by itself
  unsigned options, formats;
} command;

static const command commands[] = {
    {"info", command_info, 0, FORMAT_JSON},
    {"check", NULL, 0, FORMAT_JSON},
    {"modes", command_modes, BIT(KEY_MAX), DATA},
    {"poles", command_poles, BIT(KEY_MAX) | BIT(KEY_SAMPLED), DATA | FORMAT_PNG},
    {"zeros", command_zeros, BIT(KEY_MAX) | SIGNALS, DATA | FORMAT_PNG},
    {"frf", command_frf, GRID | SIGNALS | BIT(KEY_SAMPLED) | BIT(KEY_DECIBEL), DATA | FORMAT_PNG},
    {"step", command_step, RUN | SIGNALS, DATA | FORMAT_PNG},
    {"export", command_export, 0, DATA},
};

static const struct argp_option option_table[] = {
    {"json", KEY_JSON, NULL, 0, "Print JSON instead of tables", 1},
    {NULL, 'o', "PATH", 0, "Write a file: .json, .csv, .mat or .png, by its extension", 1},
    {"input", KEY_INPUT, "NAMES", 0,
     "Inputs by name, comma-separated or repeated (default: all; "
     "zeros, step: the first)",
     2},
    {"output", KEY_OUTPUT, "NAMES", 0, "Outputs by name (default: all; zeros: the first)", 2},
    {"max-frequency", KEY_MAX, "HZ", 0, "modes, poles, zeros: only those up to HZ", 2},
    {"sampled", KEY_SAMPLED, NULL, 0, "frf, poles: of the sampled system, with its hold", 2},
    {"frequencies", KEY_FREQUENCIES, "HZ,...", 0, "frf: at these frequencies", 3},
    {"from", KEY_FROM, "HZ", 0, "frf: lowest frequency (default 1)", 3},
    {"to", KEY_TO, "HZ", 0, "frf: highest frequency (default: half the sample rate)", 3},
    {"points", KEY_POINTS, "N", 0,
     "frf: number of frequencies (default 500; 25 in a table, 3000 in a plot)", 3},
    {"linear", KEY_LINEAR, NULL, 0, "frf: equal distances instead of equal ratios", 3},
    {"decibel", KEY_DECIBEL, NULL, 0, "frf: magnitudes of the plot in dB", 3},
    {"steps", KEY_STEPS, "N", 0, "step: outputs after 1 … N steps (default 1000; 20 in a table)",
     4},
    {"at", KEY_AT, "K,...", 0, "step: outputs after these numbers of steps, ascending", 4},
    {"amplitude", KEY_AMPLITUDE, "X", 0, "step: height of the step (default 1)", 4},
    {0},
};

static const char description[] =
    "What a plant file describes, without a daemon.\v"
    "Commands:\n"
    "  info    size, signals, first modes, static gains\n"
    "  check   health of the elements, all warnings; exit code 1 when not usable\n"
    "  modes   undamped natural frequencies and modal damping\n"
    "  poles   poles of the damped plant\n"
    "  zeros   transmission zeros between inputs and outputs, as many of each: of the\n"
    "          plant, and what sampling with held inputs makes of them\n"
    "  frf     exact frequency responses\n"
    "  step    response to a constant input, zero-order hold\n"
    "  export  A B C D, A_d B_d, names and modes; A_ss B_ss C_ss D_ss for the ss(A,B,C,D,Ts)\n"
    "          of other programs: y(k) = C x(k) + D u(k-1) is no standard form\n\n"
    "Exit codes: 0 done, 1 failed, 2 wrong command line.\n\n"
    "Examples:\n"
    "  plantbus-model frf bench.json --input Va --output Vs -o bode.png\n"
    "  plantbus-model zeros bench.json --input Va --output Vs\n"
    "  plantbus-model frf bench.json --frequencies 10,20,50 --json\n";

typedef struct line {
  tool tool;
  const command *command;
  unsigned given;  // options that were used
} line;

static const char *option_name(int key) {
  for (const struct argp_option *o = option_table; o->name || o->key; o++) {
    if (o->key == key) return o->name;
  }
  return "?";
}

// ---- parsing ------------------------------------------------------------------------------------

static void set_command(line *l, const char *name, struct argp_state *state) {
  for (size_t k = 0; k < sizeof commands / sizeof *commands; k++) {
    if (!strcmp(commands[k].name, name)) l->command = &commands[k];
  }
  if (!l->command) argp_error(state, "unknown command '%s'", name);
}

static void set_format(line *l, const char *path, struct argp_state *state) {
  static const struct {
    const char *extension;
    format format;
  } known[] = {
      {".json", FORMAT_JSON}, {".csv", FORMAT_CSV}, {".mat", FORMAT_MAT}, {".png", FORMAT_PNG}};
  const char *dot = strrchr(path, '.');
  l->tool.out = path;
  l->tool.out_format = FORMAT_NONE;
  for (size_t k = 0; dot && k < sizeof known / sizeof *known; k++) {
    if (!strcmp(dot, known[k].extension)) l->tool.out_format = known[k].format;
  }
  if (!l->tool.out_format) {
    argp_error(state, "-o: '%s' does not end in .json, .csv, .mat or .png", path);
  }
}

static void set_steps_at(tool *t, const char *arg, struct argp_state *state) {
  free(t->at);
  pb_option_double_list(state, "--at", arg, &t->at, &t->at_count);
  for (size_t k = 0; k < t->at_count; k++) {
    bool whole = t->at[k] >= 0 && t->at[k] <= 1e9 && t->at[k] == (double)(uint64_t)t->at[k];
    if (!whole || (k && t->at[k] <= t->at[k - 1])) {
      argp_error(state, "--at: expected ascending whole numbers up to 1e9");
    }
  }
}

static void set_frequencies(tool *t, const char *arg, struct argp_state *state) {
  free(t->frequencies);
  pb_option_double_list(state, "--frequencies", arg, &t->frequencies, &t->frequency_count);
  for (size_t k = 0; k < t->frequency_count; k++) {
    if (t->frequencies[k] < 0) argp_error(state, "--frequencies: a frequency is negative");
  }
}

// Options with a value or a flag; false: not one of them.
static bool parse_option(tool *t, int key, char *arg, struct argp_state *state) {
  switch (key) {
  case KEY_JSON:
    t->json = true;
    return true;
  case KEY_LINEAR:
    t->linear = true;
    return true;
  case KEY_SAMPLED:
    t->sampled = true;
    return true;
  case KEY_DECIBEL:
    t->decibel = true;
    return true;
  case KEY_INPUT:
    pb_option_names(state, "--input", arg, &t->inputs);
    return true;
  case KEY_OUTPUT:
    pb_option_names(state, "--output", arg, &t->outputs);
    return true;
  case KEY_FREQUENCIES:
    set_frequencies(t, arg, state);
    return true;
  case KEY_FROM:
    t->from = pb_option_double(state, "--from", arg, 1e-9, 1e9);
    return true;
  case KEY_TO:
    t->to = pb_option_double(state, "--to", arg, 1e-9, 1e9);
    return true;
  case KEY_POINTS:
    t->points = pb_option_uint64(state, "--points", arg, 1, 1000000);
    return true;
  case KEY_MAX:
    t->max_frequency = pb_option_double(state, "--max-frequency", arg, 1e-9, 1e9);
    return true;
  case KEY_STEPS:
    t->steps = pb_option_uint64(state, "--steps", arg, 1, 10000000);
    return true;
  case KEY_AT:
    set_steps_at(t, arg, state);
    return true;
  case KEY_AMPLITUDE:
    t->amplitude = pb_option_double(state, "--amplitude", arg, -1e12, 1e12);
    return true;
  default:
    return false;
  }
}

// What cannot be judged one option at a time.
static void check_line(const line *l, struct argp_state *state) {
  const tool *t = &l->tool;
  if (!l->command || !t->file) argp_error(state, "expected a command and a plant file");
  unsigned wrong = l->given & ~(l->command->options | BIT(KEY_JSON));
  for (int key = KEY_JSON; wrong && key < KEY_END; key++) {
    if (wrong & BIT(key)) {
      argp_error(state, "%s has no option --%s", l->command->name, option_name(key));
    }
  }
  if (t->out && !(l->command->formats & t->out_format)) {
    argp_error(state, "%s cannot be written as '%s'", l->command->name, strrchr(t->out, '.'));
  }
  if (t->frequencies && (l->given & (GRID & ~BIT(KEY_FREQUENCIES)))) {
    argp_error(state, "--frequencies excludes --from, --to, --points and --linear");
  }
  if (t->from > 0 && t->to > 0 && t->from >= t->to) argp_error(state, "--from is not below --to");
  if (t->at && t->steps) argp_error(state, "--at excludes --steps");
  if (l->command->run == command_step && t->inputs.count > 1) {
    argp_error(state, "step takes one --input");
  }
  bool files_only = l->command->run == command_export;
  if (files_only && !t->out && !t->json) argp_error(state, "export needs -o or --json");
}

static error_t parse(int key, char *arg, struct argp_state *state) {
  line *l = state->input;
  if (key >= KEY_JSON && key < KEY_END) l->given |= BIT(key);
  if (parse_option(&l->tool, key, arg, state)) return 0;
  switch (key) {
  case 'o':
    set_format(l, arg, state);
    return 0;
  case ARGP_KEY_ARG:
    if (state->arg_num == 0) {
      set_command(l, arg, state);
    } else if (state->arg_num == 1) {
      l->tool.file = arg;
    } else {
      argp_error(state, "one plant file at a time");
    }
    return 0;
  case ARGP_KEY_END:
    check_line(l, state);
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

// ---- running ------------------------------------------------------------------------------------

static int run(const line *l) {
  const tool *t = &l->tool;
  if (!l->command->run) return command_check(t);
  pb_model *model = NULL;
  pb_warnings warnings = {0};
  pb_error err = {0};
  pb_status status = pb_model_load(t->file, &warnings, &model, &err);
  pb_print_warnings(stderr, &warnings);
  pb_warnings_clear(&warnings);
  int code = tool_end(status, &err);
  if (!code) code = l->command->run(t, model);
  pb_model_free(model);
  return code;
}

int main(int argc, char **argv) {
  static const struct argp argp = {
      .options = option_table, .parser = parse, .args_doc = "COMMAND FILE", .doc = description};
  line l = {.tool = {.amplitude = 1}};
  int code = pb_options_parse(&argp, argc, argv, &l) ? PB_EXIT_USAGE : run(&l);
  pb_name_list_free(&l.tool.inputs);
  pb_name_list_free(&l.tool.outputs);
  free(l.tool.frequencies);
  free(l.tool.at);
  return code;
}
