// plantbus-identify: measures the frequency responses of a plant that a daemon runs, and compares
// them with the model that the daemon publishes.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "identify.h"
#include "interrupt.h"
#include "outfile.h"

enum {
  KEY_INPUT = 0x100,
  KEY_OUTPUT,
  KEY_TARGET,
  KEY_MOST,
  KEY_SAVE,
  KEY_BLOCKS,
};

static const struct argp_option option_table[] = {
    {"blocks", KEY_BLOCKS, "STEPS", OPTION_ARG_OPTIONAL,
     "Send and receive so many steps at a time (default 1000) instead of one: for a plant that "
     "nobody else steps",
     2},
    {"save-samples", KEY_SAVE, "FILE", 0,
     "Write the raw samples: step (uint64), inputs, outputs (double), a record a step", 1},
    {"input", KEY_INPUT, "NAMES", 0, "Inputs to excite, comma-separated or repeated (default: all)",
     2},
    {"output", KEY_OUTPUT, "NAMES", 0, "Outputs to measure (default: all)", 2},
    {"coherence-target", KEY_TARGET, "C", 0,
     "Go on averaging until 95 % of the lines of every output have this coherence", 3},
    {"most-averages", KEY_MOST, "N", 0,
     "… but no longer than N averages (default: 16 times --averages)", 3},
    {0},
};

static const char description[] =
    "Identifies a plant on the bus and compares it with its published model.\v"
    "Defaults: a multisine of 1 … 1000 Hz (0.4 of the sample rate if that is less) every 0.5 Hz, "
    "two "
    "periods a stage; noise: every 0.1 Hz, ten segments. The decay that the start sets off is "
    "fitted "
    "to the difference of two periods and taken out; with --coherence-target, in real time and "
    "with an "
    "explicit --settle the experiment waits for it instead.\n\n"
    "Exit codes: 0 done, 1 failed, 2 wrong command line.\n\n"
    "Examples:\n"
    "  plantbus-identify --input Va --output Vs,y --band 1,500 --plot --output-dir out\n"
    "  plantbus-identify --excitation noise --averages 20 --json\n";

static error_t parse(int key, char *text, struct argp_state *state) {
  identify_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->common;
    state->child_inputs[1] = &o->excite;
    state->child_inputs[2] = &o->result;
    break;
  case KEY_SAVE:
    o->samples = text;
    break;
  case KEY_BLOCKS:
    o->block = text ? (uint32_t)pb_option_uint64(state, "--blocks", text, 1, 65536) : 1000;
    break;
  case KEY_INPUT:
    pb_option_names(state, "--input", text, &o->inputs);
    break;
  case KEY_OUTPUT:
    pb_option_names(state, "--output", text, &o->outputs);
    break;
  case KEY_TARGET:
    o->coherence_target = pb_option_double(state, "--coherence-target", text, 0, 0.999999999);
    break;
  case KEY_MOST:
    o->most_averages = (size_t)pb_option_uint64(state, "--most-averages", text, 1, 100000);
    break;
  case ARGP_KEY_ARG:
    argp_error(state, "unexpected argument '%s'", text);
    break;
  default:
    return ARGP_ERR_UNKNOWN;
  }
  return 0;
}

// ---- one identification -------------------------------------------------------------------------

// Seconds to wait at the start of a stage. The decay of modes in the band is removed afterwards
// where that is possible; what lies above has to die down by itself, which is quick.
static pb_status choose_settling(const identify_options *o, const pb_bench *bench,
                                 pb_experiment_options *e, pb_error *err) {
  bool removable = e->excitation != PB_EXCITE_NOISE && !bench->realtime && o->coherence_target == 0;
  if (o->excite.settle_given) return PB_OK;
  pb_status status = pb_settle_seconds(bench->model, e->f1, e->f2, removable, &e->settle, err);
  if (e->excitation == PB_EXCITE_NOISE && !e->one_at_a_time) e->settle = 0;
  return status;
}

static pb_status fill_defaults(const identify_options *o, const pb_bench *bench,
                               pb_experiment_options *e, pb_error *err) {
  *e = o->excite.experiment;
  bool noise = e->excitation == PB_EXCITE_NOISE;
  if (e->rms == 0) e->rms = 1;
  if (e->f2 == 0) {
    e->f1 = 1;
    e->f2 = fmin(1000, 0.4 * bench->model->sample_rate);
  }
  if (e->resolution == 0) e->resolution = noise ? 0.1 : 0.5;
  if (e->averages == 0) e->averages = noise ? 10 : 2;
  return choose_settling(o, bench, e, err);
}

// The share of an output's lines that have the coherence aimed at, smallest over the outputs.
static double reached(const pb_frf *frf, double target) {
  double smallest = 1;
  for (size_t o = 0; o < frf->ny; o++) {
    size_t good = 0;
    for (size_t f = 0; f < frf->nf; f++) good += frf->coherence[f * frf->ny + o] >= target;
    smallest = fmin(smallest, (double)good / (double)frf->nf);
  }
  return smallest;
}

static void add_report(pb_run_report *sum, const pb_run_report *one) {
  sum->samples += one->samples;
  sum->missed += one->missed;
  sum->seconds += one->seconds;
}

// Rounds until the target is met or the averages are used up; the estimate is left in *frf.
static pb_status run_rounds(const identify_options *o, pb_bench *bench, pb_experiment *experiment,
                            identify_result *result, pb_frf *frf, pb_error *err) {
  size_t most = o->most_averages ? o->most_averages : 16 * result->experiment.averages;
  for (;;) {
    pb_run_report report = {0};
    pb_status status = pb_bench_run(bench, experiment, "identify", &report, err);
    add_report(&result->report, &report);
    result->rounds++;
    pb_frf_clear(frf);
    if (status == PB_OK) status = pb_experiment_estimate(experiment, frf, err);
    if (status != PB_OK) return status;
    size_t next = (result->rounds + 1) * result->experiment.averages;
    if (o->coherence_target == 0 || reached(frf, o->coherence_target) >= 0.95) return PB_OK;
    if (next > most) {
      fprintf(stderr, "%s: warning: the coherence target of %g is not reached after %zu averages\n",
              program_invocation_short_name, o->coherence_target,
              result->rounds * result->experiment.averages);
      return PB_OK;
    }
  }
}

// Whole or not at all: what a broken-off experiment leaves is no record.
static pb_status close_samples(pb_outfile *samples, pb_status status, pb_error *err) {
  if (status == PB_OK && samples->stream) return pb_outfile_close(samples, err);
  pb_outfile_discard(samples);
  return status;
}

static pb_status measure(const identify_options *o, pb_bench *bench,
                         const pb_experiment_channels *channels, identify_result *result,
                         pb_experiment **experiment, pb_error *err) {
  pb_outfile samples = {0};
  pb_frf frf = {0};
  pb_status status = fill_defaults(o, bench, &result->experiment, err);
  if (status == PB_OK) {
    status = pb_experiment_new(bench->model, channels, NULL, &result->experiment, bench->realtime,
                               experiment, err);
  }
  if (status == PB_OK && o->samples) status = pb_outfile_open(o->samples, &samples, err);
  if (status == PB_OK) {
    pb_experiment_save_to(*experiment, samples.stream);
    status = pb_experiment_begin(*experiment, err);
  }
  // Between rounds it estimates and draws new signals while lockstep waits.
  double guard = o->coherence_target > 0 ? 20 : 0;
  if (status == PB_OK) {
    status = pb_bench_attach(bench, "identify", channels->input, channels->inputs, guard, err);
  }
  if (status == PB_OK) status = run_rounds(o, bench, *experiment, result, &frf, err);
  pb_bench_detach(bench);
  status = close_samples(&samples, status, err);
  if (status == PB_OK) {
    double floor = result->experiment.excitation == PB_EXCITE_NOISE ? 1e-3 : 1e-6;
    status = pb_analyse(bench->model, channels, &frf, floor, &result->analysis, err);
  }
  pb_frf_clear(&frf);
  return status;
}

static pb_status present(const pb_result_options *o, const identify_result *result, pb_error *err) {
  pb_status status = o->json ? identify_print_json(result, err) : identify_print(result, err);
  if (status == PB_OK && o->dir) status = identify_save(result, o->dir, err);
  if (status == PB_OK && o->plot) status = identify_plot(result, pb_result_dir(o), err);
  return status;
}

static pb_status identify(const identify_options *o, pb_error *err) {
  pb_bench bench = {0};
  size_t *input = NULL, *output = NULL;
  pb_experiment_channels channels = {0};
  pb_experiment *experiment = NULL;
  pb_status status = pb_result_check(&o->result, err);
  if (status == PB_OK) status = pb_bench_open(&o->common, o->excite.reset, &bench, err);
  if (status != PB_OK) return status;
  bench.block = o->block;
  if (o->block > 0 && bench.realtime)
    status = pb_fail(err, PB_ERR_STATE, "--blocks", "the plant runs in real time");
  identify_result result = {.bench = &bench, .options = o};
  if (status == PB_OK) {
    status = pb_bench_choose(&o->inputs, bench.model->input, bench.model->nu, "input", &input,
                             &channels.inputs, err);
  }
  if (status == PB_OK) {
    status = pb_bench_choose(&o->outputs, bench.model->output, bench.model->ny, "output", &output,
                             &channels.outputs, err);
  }
  channels.input = input;
  channels.output = output;
  if (status == PB_OK) status = measure(o, &bench, &channels, &result, &experiment, err);
  if (experiment) pb_bench_tell_trouble(experiment);
  if (status == PB_OK) {
    result.trouble = pb_experiment_trouble_of(experiment);
    status = present(&o->result, &result, err);
  }
  pb_analysis_clear(&result.analysis);
  pb_experiment_free(experiment);
  pb_bench_close(&bench);
  free(input);
  free(output);
  return status;
}

int main(int argc, char **argv) {
  static const struct argp_child children[] = {{&pb_common_argp, 0, NULL, 0},
                                               {&pb_excite_argp, 0, "Excitation:", 9},
                                               {&pb_result_argp, 0, NULL, 0},
                                               {0}};
  static const struct argp argp = {option_table, parse, NULL, description, children, NULL, NULL};
  identify_options options = {
      .result = {.files_help = "Write identify.csv and identify.mat into DIR",
                 .plot_help = "Draw Bode and coherence plots (PNG) into DIR, or here"}};
  pb_error err = {0};
  pb_excite_options_default(&options.excite);
  pb_options_parse(&argp, argc, argv, &options);
  pb_interrupt_install();
  pb_status status = identify(&options, &err);
  pb_name_list_free(&options.inputs);
  pb_name_list_free(&options.outputs);
  return pb_result_end(status, &err);
}
