// plantbus-control hac: the design and what it is worth.
#include <stdio.h>

#include "control_tool.h"

static const char description[] =
    "Designs a high authority controller around the plant that IFF damps, and judges it.\v"
    "Each loop is a lead, an integrator and a low-pass, with a gain that reaches one at the "
    "bandwidth and does not exceed it beyond, on the damped plant as it is sampled. Stability is "
    "that of the sampled closed loop's poles; with "
    "an unstable one nothing is exported and the exit code is 1.\n\n"
    "Exit codes: 0 done, 1 failed or unstable, 2 wrong command line.\n\n"
    "Examples:\n"
    "  plantbus-control hac nano-hexapod.json --bandwidth 100 --plot --output-dir out\n"
    "  plantbus-control hac nano-hexapod.json --frame cartesian --bandwidth 60 --lead 4\n"
    "  plantbus-control hac --live --bandwidth 100 --json\n";

static error_t parse(int key, char *text, struct argp_state *state) {
  (void)text;
  control_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = o;
    state->child_inputs[1] = &o->source;
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

static pb_status present(const control_design *d, const control_judgement *j, pb_error *err) {
  const pb_result_options *o = &d->options->iff.result;
  pb_status status = o->json ? control_print_json(d, j, err) : control_print(d, j, err);
  if (status == PB_OK && o->dir) status = control_save(d, j, o->dir, err);
  if (status == PB_OK && o->plot) status = control_plot(d, j, pb_result_dir(o), err);
  if (status == PB_OK && !d->stable && !d->options->iff.force) {
    status = pb_fail(err, PB_ERR_STATE, "--bandwidth", "with %g Hz the closed loop is unstable",
                     d->shape.bandwidth_hz);
  }
  return status;
}

static pb_status design(const control_options *o, pb_error *err) {
  control_plant plant;
  control_design d = {0};
  control_judgement j = {0};
  pb_status status = pb_result_check(&o->iff.result, err);
  if (status == PB_OK) status = control_plant_open(o->source.file, &o->iff, &plant, err);
  if (status != PB_OK) return status;
  status = control_design_make(o, &plant, &d, err);
  if (status == PB_OK) status = control_judge(&d, &j, err);
  if (status == PB_OK) status = present(&d, &j, err);
  control_judgement_clear(&j);
  control_design_clear(&d);
  control_plant_close(&plant);
  return status;
}

int command_hac(int argc, char **argv) {
  static const struct argp_child children[] = {
      {&control_argp, 0, NULL, 0}, {&control_source_argp, 0, NULL, 0}, {0}};
  static const struct argp argp = {NULL, parse, "[PLANT]", description, children, NULL, NULL};
  control_options options;
  pb_error err = {0};
  control_options_default(&options);
  options.iff.excite.reset = PB_RESET_NEVER;
  pb_options_parse(&argp, argc, argv, &options);
  pb_status status = design(&options, &err);
  control_options_free(&options);
  return pb_result_end(status, &err);
}
