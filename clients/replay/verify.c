// verify: runs the compiled model that the recording carries on the recorded inputs, without a
// daemon, and compares the outputs.
#include <stdlib.h>

#include "../../server/fpenv.h"
#include "replay.h"

static pb_status model_make(const pb_recording *r, const pb_recorded_revision *v, pb_model **out,
                            pb_error *err) {
  *out = NULL;
  if (!v->packed) return pb_fail(err, PB_ERR_STATE, r->path, "holds no compiled model");
  pb_status status =
      pb_model_unpack(v->packed, v->packed_count, r->plant, (const char *const *)v->inputs.name,
                      (const char *const *)v->inputs.unit, (const char *const *)v->outputs.name,
                      (const char *const *)v->outputs.unit, out, err);
  if (status) return status;
  if ((*out)->nu == v->inputs.count && (*out)->ny == v->outputs.count) return PB_OK;
  pb_model_free(*out);
  *out = NULL;
  return pb_fail(err, PB_ERR_SYNTAX, r->path, "its model does not fit its signals");
}

// Sample k + 1 tells the input held over [k, k + 1). As the daemon steps: denormals are zero.
static pb_status run_again(const pb_model *model, const replay_run *run, replay_deviation *d,
                           pb_error *err) {
  pb_state *state = pb_state_new(model);
  if (!state) return pb_fail_memory(err, "state");
  double y[plantbus_MAX_OUTPUTS];
  const uint64_t saved = pb_flush_denormals();
  for (uint64_t k = 0; k < run->steps; k++) {
    pb_step_output(model, state, y);
    replay_compare(d, run, k, y);
    if (k + 1 < run->steps) pb_step_advance(model, state, run->u + (k + 1) * run->nu);
  }
  pb_restore_denormals(saved);
  free(state);
  return PB_OK;
}

pb_status command_verify(const replay_options *o, const pb_recording *r, pb_error *err) {
  replay_run run;
  replay_deviation d = {0};
  pb_model *model = NULL;
  pb_status status = replay_load(r, o->choice.epoch, &run, err);
  if (!status) status = model_make(r, run.revision, &model, err);
  if (!status) status = run_again(model, &run, &d, err);
  if (!status) status = replay_present(o, &run, &d, err);
  pb_model_free(model);
  replay_free(&run);
  return status;
}
