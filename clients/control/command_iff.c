// plantbus-control iff: the best gain and the damped plant, from a file or measured on the bus.
#include <stdio.h>

#include "control_tool.h"
#include "interrupt.h"

typedef struct iff_command {
  iff_options iff;
  control_source source;
} iff_command;

static const char description[] =
    "Finds the gain of decentralised IFF that gives the modes of the band their largest smallest "
    "damping, and tells the damped plant.\v"
    "From a plant file it is predicted; with --live the loops are closed on the bus and both the "
    "undamped and the damped plant are measured, beside the prediction. With -o the controller is "
    "written too, as the body of a host_controller request.\n\n"
    "Exit codes: 0 done, 1 failed, 2 wrong command line.\n\n"
    "Examples:\n"
    "  plantbus-control iff nano-hexapod.json --plot --output-dir out\n"
    "  plantbus-control iff --live --band 5,250\n";

static error_t parse(int key, char *text, struct argp_state *state) {
  (void)text;
  iff_command *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->iff;
    state->child_inputs[1] = &o->source;
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

static pb_status damp(const iff_command *o, pb_error *err) {
  control_plant plant;
  iff_result result = {0};
  const pb_result_options *files = &o->iff.result;
  pb_status status = pb_result_check(files, err);
  if (status == PB_OK) status = control_plant_open(o->source.file, &o->iff, &plant, err);
  if (status != PB_OK) return status;
  status = iff_prepare(&o->iff, &plant.bench, &result, err);
  if (status == PB_OK && o->source.live) status = iff_measure(&result, &plant.bench, err);
  if (status == PB_OK) status = iff_present(&result, err);
  if (status == PB_OK && (files->dir || files->plot)) status = control_damped_plant(&result, err);
  if (status == PB_OK && files->dir) status = control_export(&result, NULL, files->dir, err);
  iff_result_clear(&result);
  control_plant_close(&plant);
  return status;
}

int command_iff(int argc, char **argv) {
  static const struct argp_child children[] = {
      {&iff_argp, 0, NULL, 0}, {&control_source_argp, 0, NULL, 0}, {0}};
  static const struct argp argp = {NULL, parse, "[PLANT]", description, children, NULL, NULL};
  iff_command options = {0};
  pb_error err = {0};
  iff_options_default(&options.iff);
  options.iff.result.files_help =
      "Write iff.mat, CSV files, the predicted plant and the controller (JSON) into DIR";
  pb_options_parse(&argp, argc, argv, &options);
  pb_interrupt_install();
  pb_status status = damp(&options, &err);
  iff_options_free(&options.iff);
  return pb_result_end(status, &err);
}
