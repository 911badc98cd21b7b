// play: applies the recorded inputs again to a daemon that serves the same plant, in lockstep from
// rest, and compares the outputs.
//
// The recorded inputs are those that acted on the plant: after all channels were summed, and after
// the electronics of an input. A plant whose inputs have electronics would put them through these
// once more; that, a controller hosted in the daemon, and whoever else moves an input, is found by
// comparing the inputs of each sample as well: they must be the recorded ones.
#include <stdlib.h>
#include <string.h>

#include "base/json.h"
#include "interrupt.h"
#include "progress.h"
#include "replay.h"
#include "session.h"

typedef struct player {
  const replay_run *run;
  replay_deviation deviation;
  uint64_t next;       // step expected
  bool skipped;        // another step came
  uint64_t disturbed;  // samples whose inputs are not the recorded ones
  pb_progress progress;
} player;

static bool on_sample(void *context, const pb_sample *sample, double *command) {
  player *p = context;
  const replay_run *run = p->run;
  if (sample->step != p->next) {
    p->skipped = true;
    return false;
  }
  const double *held = run->u + sample->step * run->nu;
  p->disturbed += memcmp(sample->input, held, run->nu * sizeof *held) != 0;
  replay_compare(&p->deviation, run, sample->step, sample->output);
  if (++p->next == run->steps) return false;
  memcpy(command, run->u + p->next * run->nu, run->nu * sizeof *command);
  return true;
}

static void show(void *context, uint64_t samples) {
  player *p = context;
  pb_progress_update(&p->progress, (double)samples, (double)p->run->steps, NULL);
}

// ---- the plant ----------------------------------------------------------------------------------

static pb_status alone_check(pb_session *session, pb_error *err) {
  char *result = NULL;
  cJSON *json = NULL;
  pb_status status = pb_session_request(session, "ping", NULL, 0, &result, err);
  if (!status) status = pb_json_parse(result, strlen(result), &json, err);
  if (!status) {
    const cJSON *members = pb_json_member(json, "members");
    if (cJSON_IsNumber(members) && members->valuedouble > 0)
      status = pb_fail(err, PB_ERR_STATE, pb_session_description(session)->name,
                       "other clients are attached: their inputs would be added");
  }
  cJSON_Delete(json);
  free(result);
  return status;
}

// The same plant file, so the same signals in the same order.
static pb_status plant_check(pb_session *session, const replay_run *run, pb_error *err) {
  const pb_description *d = pb_session_description(session);
  const pb_model *m = pb_session_model(session);
  if (strcmp(d->plant_sha256, run->revision->sha256) != 0)
    return pb_fail(err, PB_ERR_STATE, d->name,
                   "the daemon serves another plant file than the one recorded (SHA-256 %.12s…, "
                   "recorded %.12s…)",
                   d->plant_sha256, run->revision->sha256);
  if (m->nu != run->nu || m->ny != run->ny)
    return pb_fail(err, PB_ERR_STATE, d->name, "its signals are not those recorded");
  return alone_check(session, err);
}

static pb_status mode_set(pb_session *session, pb_run_mode mode, double speed, pb_error *err) {
  static const char *const name[] = {"paused", "lockstep", "realtime"};
  char body[96];
  if (mode == PB_REALTIME)
    snprintf(body, sizeof body, "{\"mode\":\"realtime\",\"speed\":%.17g}", speed);
  else
    snprintf(body, sizeof body, "{\"mode\":\"%s\"}", name[mode]);
  return pb_session_request(session, "set_mode", body, 0, NULL, err);
}

static pb_status attach(pb_session *session, pb_error *err) {
  const pb_model *m = pb_session_model(session);
  const char *name[plantbus_MAX_INPUTS];
  for (size_t i = 0; i < m->nu; i++) name[i] = m->input[i].name;
  const pb_attach_options options = {
      .channel = "replay", .inputs = name, .input_count = (uint32_t)m->nu, .barrier = true};
  return pb_session_attach(session, &options, err);
}

static pb_status play(pb_session *session, player *p, pb_error *err) {
  const pb_run_options run = {.on_sample = on_sample,
                              .context = p,
                              .stall = 10,
                              .interrupted = pb_interrupted,
                              .progress = show};
  pb_progress_begin(&p->progress, stderr, "replay");
  pb_status status = pb_session_request(session, "reset", NULL, 0, NULL, err);
  if (!status) status = attach(session, err);
  if (!status) status = pb_session_run(session, &run, NULL, err);
  pb_session_detach(session);
  pb_progress_end(&p->progress);
  if (!status && p->skipped)
    return pb_fail(err, PB_ERR_STATE, pb_session_description(session)->name,
                   "step %llu did not come: it was stepped by another, or is decimated",
                   (unsigned long long)p->next);
  return status;
}

static pb_status inputs_check(const player *p, pb_error *err) {
  if (p->disturbed == 0) return PB_OK;
  return pb_fail(err, PB_ERR_STATE, "inputs",
                 "in %llu samples the inputs that acted are not the recorded ones: inputs with "
                 "electronics, a controller hosted in the daemon, or another client",
                 (unsigned long long)p->disturbed);
}

pb_status command_play(const replay_options *o, const pb_recording *r, pb_error *err) {
  replay_run run;
  pb_session *session = NULL;
  pb_status status = replay_load(r, o->choice.epoch, &run, err);
  if (status) return status;
  player p = {.run = &run};
  pb_session_options where = pb_common_session(&o->common);
  if (!where.plant) where.plant = r->plant;
  status = pb_session_open(&where, &session, err);
  if (!status) status = plant_check(session, &run, err);
  if (!status) {
    const pb_run_mode mode = pb_session_description(session)->mode;
    const double speed = pb_session_description(session)->speed;
    if (mode != PB_LOCKSTEP) status = mode_set(session, PB_LOCKSTEP, 1.0, err);
    if (!status) status = play(session, &p, err);
    pb_error later;
    if (mode != PB_LOCKSTEP && mode_set(session, mode, speed, &later) && !status)
      status = later.code, *err = later;
  }
  if (!status) status = inputs_check(&p, err);
  if (!status) status = replay_present(o, &run, &p.deviation, err);
  pb_session_close(session);
  replay_free(&run);
  return status;
}
