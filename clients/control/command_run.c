// plantbus-control run: HAC-LAC around a plant on the bus, under a disturbance at the point of
// interest.
#include <stdio.h>
#include <stdlib.h>

#include "interrupt.h"
#include "run.h"

static const char description[] =
    "Disturbs a plant on the bus undamped, with IFF, and with HAC around it, and compares what is "
    "measured with what its published model predicts.\v"
    "IFF is hosted by the daemon on channel iff; HAC answers every sample from this client on "
    "channel hac, or is hosted too; the disturbance has a channel of its own. The channels add up "
    "on the actuators. Motions, responses, spectra and the sensitivity at the metrology are "
    "reported. The design is that of plantbus-control hac.\n\n"
    "Exit codes: 0 done, 1 failed or predicted to be unstable, 2 wrong command line.\n\n"
    "Examples:\n"
    "  plantbus-control run --bandwidth 100 --plot --output-dir out\n"
    "  plantbus-control run --bandwidth 60 --frame cartesian --disturbance Fx,Fz --rms 0.1\n";

static error_t parse(int key, char *text, struct argp_state *state) {
  control_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = o;
    return 0;
  case ARGP_KEY_ARG:
    argp_error(state, "unexpected argument '%s': run works on the plant of the bus", text);
    return 0;
  case ARGP_KEY_END:
    if (o->keep && !o->hosted) argp_error(state, "--keep is for --hosted controllers");
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

static pb_status check(const control_design *d, pb_error *err) {
  if (d->stable || d->options->iff.force) return PB_OK;
  char pole[96];
  pb_pole_format(d->worst, d->model->sample_rate, pole, sizeof pole);
  return pb_fail(err, PB_ERR_STATE, "--bandwidth",
                 "with %g Hz the closed loop is predicted to be unstable: a pole at %s (--force "
                 "closes it all the same)",
                 d->shape.bandwidth_hz, pole);
}

static pb_status choose_channels(run_result *r, pb_error *err) {
  const control_design *d = r->design;
  size_t ny = d->model->ny;
  r->output = malloc((ny + 1) * sizeof *r->output);
  if (!r->output) return pb_fail_memory(err, "outputs");
  for (size_t k = 0; k < ny; k++) r->output[k] = k;
  r->channels = (pb_experiment_channels){d->disturbance, r->output, d->disturbances, ny};
  return PB_OK;
}

static void tell(const char *stage, const char *what, uint64_t count) {
  if (count == 0) return;
  fprintf(stderr, "%s: warning: %s: %llu %s\n", program_invocation_short_name, stage,
          (unsigned long long)count, what);
}

static void tell_trouble(const run_result *r) {
  for (int k = 0; k < STAGES; k++) {
    const pb_experiment_trouble *t = &r->stage[k].trouble;
    tell(control_stage_name[k], "steps were not seen; what they fell in is not used", t->gaps);
    tell(control_stage_name[k], "commands acted later than one step", t->late);
    for (unsigned bit = 0; bit < PB_FLAG_BITS; bit++)
      tell(control_stage_name[k], pb_flag_text(bit), t->flag[bit]);
  }
}

static pb_status measure(run_result *r, pb_error *err) {
  pb_status status = choose_channels(r, err);
  for (int k = 0; k < STAGES && status == PB_OK; k++) {
    bool wanted = k == STAGE_HAC ||
                  (k == STAGE_IFF ? r->design->damped : !r->design->options->iff.skip_open_loop);
    if (wanted) status = run_stage_carry_out(r, (control_stage)k, err);
  }
  tell_trouble(r);
  return status == PB_OK ? run_sensitivity(r, err) : status;
}

static pb_status present(const run_result *r, pb_error *err) {
  const pb_result_options *o = &r->design->options->iff.result;
  pb_status status = o->json ? run_print_json(r, err) : run_print(r, err);
  if (status == PB_OK && o->dir) status = run_save(r, o->dir, err);
  if (status == PB_OK && o->plot) status = run_plot(r, pb_result_dir(o), err);
  return status;
}

static void result_clear(run_result *r) {
  for (int k = 0; k < STAGES; k++) {
    run_stage *s = &r->stage[k];
    iff_measurement_clear(&s->response);
    for (int i = 0; i < 2; i++) {
      free(s->density[i]);
      free(s->amplitude[i]);
    }
    free(s->largest);
  }
  for (int i = 0; i < 2; i++) free(r->sensitivity[i]);
  free(r->coherent);
  free(r->output);
}

static pb_status run(const control_options *o, pb_error *err) {
  control_plant plant;
  control_design d = {0};
  pb_status status = pb_result_check(&o->iff.result, err);
  if (status == PB_OK) status = control_plant_open(NULL, &o->iff, &plant, err);
  if (status != PB_OK) return status;
  run_result r = {.design = &d, .bench = &plant.bench};
  status = control_design_make(o, &plant, &d, err);
  if (status == PB_OK) status = check(&d, err);
  if (status == PB_OK) status = control_judge(&d, &r.judgement, err);
  if (status == PB_OK) {
    iff_experiment_defaults(&o->iff, d.model, &r.experiment);
    r.experiment.limit = o->iff.excite.experiment.limit;
    status = measure(&r, err);
  }
  if (status == PB_OK) status = present(&r, err);
  result_clear(&r);
  control_judgement_clear(&r.judgement);
  control_design_clear(&d);
  control_plant_close(&plant);
  return status;
}

int command_run(int argc, char **argv) {
  static const struct argp_child children[] = {{&control_argp, 0, NULL, 0}, {0}};
  static const struct argp argp = {NULL, parse, NULL, description, children, NULL, NULL};
  control_options options;
  pb_error err = {0};
  control_options_default(&options);
  pb_options_parse(&argp, argc, argv, &options);
  pb_interrupt_install();
  pb_status status = run(&options, &err);
  control_options_free(&options);
  return pb_result_end(status, &err);
}
