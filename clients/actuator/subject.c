// FILE or --live, and where results go: see actuator.h.
#include "actuator.h"

static const struct argp_child children[] = {{&pb_result_argp, 0, NULL, 0},
                                             {&source_argp, 0, NULL, 0},
                                             {&live_argp, 0, "On a running plant:", 8},
                                             {0}};

static void check(const subject_options *o, struct argp_state *state) {
  const bool file = o->source.file != NULL, live = o->live.live;
  if (file + live + o->other != 1) argp_error(state, "%s", o->wanted);
  if (live && o->source.layout_given)
    argp_error(state, "--live: the plant says itself how its element is used");
  if (live && o->live.excite.experiment.excitation == PB_EXCITE_NOISE)
    argp_error(state, "--excitation: noise leaks around a sharp zero: take multisine, "
                      "periodic-noise or chirp");
}

static error_t parse(int key, char *text, struct argp_state *state) {
  subject_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->result;
    state->child_inputs[1] = &o->source;
    state->child_inputs[2] = &o->live;
    return 0;
  case ARGP_KEY_ARG:
    if (o->source.file) argp_error(state, "unexpected argument '%s'", text);
    o->source.file = text;
    return 0;
  case ARGP_KEY_END:
    check(o, state);
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

const struct argp subject_argp = {NULL, parse, NULL, NULL, children, NULL, NULL};

void subject_defaults(subject_options *o) {
  *o = (subject_options){
      .wanted = "which actuator? Give one of: an element (.mat), a plant file, --live"};
  source_defaults(&o->source);
  live_defaults(&o->live);
}
