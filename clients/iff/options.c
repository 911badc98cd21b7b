// The options of an IFF experiment, an argp child, and what they default to.
#include <math.h>
#include <string.h>

#include "iff_tool.h"

enum {
  KEY_INPUT = 0x100,
  KEY_OUTPUT,
  KEY_STRUT,
  KEY_GAIN,
  KEY_CORNERS,
  KEY_SIGN,
  KEY_DELAY,
  KEY_NO_OPEN,
  KEY_FORCE,
};

static const struct argp_option option_table[] = {
    {"gain", KEY_GAIN, "G", 0,
     "Gain of K = G/(s + 2π·2) · s/(s + 2π·0.5), or auto (default): the one that gives the modes "
     "of "
     "the band their largest smallest damping",
     2},
    {"strut", KEY_STRUT, "K", 0, "Close the loop of strut K only (default: all)", 2},
    {"input", KEY_INPUT, "NAMES", 0,
     "Inputs of the loops (default: each Va… with Vs…, f… with fm…)", 2},
    {"output", KEY_OUTPUT, "NAMES", 0, "Outputs of the loops, in the order of the inputs", 2},
    {"corners", KEY_CORNERS, "FI,FH", 0,
     "Corners of integrator and high-pass in Hz (default 2,0.5)", 2},
    {"sign", KEY_SIGN, "S", 0, "Sign of the feedback, 1 (default) or -1", 2},
    {"delay", KEY_DELAY, "N", 0,
     "Delay of the loop in samples for the prediction (default 0 in lockstep, 1 in real time)", 2},
    {"no-open-loop", KEY_NO_OPEN, NULL, 0, "Do not measure the undamped plant first", 2},
    {"force", KEY_FORCE, NULL, 0, "Close a loop that is predicted to be unstable", 2},
    {0},
};

void iff_parse_gain(struct argp_state *state, const char *flag, const char *text, iff_options *o) {
  o->gain_given = strcmp(text, "auto") != 0;
  if (o->gain_given) o->gain = pb_option_double(state, flag, text, 1e-12, 1e12);
}

void iff_parse_corners(struct argp_state *state, const char *flag, const char *text,
                       iff_options *o) {
  static const char expected[] = "two positive frequencies";
  double hz[2] = {0};
  pb_option_numbers(state, flag, text, hz, 2, expected);
  if (!(hz[0] > 0 && hz[1] > 0)) argp_error(state, "%s: '%s' is not %s", flag, text, expected);
  o->integrator_hz = hz[0];
  o->highpass_hz = hz[1];
}

static void parse_sign(struct argp_state *state, const char *text, iff_options *o) {
  if (strcmp(text, "1") != 0 && strcmp(text, "+1") != 0 && strcmp(text, "-1") != 0) {
    argp_error(state, "--sign: '%s' is not 1 or -1", text);
  }
  o->sign = text[0] == '-' ? -1 : 1;
}

static error_t parse(int key, char *text, struct argp_state *state) {
  iff_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->common;
    state->child_inputs[1] = &o->excite;
    state->child_inputs[2] = &o->result;
    break;
  case KEY_INPUT:
    pb_option_names(state, "--input", text, &o->inputs);
    break;
  case KEY_OUTPUT:
    pb_option_names(state, "--output", text, &o->outputs);
    break;
  case KEY_STRUT:
    o->strut = pb_option_uint64(state, "--strut", text, 1, 1000);
    break;
  case KEY_GAIN:
    iff_parse_gain(state, "--gain", text, o);
    break;
  case KEY_CORNERS:
    iff_parse_corners(state, "--corners", text, o);
    break;
  case KEY_SIGN:
    parse_sign(state, text, o);
    break;
  case KEY_DELAY:
    o->delay = (int)pb_option_uint64(state, "--delay", text, 0, 100);
    break;
  case KEY_NO_OPEN:
    o->skip_open_loop = true;
    break;
  case KEY_FORCE:
    o->force = true;
    break;
  default:
    return ARGP_ERR_UNKNOWN;
  }
  return 0;
}

static const struct argp_child children[] = {{&pb_common_argp, 0, NULL, 0},
                                             {&pb_excite_argp, 0, "Excitation:", 9},
                                             {&pb_result_argp, 0, NULL, 0},
                                             {0}};

const struct argp iff_argp = {option_table, parse, NULL, NULL, children, NULL, NULL};

void iff_options_default(iff_options *o) {
  *o = (iff_options){
      .sign = 1,
      .delay = -1,
      .result = {.files_help = "Write iff.mat and CSV files into DIR",
                 .plot_help = "Draw the root locus and the damped plant (PNG) into DIR, or here"}};
  pb_excite_options_default(&o->excite);
}

void iff_options_free(iff_options *o) {
  pb_name_list_free(&o->inputs);
  pb_name_list_free(&o->outputs);
}

void iff_experiment_defaults(const iff_options *o, const pb_model *model,
                             pb_experiment_options *e) {
  *e = o->excite.experiment;
  bool noise = e->excitation == PB_EXCITE_NOISE;
  if (e->rms == 0) e->rms = 1;
  if (e->f2 == 0) {
    e->f1 = 1;
    e->f2 = fmin(500, 0.4 * model->sample_rate);
  }
  if (e->resolution == 0) e->resolution = noise ? 0.1 : 1;
  if (e->averages == 0) e->averages = noise ? 10 : 2;
  if (e->limit == 0) e->limit = 100 * e->rms;
}
