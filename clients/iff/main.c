// plantbus-iff: closes integral force feedback around a plant that a daemon runs, measures the
// damped plant, and compares it with what the published model predicts for the sampled loop.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "iff_tool.h"
#include "interrupt.h"

enum {
  KEY_JSON = 0x100,
  KEY_PLOT,
  KEY_INPUT,
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
    {"json", KEY_JSON, NULL, 0, "Print JSON instead of tables", 1},
    {"output-dir", 'o', "DIR", 0, "Write iff.mat and CSV files into DIR", 1},
    {"plot", KEY_PLOT, NULL, 0, "Draw the root locus and the damped plant (PNG) into DIR, or here",
     1},
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

static const char description[] =
    "Damps a plant on the bus by integral force feedback and measures the result.\v"
    "The excitation is added to the controller's command: u = w + K y. Its band is also the band "
    "of the "
    "modes that are looked at, by default 1 … 500 Hz (0.4 of the sample rate if that is less).\n\n"
    "Exit codes: 0 done, 1 failed, 2 wrong command line.\n\n"
    "Examples:\n"
    "  plantbus-iff --plot -o out\n"
    "  plantbus-iff --gain 400 --strut 1 --band 5,200\n";

static void parse_gain(struct argp_state *state, const char *text, iff_options *o) {
  if (strcmp(text, "auto") == 0) return;
  o->gain = pb_option_double(state, "--gain", text, 1e-12, 1e12);
  o->gain_given = true;
}

static void parse_corners(struct argp_state *state, const char *text, iff_options *o) {
  double *value = NULL;
  size_t count = 0;
  pb_option_double_list(state, "--corners", text, &value, &count);
  if (count != 2 || !(value[0] > 0 && value[1] > 0)) {
    argp_error(state, "--corners: '%s' is not two positive frequencies", text);
  } else {
    o->integrator_hz = value[0];
    o->highpass_hz = value[1];
  }
  free(value);
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
    break;
  case KEY_JSON:
    o->json = true;
    break;
  case KEY_PLOT:
    o->plot = true;
    break;
  case 'o':
    o->output_dir = text;
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
    parse_gain(state, text, o);
    break;
  case KEY_CORNERS:
    parse_corners(state, text, o);
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
  case ARGP_KEY_ARG:
    argp_error(state, "unexpected argument '%s'", text);
    break;
  default:
    return ARGP_ERR_UNKNOWN;
  }
  return 0;
}

static void fill_defaults(const iff_options *o, const pb_model *model, pb_experiment_options *e) {
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

static pb_status present(const iff_result *r, pb_error *err) {
  const iff_options *o = r->options;
  pb_status status = o->json ? iff_print_json(r, err) : iff_print(r, err);
  const char *dir = o->output_dir ? o->output_dir : ".";
  if (status == PB_OK && o->output_dir) status = iff_save(r, dir, err);
  if (status == PB_OK && o->plot) status = iff_plot(r, dir, err);
  return status;
}

static pb_status all_outputs(const pb_model *model, size_t **output, pb_error *err) {
  *output = malloc((model->ny + 1) * sizeof **output);
  if (!*output) return pb_fail_memory(err, "outputs");
  for (size_t k = 0; k < model->ny; k++) (*output)[k] = k;
  return PB_OK;
}

static pb_status damp(const iff_options *o, pb_error *err) {
  pb_bench bench = {0};
  size_t *output = NULL;
  pb_status status = pb_bench_open(&o->common, o->excite.reset, &bench, err);
  if (status != PB_OK) return status;
  iff_result result = {.options = o, .bench = &bench, .model = bench.model};
  fill_defaults(o, bench.model, &result.experiment);
  status = iff_choose_loops(bench.model, o, &result.loops, err);
  if (status == PB_OK) status = all_outputs(bench.model, &output, err);
  result.channels =
      (pb_experiment_channels){result.loops.input, output, result.loops.count, bench.model->ny};
  if (status == PB_OK) status = iff_design(&result, err);
  if (status == PB_OK) status = iff_measure(&result, &bench, err);
  if (status == PB_OK) status = present(&result, err);
  iff_result_clear(&result);
  free(output);
  pb_bench_close(&bench);
  return status;
}

int main(int argc, char **argv) {
  static const struct argp_child children[] = {
      {&pb_common_argp, 0, NULL, 0}, {&pb_excite_argp, 0, "Excitation:", 9}, {0}};
  static const struct argp argp = {option_table, parse, NULL, description, children, NULL, NULL};
  iff_options options = {.sign = 1, .delay = -1};
  pb_error err = {0};
  pb_excite_options_default(&options.excite);
  pb_options_parse(&argp, argc, argv, &options);
  pb_interrupt_install();
  pb_status status = damp(&options, &err);
  if (status != PB_OK) pb_print_error(stderr, &err);
  pb_name_list_free(&options.inputs);
  pb_name_list_free(&options.outputs);
  return status == PB_OK ? PB_EXIT_DONE : PB_EXIT_FAILED;
}
