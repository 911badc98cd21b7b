// plantbus-model info: what the plant is, its signals and their electronics, first modes and static
// gains from command to output.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "table.h"
#include "tool.h"

enum { FIRST_MODES = 6, GAIN_COLUMNS = 6 };

typedef struct info {
  const pb_model *model;
  const channels *ch;
  const double *gain;  // [ny][nu]; NULL when it cannot be computed
} info;

static void info_json(pb_jsonout *json, const void *context) {
  const info *i = context;
  const pb_model *m = i->model;
  pb_jsonout_object(json, NULL);
  pb_jsonout_text(json, "name", m->name);
  pb_jsonout_integer(json, "dof", m->dof);
  pb_jsonout_integer(json, "states", m->nx);
  pb_jsonout_number(json, "sample_rate", m->sample_rate);
  pb_jsonout_number(json, "max_frequency", m->max_frequency > 0 ? m->max_frequency : NAN);
  emit_channels_json(json, i->ch);
  pb_jsonout_texts(json, "input_units", i->ch->input_unit, m->nu);
  pb_jsonout_texts(json, "output_units", i->ch->output_unit, m->ny);
  electronics_json(json, m);
  pb_jsonout_array(json, "dc_gain");
  for (size_t o = 0; o < m->ny; o++) pb_jsonout_numbers(json, NULL, i->gain + o * m->nu, m->nu);
  pb_jsonout_array_end(json);
  pb_jsonout_object_end(json);
}

static void print_overview(const pb_model *m) {
  printf("%s\n", m->name);
  printf("  %zu degrees of freedom, %zu states", m->dof, m->nx);
  if (m->max_frequency > 0) printf(" (modes above %g Hz static)", m->max_frequency);
  printf(", sampled at %g Hz\n  first modes:", m->sample_rate);
  for (size_t k = 0; k < m->modes && k < FIRST_MODES; k++) {
    printf("%s %.4g Hz (%.2g %%)", k ? "," : "", m->mode_hz[k], 100 * m->mode_damping[k]);
  }
  printf("%s\n\n", m->modes > FIRST_MODES ? ", …" : "");
}

static double largest(const double *gain, size_t count, size_t stride) {
  double size = 0;
  for (size_t k = 0; k < count; k++) size = fmax(size, fabs(gain[k * stride]));
  return size;
}

// A gain that is rounding error beside the others of its input and of its output counts as 0.
static double shown_gain(const info *i, size_t o, size_t k) {
  const double *gain = i->gain;
  size_t nu = i->ch->inputs, ny = i->ch->outputs;
  double value = gain[o * nu + k];
  double size = fmin(largest(gain + o * nu, nu, 1), largest(gain + k, ny, nu));
  return fabs(value) < 1e-9 * size ? 0 : value;
}

// Static gains of some inputs: a row an output, a column an input.
static pb_status print_gains(const info *i, size_t first, size_t end, pb_error *err) {
  const channels *ch = i->ch;
  pb_table table = {0};
  pb_table_text_column(&table, "output");
  pb_table_text_column(&table, "unit");
  for (size_t k = first; k < end; k++) {
    pb_table_number_column(&table, ch->input_name[k], ch->input_unit[k], 4);
  }
  for (size_t o = 0; o < ch->outputs; o++) {
    pb_table_text(&table, ch->output_name[o]);
    pb_table_text(&table, ch->output_unit[o]);
    for (size_t k = first; k < end; k++) pb_table_number(&table, shown_gain(i, o, k));
  }
  printf("static gains\n");
  pb_status status = pb_table_print(&table, stdout, 2, err);
  pb_table_free(&table);
  return status;
}

int command_info(const tool *t, const pb_model *model) {
  channels ch;
  int code = channels_choose(t, model, false, &ch);
  if (code) return code;
  pb_error err = {0};
  double *gain = malloc((model->nu * model->ny + 1) * sizeof *gain);
  pb_status status = gain ? pb_model_dc(model, gain, &err) : pb_fail_memory(&err, t->file);
  info i = {model, &ch, gain};
  if (!status && wants_table(t)) {
    print_overview(model);
    status = electronics_print(model, &err);
    for (size_t k = 0; !status && k < model->nu; k += GAIN_COLUMNS) {
      size_t end = k + GAIN_COLUMNS < model->nu ? k + GAIN_COLUMNS : model->nu;
      if (k) putchar('\n');
      status = print_gains(&i, k, end, &err);
    }
  }
  code = tool_end(status, &err);
  if (!code) code = emit_json(t, info_json, &i);
  free(gain);
  channels_free(&ch);
  return code;
}
