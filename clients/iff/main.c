// plantbus-iff: closes integral force feedback around a plant that a daemon runs, measures the
// damped plant, and compares it with what the published model predicts for the sampled loop.
#include <stdio.h>

#include "iff_tool.h"
#include "interrupt.h"

static const char description[] =
    "Damps a plant on the bus by integral force feedback and measures the result.\v"
    "The excitation is added to the controller's command: u = w + K y. Its band is also the band "
    "of the "
    "modes that are looked at, by default 1 … 500 Hz (0.4 of the sample rate if that is less).\n\n"
    "Exit codes: 0 done, 1 failed, 2 wrong command line.\n\n"
    "Examples:\n"
    "  plantbus-iff --plot --output-dir out\n"
    "  plantbus-iff --gain 400 --strut 1 --band 5,200\n";

static pb_status damp(const iff_options *o, pb_error *err) {
  pb_bench bench = {0};
  iff_result result = {0};
  pb_status status = pb_result_check(&o->result, err);
  if (status == PB_OK) status = pb_bench_open(&o->common, o->excite.reset, &bench, err);
  if (status != PB_OK) return status;
  status = iff_prepare(o, &bench, &result, err);
  if (status == PB_OK) status = iff_measure(&result, &bench, err);
  if (status == PB_OK) status = iff_present(&result, err);
  iff_result_clear(&result);
  pb_bench_close(&bench);
  return status;
}

int main(int argc, char **argv) {
  struct argp argp = iff_argp;
  argp.doc = description;
  iff_options options;
  pb_error err = {0};
  iff_options_default(&options);
  pb_options_parse(&argp, argc, argv, &options);
  pb_interrupt_install();
  pb_status status = damp(&options, &err);
  iff_options_free(&options);
  return pb_result_end(status, &err);
}
