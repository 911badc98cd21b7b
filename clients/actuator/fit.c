// plantbus-actuator fit: the 2-DoF model tuned to an element, a model, a measured response, or a
// running bench.
#include "fit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "assembly/motion.h"
#include "frf_read.h"
#include "outfile.h"
#include "study/element_bench.h"

enum {
  KEY_FRF = 0x100,
  KEY_WRITE,
  KEY_NAME,
  KEY_LOAD,
  KEY_MASS,
  KEY_INNER,
  KEY_RATIO,
  KEY_RATE,
  KEY_RADIUS,
  KEY_BAND,
  KEY_REFINE,
  KEY_FREE,
  KEY_TOLERANCE,
};
enum { POINTS = 4000 };  // of an exact response, on a logarithmic axis

static const struct argp_option option_table[] = {
    {"frf", KEY_FRF, "FILE", 0, "Tune to identify.csv or identify.mat in place of FILE", 2},
    {"sample-rate", KEY_RATE, "HZ", 0, "Of a CSV file (default 10000)", 2},
    {"load", KEY_LOAD, "KG", 0, "Mass on the actuator (default 5)", 3},
    {"mass", KEY_MASS, "KG", 0,
     "Of the actuator, half of which moves with the load (default: of the element or model; 0.112 "
     "with measured responses)",
     3},
    {"inner-mass", KEY_INNER, "KG", 0, "Intermediate mass of the model (default 0.001)", 3},
    {"ratio", KEY_RATIO, "R", 0, "k_e/k_a and c_e/c_a (default 2)", 3},
    {"refine", KEY_REFINE, "F1,F2", 0, "Then least squares over this band, Hz", 3},
    {"free-ratio", KEY_FREE, NULL, 0, "--refine: k_e and c_e of their own", 3},
    {"range", KEY_BAND, "F1,F2", 0, "Of the exact response, Hz (default 1,20000)", 3},
    {"tolerance", KEY_TOLERANCE, "PART", 0,
     "The match ends where the error of a third of an octave exceeds this (default 0.2)", 3},
    {"write", KEY_WRITE, "FILE", 0, "Write the model as a merge patch for a plant file", 6},
    {"name", KEY_NAME, "NAME", 0, "Of the model", 6},
    {"radius", KEY_RADIUS, "M", 0, "Of the model (default: of the model, else 0.02)", 6},
    {0},
};

static error_t parse_model(int key, char *text, struct argp_state *state, fit_options *o) {
  switch (key) {
  case KEY_WRITE:
    o->write = text;
    return 0;
  case KEY_NAME:
    o->name = text;
    if (!*text) argp_error(state, "--name: is empty");
    return 0;
  case KEY_RADIUS:
    o->radius = pb_option_double(state, "--radius", text, 1e-9, 1e3);
    return 0;
  case KEY_TOLERANCE:
    o->tolerance = pb_option_double(state, "--tolerance", text, 1e-9, 1e3);
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

static error_t parse(int key, char *text, struct argp_state *state) {
  fit_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->subject;
    return 0;
  case KEY_FRF:
    o->frf = text;
    o->subject.other = true;
    return 0;
  case KEY_RATE:
    o->sample_rate = pb_option_double(state, "--sample-rate", text, 1e-3, 1e9);
    return 0;
  case KEY_LOAD:
    o->load = pb_option_double(state, "--load", text, 1e-9, 1e9);
    return 0;
  case KEY_MASS:
    o->mass = pb_option_double(state, "--mass", text, 1e-9, 1e9);
    return 0;
  case KEY_INNER:
    o->inner = pb_option_double(state, "--inner-mass", text, 1e-9, 1e9);
    return 0;
  case KEY_RATIO:
    o->ratio = pb_option_double(state, "--ratio", text, 1e-6, 1e6);
    return 0;
  case KEY_BAND:
    pb_option_band(state, "--range", text, &o->f1, &o->f2);
    return 0;
  case KEY_REFINE:
    pb_option_band(state, "--refine", text, &o->refine1, &o->refine2);
    return 0;
  case KEY_FREE:
    o->free_ratio = true;
    return 0;
  case ARGP_KEY_END:
    if (o->free_ratio && !(o->refine2 > 0)) argp_error(state, "--free-ratio goes with --refine");
    return 0;
  default:
    return parse_model(key, text, state, o);
  }
}

// ---- what it is tuned to ------------------------------------------------------------------------

static double strut_length(const pb_bench_model *bench) {
  const pb_component *c = pb_bench_part(bench);
  const int part = (int)(c - bench->plant->component);
  double bottom[3], top[3];
  pb_frame_position(bench->plant, (pb_anchor){part, (size_t)pb_component_frame(c, "bottom")},
                    bottom);
  pb_frame_position(bench->plant, (pb_anchor){part, (size_t)pb_component_frame(c, "top")}, top);
  return fabs(top[2] - bottom[2]);
}

static void take_part(const pb_bench_model *bench, fit_result *r) {
  const pb_component *c = pb_bench_part(bench);
  if (c->type == PB_SUPER_ELEMENT) {
    r->mass = c->super.element->health.mass;
  } else {
    r->mass = c->strut.mass;
    r->radius = c->strut.radius;
  }
  r->length = strut_length(bench);
}

static pb_status from_file(const fit_options *o, fit_result *r, pb_error *err) {
  pb_element_source source;
  pb_bench_model bench = {0};
  pb_warnings warnings = {0};
  double *hz = log_frequencies(o->f1, o->f2, POINTS);
  pb_status st = hz ? source_open(&o->subject.source, &source, err) : pb_fail_memory(err, "fit");
  if (st) {
    free(hz);
    return st;
  }
  const pb_actuator_bench options = {.load = o->load};
  snprintf(r->name, sizeof r->name, "%.100s-2dof", source.name);
  snprintf(r->subject, sizeof r->subject, "%.100s with %g kg, exact", source.name, o->load);
  st = pb_actuator_bench_build(&source, &options, &warnings, &bench, err);
  pb_print_warnings(stderr, &warnings);
  if (!st) {
    take_part(&bench, r);
    st = pb_apa_data_of_model(bench.model, hz, POINTS, &r->data, err);
  }
  if (!st) st = pb_apa_landmarks_of_model(bench.model, &r->landmarks, err);
  pb_bench_model_clear(&bench);
  pb_warnings_clear(&warnings);
  pb_element_source_clear(&source);
  free(hz);
  return st;
}

static pb_status from_measurement(const fit_options *o, fit_result *r, pb_error *err) {
  const frf_names names = {o->subject.live.va, {o->subject.live.y, o->subject.live.vs}};
  live_result live;
  pb_status st = PB_OK;
  if (o->frf) {
    st = frf_read(o->frf, &names, &r->data, err);
    if (!st && !(r->data.sample_rate > 0))
      r->data.sample_rate = o->sample_rate > 0 ? o->sample_rate : 10000;
    snprintf(r->subject, sizeof r->subject, "%.150s", o->frf);
  } else {
    st = live_identify(&o->subject.live, false, &live, err);
    if (st) return st;
    r->data = live.data;
    snprintf(r->subject, sizeof r->subject, "%s, measured at revision %u", live.plant,
             live.revision);
  }
  snprintf(r->name, sizeof r->name, "measured-2dof");
  return st ? st : pb_apa_landmarks_of_data(&r->data, &r->landmarks, err);
}

// ---- fitting ------------------------------------------------------------------------------------

static void fill_defaults(const fit_options *o, fit_result *r) {
  if (o->name) snprintf(r->name, sizeof r->name, "%s", o->name);
  if (o->mass > 0) r->mass = o->mass;
  if (!(r->mass > 0)) r->mass = 0.112;
  if (o->subject.source.length > 0) r->length = o->subject.source.length;
  if (!(r->length > 0)) r->length = 0.03;
  if (o->radius > 0) r->radius = o->radius;
  if (!(r->radius > 0)) r->radius = 0.02;
}

static pb_status tune(const fit_options *o, fit_result *r, pb_error *err) {
  const pb_frf *frf = &r->data.frf;
  const pb_apa_refine_options refine = {o->refine1, o->refine2, o->free_ratio};
  pb_status st = pb_apa_from_landmarks(&r->landmarks, r->data.sample_rate, o->load + 0.5 * r->mass,
                                       o->inner, o->ratio, &r->by_order, err);
  r->apa = r->by_order;
  if (!st && o->refine2 > 0) st = pb_apa_refine(&r->data, &refine, &r->apa, &r->refined, err);
  if (!st)
    st = pb_apa_match_find(&r->data, &r->apa, r->landmarks.pole_hz, o->tolerance, &r->match, err);
  if (st) return st;
  r->model = malloc(frf->nf * PB_APA_OUTPUTS * sizeof *r->model);
  if (!r->model) return pb_fail_memory(err, "fit");
  return pb_apa_2dof_response(&r->apa, r->data.sample_rate, frf->frequency_hz, frf->nf, r->model,
                              err);
}

int command_fit(int argc, char **argv) {
  static const struct argp_child children[] = {{&subject_argp, 0, NULL, 0}, {0}};
  static const struct argp argp = {
      option_table,
      parse,
      "[FILE]",
      "Tunes the 2-DoF model of an amplified actuator, in the report's order.\v"
      "k_1 and c_1 from the first zero of V_a to V_s, the stacks from the first pole of V_a to y, "
      "g_a and g_s from the gains at 0 Hz; then, with --refine, least squares.\n\n"
      "Exit codes: 0 done, 1 failed, 2 wrong command line.\n\n"
      "Examples:\n"
      "  plantbus-actuator fit APA300ML.mat --load 5 --plot --output-dir out --write apa.json\n"
      "  plantbus-actuator fit --frf out/identify.mat --refine 5,300\n"
      "  plantbus-actuator fit --live\n",
      children,
      NULL,
      NULL};
  fit_options o = {.load = 5, .inner = 1e-3, .ratio = 2, .f1 = 1, .f2 = 20000, .tolerance = 0.2};
  fit_result r = {0};
  pb_error err = {0};
  subject_defaults(&o.subject);
  o.subject.wanted = "tune to one of: a FILE, --frf FILE, --live";
  pb_options_parse(&argp, argc, argv, &o);
  pb_status st = pb_result_check(&o.subject.result, &err);
  if (!st) st = pb_outfile_probe(o.write, &err);
  if (!st) st = o.subject.source.file ? from_file(&o, &r, &err) : from_measurement(&o, &r, &err);
  fill_defaults(&o, &r);
  if (!st) st = tune(&o, &r, &err);
  if (!st) st = fit_present(&o, &r, &err);
  pb_apa_data_clear(&r.data);
  pb_apa_match_clear(&r.match);
  free(r.model);
  return pb_result_end(st, &err);
}
