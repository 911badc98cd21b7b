// One epoch of a recording, loaded to be run again, and how far a second run is from it.
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "jsonout.h"
#include "replay.h"
#include "table.h"

static pb_status span_check(const pb_span *s, uint32_t epoch, pb_error *err) {
  char name[32];
  snprintf(name, sizeof name, "epoch %u", s ? s->epoch : epoch);
  if (!s) return pb_fail(err, PB_ERR_REFERENCE, name, "is not in the recording");
  if (s->first_step != 0)
    return pb_fail(err, PB_ERR_STATE, name, "is recorded from step %llu on, not from rest",
                   (unsigned long long)s->first_step);
  if (s->gaps > 0)
    return pb_fail(err, PB_ERR_STATE, name, "has gaps: %llu samples are missing",
                   (unsigned long long)s->missing);
  if (s->decimated)
    return pb_fail(err, PB_ERR_STATE, name, "was decimated: the inputs between are not known");
  if (s->first_revision != s->last_revision)
    return pb_fail(err, PB_ERR_STATE, name, "changes from revision %u to %u", s->first_revision,
                   s->last_revision);
  return PB_OK;
}

// Of that number; 0: the first that is whole, or the first where none is.
static const pb_span *span_find(const pb_recording *r, uint32_t epoch) {
  pb_error ignored;
  for (size_t i = 0; i < r->spans.count; i++) {
    const pb_span *s = &r->spans.span[i];
    if (epoch == 0 ? !span_check(s, epoch, &ignored) : s->epoch == epoch) return s;
  }
  return epoch == 0 && r->spans.count > 0 ? &r->spans.span[0] : NULL;
}

// Which one was taken, when that was not said.
static void tell_choice(const pb_recording *r, const pb_span *s) {
  if (r->spans.count < 2) return;
  fprintf(stderr, "%s: epoch %u of the %zu recorded, the first that is whole\n",
          program_invocation_short_name, s->epoch, r->spans.count);
}

static pb_status sample_load(void *context, const plantbus_Sample *x, pb_error *err) {
  replay_run *run = context;
  if (x->epoch != run->epoch) return PB_OK;
  if (x->step >= run->steps || x->input_count != run->nu || x->output_count != run->ny)
    return pb_fail(err, PB_ERR_SYNTAX, "sample", "does not fit its revision");
  memcpy(run->u + x->step * run->nu, x->input, run->nu * sizeof *run->u);
  memcpy(run->y + x->step * run->ny, x->output, run->ny * sizeof *run->y);
  return PB_OK;
}

pb_status replay_load(const pb_recording *r, uint32_t epoch, replay_run *out, pb_error *err) {
  replay_run run = {0};
  *out = run;
  const pb_span *s = span_find(r, epoch);
  pb_status status = span_check(s, epoch, err);
  if (status) return status;
  if (epoch == 0) tell_choice(r, s);
  run.epoch = s->epoch;
  run.steps = s->last_step + 1;
  run.revision = pb_recording_revision(r, s->first_revision);
  if (!run.revision)
    return pb_fail(err, PB_ERR_STATE, r->path, "does not describe revision %u", s->first_revision);
  run.nu = run.revision->inputs.count;
  run.ny = run.revision->outputs.count;
  run.u = calloc(run.steps, (run.nu + 1) * sizeof *run.u);
  run.y = calloc(run.steps, (run.ny + 1) * sizeof *run.y);
  if (!run.u || !run.y) status = pb_fail_memory(err, r->path);
  if (!status) status = pb_recording_samples(r, sample_load, &run, err);
  if (status)
    replay_free(&run);
  else
    *out = run;
  return status;
}

void replay_free(replay_run *run) {
  free(run->u);
  free(run->y);
  *run = (replay_run){0};
}

// ---- comparison ---------------------------------------------------------------------------------

void replay_compare(replay_deviation *d, const replay_run *run, uint64_t step, const double *y) {
  const double *recorded = run->y + step * run->ny;
  d->samples++;
  d->different += memcmp(recorded, y, run->ny * sizeof *y) != 0;
  for (size_t i = 0; i < run->ny; i++) {
    const double deviation = fabs(y[i] - recorded[i]);
    if (fabs(recorded[i]) > d->value[i]) d->value[i] = fabs(recorded[i]);
    // Written so that one that is not a number is kept.
    if (memcmp(&y[i], &recorded[i], sizeof *y) == 0 || deviation <= d->largest[i]) continue;
    d->largest[i] = deviation;
    d->at[i] = step;
  }
}

static pb_status print_table(const replay_run *run, const replay_deviation *d, pb_error *err) {
  pb_table table = {0};
  pb_table_text_column(&table, "output");
  pb_table_text_column(&table, "unit");
  pb_table_number_column(&table, "largest value", NULL, 6);
  pb_table_number_column(&table, "deviation", NULL, 3);
  pb_table_number_column(&table, "at step", NULL, 6);
  for (size_t i = 0; i < run->ny; i++) {
    pb_table_text(&table, run->revision->outputs.name[i]);
    pb_table_text(&table, run->revision->outputs.unit[i]);
    pb_table_number(&table, d->value[i]);
    pb_table_number(&table, d->largest[i]);
    pb_table_count(&table, d->at[i]);
  }
  const pb_status status = pb_table_print(&table, stdout, 0, err);
  pb_table_free(&table);
  if (status) return status;
  if (d->different == 0)
    printf("%llu samples: identical to the bit\n", (unsigned long long)d->samples);
  else
    printf("%llu of %llu samples differ\n", (unsigned long long)d->different,
           (unsigned long long)d->samples);
  return PB_OK;
}

static void print_json(const replay_run *run, const replay_deviation *d) {
  pb_jsonout json;
  pb_jsonout_begin(&json, stdout);
  pb_jsonout_object(&json, NULL);
  pb_jsonout_integer(&json, "epoch", run->epoch);
  pb_jsonout_integer(&json, "samples", d->samples);
  pb_jsonout_integer(&json, "different", d->different);
  pb_jsonout_boolean(&json, "identical", d->different == 0);
  pb_jsonout_array(&json, "outputs");
  for (size_t i = 0; i < run->ny; i++) {
    pb_jsonout_object(&json, NULL);
    pb_jsonout_text(&json, "name", run->revision->outputs.name[i]);
    pb_jsonout_text(&json, "unit", run->revision->outputs.unit[i]);
    pb_jsonout_number(&json, "largest_value", d->value[i]);
    pb_jsonout_number(&json, "deviation", d->largest[i]);
    pb_jsonout_integer(&json, "at_step", d->at[i]);
    pb_jsonout_object_end(&json);
  }
  pb_jsonout_array_end(&json);
  pb_jsonout_object_end(&json);
  pb_jsonout_end(&json);
}

pb_status replay_present(const replay_options *o, const replay_run *run, const replay_deviation *d,
                         pb_error *err) {
  pb_status status = PB_OK;
  if (o->json)
    print_json(run, d);
  else
    status = print_table(run, d, err);
  for (size_t i = 0; i < run->ny && !status && o->tolerance >= 0.0; i++)
    if (!(d->largest[i] <= o->tolerance))
      status = pb_fail(err, PB_ERR_NUMERIC, run->revision->outputs.name[i],
                       "deviates by %.3g, more than %g", d->largest[i], o->tolerance);
  return status;
}
