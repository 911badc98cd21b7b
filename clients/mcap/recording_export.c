// See recording_export.h.
#include "recording_export.h"

#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "matfile.h"

// The columns that were chosen, by their indices in a sample.
typedef struct columns {
  const pb_recorded_revision *of;
  size_t inputs, outputs;
  size_t input[plantbus_MAX_INPUTS], output[plantbus_MAX_OUTPUTS];
} columns;

typedef struct exporting {
  const pb_export_choice *choice;
  const columns *columns;
  size_t rows, row;  // that fit, and done so far
  pb_csv *csv;
  double *t, *step, *epoch, *revision, *flags, *u, *y;  // MAT: column-major
} exporting;

static bool names_equal(const pb_recorded_names *a, const pb_recorded_names *b) {
  bool equal = a->count == b->count;
  for (size_t i = 0; equal && i < a->count; i++)
    equal = strcmp(a->name[i], b->name[i]) == 0 && strcmp(a->unit[i], b->unit[i]) == 0;
  return equal;
}

static bool signals_equal(const pb_recorded_revision *a, const pb_recorded_revision *b) {
  return a->sample_rate == b->sample_rate && names_equal(&a->inputs, &b->inputs) &&
         names_equal(&a->outputs, &b->outputs);
}

static pb_status revision_choose(const pb_recording *r, const pb_export_choice *o, columns *c,
                                 pb_error *err) {
  char text[32];
  snprintf(text, sizeof text, "revision %u", o->revision);
  c->of = o->revision ? pb_recording_revision(r, o->revision) : &r->revision[r->revisions - 1];
  if (!c->of) return pb_fail(err, PB_ERR_REFERENCE, text, "is not in the recording");
  for (size_t i = 0; !o->revision && i < r->revisions; i++)
    if (!signals_equal(&r->revision[i], c->of))
      return pb_fail(err, PB_ERR_STATE, r->path,
                     "its revisions differ in signals or sample rate: name one with --revision");
  return PB_OK;
}

static bool wanted(const pb_export_choice *o, const char *name) {
  bool found = o->signals == 0;
  for (size_t i = 0; !found && i < o->signals; i++) found = strcmp(o->signal[i], name) == 0;
  return found;
}

static bool has_name(const pb_recorded_names *names, const char *name) {
  for (size_t i = 0; i < names->count; i++)
    if (strcmp(names->name[i], name) == 0) return true;
  return false;
}

static pb_status columns_choose(const pb_recording *r, const pb_export_choice *o, columns *c,
                                pb_error *err) {
  pb_status status = revision_choose(r, o, c, err);
  if (status) return status;
  for (size_t i = 0; i < o->signals; i++)
    if (!has_name(&c->of->inputs, o->signal[i]) && !has_name(&c->of->outputs, o->signal[i]))
      return pb_fail(err, PB_ERR_REFERENCE, o->signal[i], "is no signal of the recording");
  for (size_t i = 0; i < c->of->inputs.count; i++)
    if (wanted(o, c->of->inputs.name[i])) c->input[c->inputs++] = i;
  for (size_t i = 0; i < c->of->outputs.count; i++)
    if (wanted(o, c->of->outputs.name[i])) c->output[c->outputs++] = i;
  return PB_OK;
}

// ---- rows ---------------------------------------------------------------------------------------

// Steps are what is true; a limit given in seconds means the step nearest to it.
static bool fits(const exporting *e, const plantbus_Sample *x) {
  const pb_export_choice *o = e->choice;
  const double time = (double)x->step / e->columns->of->sample_rate;
  const double half = 0.5 / e->columns->of->sample_rate;
  return (!o->revision || x->revision == o->revision) && (!o->epoch || x->epoch == o->epoch) &&
         (!o->limited || (time > o->from - half && time < o->to + half));
}

static pb_status row_count(void *context, const plantbus_Sample *x, pb_error *err) {
  exporting *e = context;
  if (!fits(e, x)) return PB_OK;
  const pb_recorded_revision *v = e->columns->of;
  if (x->input_count != v->inputs.count || x->output_count != v->outputs.count)
    return pb_fail(err, PB_ERR_SYNTAX, "sample", "does not fit the signals of its revision");
  e->rows++;
  return PB_OK;
}

static pb_status row_csv(void *context, const plantbus_Sample *x, pb_error *err) {
  exporting *e = context;
  const columns *c = e->columns;
  (void)err;
  if (!fits(e, x)) return PB_OK;
  pb_csv_number(e->csv, (double)x->step / c->of->sample_rate);
  pb_csv_number(e->csv, (double)x->step);
  pb_csv_number(e->csv, x->epoch);
  pb_csv_number(e->csv, x->revision);
  pb_csv_number(e->csv, x->flags);
  for (size_t i = 0; i < c->inputs; i++) pb_csv_number(e->csv, x->input[c->input[i]]);
  for (size_t i = 0; i < c->outputs; i++) pb_csv_number(e->csv, x->output[c->output[i]]);
  return PB_OK;
}

static pb_status row_mat(void *context, const plantbus_Sample *x, pb_error *err) {
  exporting *e = context;
  const columns *c = e->columns;
  if (!fits(e, x)) return PB_OK;
  const size_t k = e->row++;
  if (k >= e->rows) return pb_fail(err, PB_ERR_STATE, "recording", "grew while it was read");
  e->t[k] = (double)x->step / c->of->sample_rate;
  e->step[k] = (double)x->step;
  e->epoch[k] = x->epoch;
  e->revision[k] = x->revision;
  e->flags[k] = x->flags;
  for (size_t i = 0; i < c->inputs; i++) e->u[i * e->rows + k] = x->input[c->input[i]];
  for (size_t i = 0; i < c->outputs; i++) e->y[i * e->rows + k] = x->output[c->output[i]];
  return PB_OK;
}

static pb_status rows_count(const pb_recording *r, exporting *e, pb_error *err) {
  const pb_status status = pb_recording_samples(r, row_count, e, err);
  if (!status && e->rows == 0) return pb_fail(err, PB_ERR_STATE, r->path, "holds no such sample");
  return status;
}

// ---- CSV ----------------------------------------------------------------------------------------

pb_status pb_export_csv(const pb_recording *r, const pb_export_choice *choice, const char *path,
                        pb_error *err) {
  columns c = {0};
  pb_csv csv = {0};
  exporting e = {.choice = choice, .columns = &c, .csv = &csv};
  pb_status status = columns_choose(r, choice, &c, err);
  if (!status) status = rows_count(r, &e, err);
  if (!status) status = pb_csv_open(path, &csv, err);
  if (status) return status;
  static const char *const fixed[] = {"step", "epoch", "revision", "flags"};
  pb_csv_column(&csv, "time", "s");
  for (size_t i = 0; i < sizeof fixed / sizeof *fixed; i++) pb_csv_column(&csv, fixed[i], NULL);
  for (size_t i = 0; i < c.inputs; i++)
    pb_csv_column(&csv, c.of->inputs.name[c.input[i]], c.of->inputs.unit[c.input[i]]);
  for (size_t i = 0; i < c.outputs; i++)
    pb_csv_column(&csv, c.of->outputs.name[c.output[i]], c.of->outputs.unit[c.output[i]]);
  status = pb_recording_samples(r, row_csv, &e, err);
  if (!status) return pb_csv_close(&csv, err);
  pb_csv_discard(&csv);
  return status;
}

// ---- MAT ----------------------------------------------------------------------------------------

static void names_put(pb_matfile *mat, const char *name, char **list, const size_t *index,
                      size_t count) {
  const char *text[plantbus_MAX_OUTPUTS + plantbus_MAX_INPUTS];
  for (size_t i = 0; i < count; i++) text[i] = list[index[i]];
  pb_matfile_names(mat, name, text, count);
}

static pb_status mat_put(const pb_recording *r, const exporting *e, const char *path,
                         pb_error *err) {
  const columns *c = e->columns;
  pb_matfile *mat;
  pb_status status = pb_matfile_open(path, &mat, err);
  if (status) return status;
  pb_matfile_text(mat, "plant", r->plant);
  pb_matfile_text(
      mat, "convention",
      "row k: y(k) beside u(k-1), the input held over the interval that ended at step k; "
      "y(k) = C x(k) + D u(k-1)");
  pb_matfile_text(mat, "plant_text", c->of->plant_text ? c->of->plant_text : "");
  pb_matfile_text(mat, "plant_sha256", c->of->sha256);
  pb_matfile_scalar(mat, "sample_rate", c->of->sample_rate);
  names_put(mat, "input_names", c->of->inputs.name, c->input, c->inputs);
  names_put(mat, "input_units", c->of->inputs.unit, c->input, c->inputs);
  names_put(mat, "output_names", c->of->outputs.name, c->output, c->outputs);
  names_put(mat, "output_units", c->of->outputs.unit, c->output, c->outputs);
  pb_matfile_real(mat, "t", e->rows, 1, e->t);
  pb_matfile_real(mat, "step", e->rows, 1, e->step);
  pb_matfile_real(mat, "epoch", e->rows, 1, e->epoch);
  pb_matfile_real(mat, "revision", e->rows, 1, e->revision);
  pb_matfile_real(mat, "flags", e->rows, 1, e->flags);
  pb_matfile_real(mat, "u", e->rows, c->inputs, e->u);
  pb_matfile_real(mat, "y", e->rows, c->outputs, e->y);
  return pb_matfile_close(mat, err);
}

pb_status pb_export_mat(const pb_recording *r, const pb_export_choice *choice, const char *path,
                        pb_error *err) {
  columns c = {0};
  exporting e = {.choice = choice, .columns = &c};
  pb_status status = columns_choose(r, choice, &c, err);
  if (!status) status = rows_count(r, &e, err);
  if (status) return status;
  double *all = calloc(e.rows, (5 + c.inputs + c.outputs) * sizeof *all);
  if (!all) return pb_fail_memory(err, r->path);
  double **part[] = {&e.t, &e.step, &e.epoch, &e.revision, &e.flags, &e.u};
  for (size_t i = 0; i < sizeof part / sizeof *part; i++) *part[i] = all + i * e.rows;
  e.y = e.u + c.inputs * e.rows;
  status = pb_recording_samples(r, row_mat, &e, err);
  if (!status) status = mat_put(r, &e, path, err);
  free(all);
  return status;
}
