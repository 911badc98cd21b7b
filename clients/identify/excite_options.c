// Options of an excitation: see excite_options.h.
#include "excite_options.h"

#include <string.h>

enum {
  KEY_EXCITATION = 0x400,
  KEY_RMS,
  KEY_BAND,
  KEY_RESOLUTION,
  KEY_AVERAGES,
  KEY_SETTLE,
  KEY_ONE_AT_A_TIME,
  KEY_WINDOW,
  KEY_OVERLAP,
  KEY_ESTIMATOR,
  KEY_SEED,
  KEY_LIMIT,
  KEY_RESET,
  KEY_NO_RESET,
};

static const struct argp_option option_table[] = {
    {"excitation", KEY_EXCITATION, "KIND", 0,
     "multisine (default), noise (band-limited, Welch's estimate), periodic-noise, chirp", 10},
    {"rms", KEY_RMS, "X", 0,
     "Effective value of the excitation of each input, in its unit (default 1)", 10},
    {"band", KEY_BAND, "F1,F2", 0, "Excited band in Hz", 10},
    {"resolution", KEY_RESOLUTION, "HZ", 0, "Distance of the spectral lines", 10},
    {"averages", KEY_AVERAGES, "N", 0, "Periods or segments that are averaged", 10},
    {"settle", KEY_SETTLE, "S", 0,
     "Seconds left unused at the start of each stage (default: until the slowest pole of the band "
     "has died down to 1e-4)",
     10},
    {"one-at-a-time", KEY_ONE_AT_A_TIME, NULL, 0,
     "Excite one input after the other instead of all at once (orthogonally)", 10},
    {"window", KEY_WINDOW, "NAME", 0,
     "noise: hann (default), hamming, blackman, flattop, rectangular", 10},
    {"overlap", KEY_OVERLAP, "PART", 0, "noise: overlap of the segments, 0 … 0.95 (default 0.5)",
     10},
    {"estimator", KEY_ESTIMATOR, "NAME", 0, "noise: h1 (default) or h2", 10},
    {"seed", KEY_SEED, "N", 0, "Seed of the excitation (default 1)", 10},
    {"limit", KEY_LIMIT, "X", 0,
     "End the run with zero commands when one exceeds X (default: none, iff: 100 times the "
     "excitation)",
     10},
    {"reset", KEY_RESET, NULL, 0,
     "Put the plant at rest first (default in lockstep when no other client is attached)", 10},
    {"no-reset", KEY_NO_RESET, NULL, 0, "Leave the plant as it is", 10},
    {0},
};

static const char *const excitation_names[] = {
    [PB_EXCITE_MULTISINE] = "multisine",
    [PB_EXCITE_NOISE] = "noise",
    [PB_EXCITE_PERIODIC_NOISE] = "periodic-noise",
    [PB_EXCITE_CHIRP] = "chirp",
};

const char *pb_excitation_name(pb_excitation excitation) {
  return excitation_names[excitation];
}

void pb_excite_options_default(pb_excite_options *o) {
  *o = (pb_excite_options){0};
  o->experiment.window = PB_WINDOW_HANN;
  o->experiment.overlap = 0.5;
  o->experiment.seed = 1;
}

static void parse_excitation(struct argp_state *state, const char *text, pb_excitation *out) {
  for (size_t k = 0; k < sizeof excitation_names / sizeof *excitation_names; k++) {
    if (strcmp(text, excitation_names[k]) == 0) {
      *out = (pb_excitation)k;
      return;
    }
  }
  argp_error(state, "--excitation: '%s' is not multisine, noise, periodic-noise or chirp", text);
}

static void parse_band(struct argp_state *state, const char *text, pb_experiment_options *e) {
  static const char expected[] = "F1,F2 with 0 <= F1 < F2";
  double hz[2] = {0};
  pb_option_numbers(state, "--band", text, hz, 2, expected);
  if (!(hz[0] >= 0 && hz[0] < hz[1])) argp_error(state, "--band: '%s' is not %s", text, expected);
  e->f1 = hz[0];
  e->f2 = hz[1];
}

static void parse_words(int key, const char *text, struct argp_state *state, pb_excite_options *o) {
  pb_experiment_options *e = &o->experiment;
  if (key == KEY_WINDOW && !pb_window_parse(text, &e->window)) {
    argp_error(state, "--window: '%s' is not hann, hamming, blackman, flattop or rectangular",
               text);
  }
  if (key != KEY_ESTIMATOR) return;
  if (strcmp(text, "h1") != 0 && strcmp(text, "h2") != 0) {
    argp_error(state, "--estimator: '%s' is not h1 or h2", text);
  }
  e->estimator = text[1] == '2' ? PB_ESTIMATE_H2 : PB_ESTIMATE_H1;
}

static error_t parse(int key, char *text, struct argp_state *state) {
  pb_excite_options *o = state->input;
  if (!o) return ARGP_ERR_UNKNOWN;
  pb_experiment_options *e = &o->experiment;
  switch (key) {
  case KEY_EXCITATION:
    parse_excitation(state, text, &e->excitation);
    break;
  case KEY_RMS:
    e->rms = pb_option_double(state, "--rms", text, 1e-12, 1e12);
    break;
  case KEY_BAND:
    parse_band(state, text, e);
    break;
  case KEY_RESOLUTION:
    e->resolution = pb_option_double(state, "--resolution", text, 1e-4, 1e5);
    break;
  case KEY_AVERAGES:
    e->averages = (size_t)pb_option_uint64(state, "--averages", text, 1, 100000);
    break;
  case KEY_SETTLE:
    e->settle = pb_option_double(state, "--settle", text, 0, 1e5);
    o->settle_given = true;
    break;
  case KEY_ONE_AT_A_TIME:
    e->one_at_a_time = true;
    break;
  case KEY_OVERLAP:
    e->overlap = pb_option_double(state, "--overlap", text, 0, 0.95);
    break;
  case KEY_WINDOW:
  case KEY_ESTIMATOR:
    parse_words(key, text, state, o);
    break;
  case KEY_SEED:
    e->seed = pb_option_uint64(state, "--seed", text, 0, UINT64_MAX);
    break;
  case KEY_LIMIT:
    e->limit = pb_option_double(state, "--limit", text, 1e-12, 1e12);
    break;
  case KEY_RESET:
    o->reset = PB_RESET_ALWAYS;
    break;
  case KEY_NO_RESET:
    o->reset = PB_RESET_NEVER;
    break;
  default:
    return ARGP_ERR_UNKNOWN;
  }
  return 0;
}

const struct argp pb_excite_argp = {option_table, parse, NULL, NULL, NULL, NULL, NULL};
