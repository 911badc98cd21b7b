// Finding, resetting, attaching and watching a plant: see bench.h.
#include "bench.h"

#include <stdlib.h>
#include <string.h>

#include "base/json.h"
#include "interrupt.h"

// Whether anyone else is attached.
static pb_status others_attached(pb_session *session, bool *others, pb_error *err) {
  char *result = NULL;
  cJSON *json = NULL;
  *others = false;
  pb_status status = pb_session_request(session, "ping", NULL, 0, &result, err);
  if (status == PB_OK) status = pb_json_parse(result, strlen(result), &json, err);
  if (status == PB_OK) {
    const cJSON *members = pb_json_member(json, "members");
    *others = cJSON_IsNumber(members) && members->valuedouble > 0;
  }
  cJSON_Delete(json);
  free(result);
  return status;
}

static pb_status maybe_reset(pb_bench *b, pb_reset_choice choice, pb_error *err) {
  bool wanted = choice == PB_RESET_ALWAYS;
  pb_status status = PB_OK;
  if (choice == PB_RESET_AUTO && !b->realtime) {
    bool others;
    status = others_attached(b->session, &others, err);
    wanted = !others;
  }
  if (status == PB_OK && wanted) {
    status = pb_session_request(b->session, "reset", NULL, 0, NULL, err);
    b->was_reset = status == PB_OK;
  }
  return status;
}

pb_status pb_bench_open(const pb_common_options *common, pb_reset_choice reset, pb_bench *out,
                        pb_error *err) {
  *out = (pb_bench){0};
  pb_session_options options = pb_common_session(common);
  options.history = 1000;
  pb_status status = pb_session_open(&options, &out->session, err);
  if (status != PB_OK) return status;
  out->model = pb_session_model(out->session);
  out->description = pb_session_description(out->session);
  out->realtime = out->description->mode == PB_REALTIME;
  status = maybe_reset(out, reset, err);
  if (status != PB_OK) pb_bench_close(out);
  return status;
}

void pb_bench_close(pb_bench *bench) {
  pb_session_close(bench->session);
  *bench = (pb_bench){0};
}

pb_status pb_bench_attach(pb_bench *b, const char *channel, const size_t *input, size_t inputs,
                          double guard, pb_error *err) {
  if (b->block > 0) return PB_OK;
  if (b->description->mode == PB_PAUSED)
    return pb_fail(err, PB_ERR_STATE, b->description->name, "the plant is paused");
  const char **name = malloc(inputs * sizeof *name);
  if (!name) return pb_fail_memory(err, channel);
  for (size_t i = 0; i < inputs; i++) name[i] = b->model->input[input[i]].name;
  pb_attach_options options = {.channel = channel,
                               .inputs = name,
                               .input_count = (uint32_t)inputs,
                               .barrier = !b->realtime,
                               .silence = "zero",
                               .guard = guard};
  pb_status status = pb_session_attach(b->session, &options, err);
  free(name);
  return status;
}

void pb_bench_detach(pb_bench *bench) {
  pb_session_detach(bench->session);
}

typedef struct watcher {
  pb_progress progress;
  double total;
} watcher;

static void show(void *context, uint64_t samples) {
  watcher *w = context;
  pb_progress_update(&w->progress, (double)samples, w->total, NULL);
}

pb_status pb_bench_run(pb_bench *bench, pb_experiment *experiment, const char *label,
                       pb_run_report *report, pb_error *err) {
  watcher w = {.total = (double)pb_experiment_round_steps(experiment)};
  pb_progress_begin(&w.progress, stderr, label);
  pb_experiment_watch watch = {pb_interrupted, show, &w};
  pb_status status =
      bench->block > 0
          ? pb_experiment_run_blocks(experiment, bench->session, bench->block, &watch, report, err)
          : pb_experiment_run(experiment, bench->session, &watch, report, err);
  pb_progress_end(&w.progress);
  return status;
}

static void tell(const char *what, uint64_t count) {
  if (count == 0) return;
  fprintf(stderr, "%s: warning: %llu %s\n", program_invocation_short_name,
          (unsigned long long)count, what);
}

void pb_bench_tell_trouble(const pb_experiment *experiment) {
  const pb_experiment_trouble *t = pb_experiment_trouble_of(experiment);
  tell("steps were not seen; the periods or segments they fell in are not used", t->gaps);
  tell("commands acted later than one step", t->late);
  for (unsigned bit = 0; bit < PB_FLAG_BITS; bit++) tell(pb_flag_text(bit), t->flag[bit]);
  tell("steps at which another client moved an input that is not driven here", t->disturbed);
}

pb_status pb_bench_choose(const pb_name_list *names, const pb_signal *signal, size_t count,
                          const char *kind, size_t **index, size_t *chosen, pb_error *err) {
  *chosen = names->count > 0 ? names->count : count;
  *index = malloc((*chosen + 1) * sizeof **index);
  if (!*index) return pb_fail_memory(err, kind);
  pb_status status = PB_OK;
  for (size_t k = 0; k < *chosen && status == PB_OK; k++) {
    (*index)[k] = k;
    if (names->count == 0) continue;
    status = pb_signal_find(signal, count, kind, names->name[k], names->name[k], &(*index)[k], err);
    for (size_t j = 0; j < k && status == PB_OK; j++) {
      if ((*index)[j] != (*index)[k]) continue;
      status = pb_fail(err, PB_ERR_ARGUMENT, names->name[k], "this %s is named twice", kind);
    }
  }
  if (status != PB_OK) {
    free(*index);
    *index = NULL;
    *chosen = 0;
  }
  return status;
}
