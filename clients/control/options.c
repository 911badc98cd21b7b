// Options of plantbus-control hac and run.
#include <string.h>

#include "control_tool.h"

enum {
  KEY_LIVE = 0x200,
  KEY_FRAME,
  KEY_BANDWIDTH,
  KEY_LEAD,
  KEY_INTEGRATOR,
  KEY_LOW_PASS,
  KEY_IFF_GAIN,
  KEY_IFF_CORNERS,
  KEY_NO_IFF,
  KEY_JACOBIAN,
  KEY_INPUT,
  KEY_SENSOR,
  KEY_METROLOGY,
  KEY_MOTION,
  KEY_DISTURBANCE,
  KEY_DELAY,
  KEY_FORCE,
  KEY_NO_OPEN,
  KEY_HOSTED,
  KEY_KEEP,
};

static const struct argp_option option_table[] = {
    {"force", KEY_FORCE, NULL, 0, "Export or close a loop that is predicted to be unstable", 1},
    {"frame", KEY_FRAME, "FRAME", 0,
     "strut (default): a loop a strut; cartesian: a loop a direction of the point of interest", 2},
    {"bandwidth", KEY_BANDWIDTH, "HZ", 0, "Crossover of each loop (required)", 2},
    {"lead", KEY_LEAD, "A", 0, "Ratio of the lead's corners (default 9; 1: none)", 2},
    {"integrator", KEY_INTEGRATOR, "HZ", 0,
     "Corner of the integrator (default bandwidth/10; 0: none)", 2},
    {"low-pass", KEY_LOW_PASS, "HZ", 0, "Corner of the low-pass (default 10 bandwidth; 0: none)",
     2},
    {"jacobian", KEY_JACOBIAN, "SOURCE", 0,
     "geometry (of the template), static (gains of the plant), or auto (default): the geometry "
     "where there is one",
     2},
    {"iff-gain", KEY_IFF_GAIN, "G", 0,
     "Gain of IFF, or auto (default): the largest smallest damping", 3},
    {"iff-corners", KEY_IFF_CORNERS, "FI,FH", 0,
     "Corners of IFF's integrator and high-pass in Hz (default 2,0.5)", 3},
    {"no-iff", KEY_NO_IFF, NULL, 0, "HAC alone, around the undamped plant", 3},
    {"delay", KEY_DELAY, "N", 0,
     "Delay of both controllers in samples (default 0; in real time that of their channels)", 3},
    {"input", KEY_INPUT, "NAMES", 0, "Actuators (default: each Va… with Vs…, f… with fm…)", 4},
    {"sensor", KEY_SENSOR, "NAMES", 0, "Force sensors, in the order of the inputs", 4},
    {"metrology", KEY_METROLOGY, "NAMES", 0,
     "Outputs that HAC reads, in the order of the inputs (default: dL… of the same names)", 4},
    {"motion", KEY_MOTION, "NAMES", 0,
     "Outputs at the point of interest (default: Dx … Rz, else the metrology)", 4},
    {"disturbance", KEY_DISTURBANCE, "NAMES", 0,
     "Inputs at the point of interest (default: Fx … Mz, else all that are no actuators)", 4},
    {"no-undamped", KEY_NO_OPEN, NULL, 0, "run: leave out the undamped plant", 5},
    {"hosted", KEY_HOSTED, NULL, 0,
     "run: the daemon runs HAC too (default: this client, over the bus)", 5},
    {"keep", KEY_KEEP, NULL, 0, "run: leave the hosted controllers running", 5},
    {0},
};

// ---- the plant of iff and hac -------------------------------------------------------------------

static const struct argp_option source_table[] = {
    {"live", KEY_LIVE, NULL, 0, "Take the plant on the bus, not a file", 1}, {0}};

static error_t parse_source(int key, char *text, struct argp_state *state) {
  control_source *o = state->input;
  switch (key) {
  case KEY_LIVE:
    o->live = true;
    return 0;
  case ARGP_KEY_ARG:
    if (o->file) argp_error(state, "unexpected argument '%s'", text);
    o->file = text;
    return 0;
  case ARGP_KEY_END:
    if (!o->file == !o->live) argp_error(state, "a plant file is wanted, or --live");
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

const struct argp control_source_argp = {source_table, parse_source, NULL, NULL, NULL, NULL, NULL};

// ---- hac and run --------------------------------------------------------------------------------

static void parse_frame(struct argp_state *state, const char *text, control_options *o) {
  if (strcmp(text, "strut") != 0 && strcmp(text, "cartesian") != 0) {
    argp_error(state, "--frame: '%s' is not strut or cartesian", text);
  }
  o->cartesian = text[0] == 'c';
}

static void parse_jacobian(struct argp_state *state, const char *text, control_options *o) {
  static const char *const word[] = {"auto", "geometry", "static"};
  for (int k = 0; k < 3; k++) {
    if (strcmp(text, word[k]) != 0) continue;
    o->jacobian = (jacobian_source)k;
    return;
  }
  argp_error(state, "--jacobian: '%s' is not auto, geometry or static", text);
}

static bool parse_shape(int key, char *text, struct argp_state *state, control_options *o) {
  switch (key) {
  case KEY_FRAME:
    parse_frame(state, text, o);
    return true;
  case KEY_BANDWIDTH:
    o->bandwidth_hz = pb_option_double(state, "--bandwidth", text, 1e-6, 1e6);
    return true;
  case KEY_LEAD:
    o->lead = pb_option_double(state, "--lead", text, 1, 1e4);
    return true;
  case KEY_INTEGRATOR:
    o->integrator_hz = pb_option_double(state, "--integrator", text, 0, 1e6);
    return true;
  case KEY_LOW_PASS:
    o->lowpass_hz = pb_option_double(state, "--low-pass", text, 0, 1e6);
    return true;
  case KEY_JACOBIAN:
    parse_jacobian(state, text, o);
    return true;
  default:
    return false;
  }
}

static bool parse_channels(int key, char *text, struct argp_state *state, control_options *o) {
  switch (key) {
  case KEY_INPUT:
    pb_option_names(state, "--input", text, &o->iff.inputs);
    return true;
  case KEY_SENSOR:
    pb_option_names(state, "--sensor", text, &o->iff.outputs);
    return true;
  case KEY_METROLOGY:
    pb_option_names(state, "--metrology", text, &o->metrology);
    return true;
  case KEY_MOTION:
    pb_option_names(state, "--motion", text, &o->motion);
    return true;
  case KEY_DISTURBANCE:
    pb_option_names(state, "--disturbance", text, &o->disturbance);
    return true;
  default:
    return false;
  }
}

static bool parse_flags(int key, control_options *o) {
  switch (key) {
  case KEY_FORCE:
    return o->iff.force = true;
  case KEY_NO_IFF:
    return o->no_iff = true;
  case KEY_NO_OPEN:
    return o->iff.skip_open_loop = true;
  case KEY_HOSTED:
    return o->hosted = true;
  case KEY_KEEP:
    return o->keep = true;
  default:
    return false;
  }
}

static error_t parse(int key, char *text, struct argp_state *state) {
  control_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->iff.common;
    state->child_inputs[1] = &o->iff.excite;
    state->child_inputs[2] = &o->iff.result;
    return 0;
  case KEY_IFF_GAIN:
    iff_parse_gain(state, "--iff-gain", text, &o->iff);
    return 0;
  case KEY_IFF_CORNERS:
    iff_parse_corners(state, "--iff-corners", text, &o->iff);
    return 0;
  case KEY_DELAY:
    o->iff.delay = (int)pb_option_uint64(state, "--delay", text, 0, 100);
    return 0;
  case ARGP_KEY_END:
    if (o->bandwidth_hz == 0) argp_error(state, "--bandwidth is missing");
    if (o->no_iff && o->iff.gain_given)
      argp_error(state, "--no-iff and --iff-gain exclude each other");
    return 0;
  default:
    break;
  }
  bool known = parse_shape(key, text, state, o) || parse_channels(key, text, state, o) ||
               parse_flags(key, o);
  return known ? 0 : ARGP_ERR_UNKNOWN;
}

static const struct argp_child children[] = {
    {&pb_common_argp, 0, NULL, 0},
    {&pb_excite_argp, 0, "Disturbance (run) and band of the modes:", 9},
    {&pb_result_argp, 0, NULL, 0},
    {0}};

const struct argp control_argp = {option_table, parse, NULL, NULL, children, NULL, NULL};

void control_options_default(control_options *o) {
  *o = (control_options){.lead = -1, .integrator_hz = -1, .lowpass_hz = -1};
  iff_options_default(&o->iff);
  o->iff.result =
      (pb_result_options){.files_help = "Write MAT, CSV and the controllers (JSON) into DIR",
                          .plot_help = "Draw the figures (PNG) into DIR, or here"};
}

void control_options_free(control_options *o) {
  iff_options_free(&o->iff);
  pb_name_list_free(&o->metrology);
  pb_name_list_free(&o->motion);
  pb_name_list_free(&o->disturbance);
}
