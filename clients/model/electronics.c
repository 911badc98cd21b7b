// Signal electronics in the tool's results: a table, JSON, columns of an export. See tool.h.
#include <math.h>
#include <stdio.h>

#include "table.h"
#include "tool.h"

// One value of each signal of a list, as a column of an export.
typedef struct property {
  const char *input, *output;  // its name for inputs and for outputs; NULL: they have none
  double (*value)(const pb_electronics *e);
} property;

static double gain(const pb_electronics *e) {
  return e->gain;
}
static double quantisation(const pb_electronics *e) {
  return e->quantisation;
}
static double delay(const pb_electronics *e) {
  return e->delay;
}
static double noise(const pb_electronics *e) {
  return e->noise;
}
static double seed(const pb_electronics *e) {
  return (double)e->seed;
}
static bool is_bounded(const pb_electronics *e) {
  return e->low < e->high;
}
static double low(const pb_electronics *e) {
  return is_bounded(e) ? e->low : -INFINITY;
}
static double high(const pb_electronics *e) {
  return is_bounded(e) ? e->high : INFINITY;
}
static double slew(const pb_electronics *e) {
  return e->slew > 0 ? e->slew : INFINITY;
}

static const property properties[] = {
    {"input_gain", NULL, gain},
    {"input_quantisation", "output_quantisation", quantisation},
    {"input_delay", "output_delay", delay},
    {"input_noise", "output_noise", noise},
    {"input_seed", "output_seed", seed},
    {"input_low", NULL, low},
    {"input_high", NULL, high},
    {"input_slew", NULL, slew},
};
enum { PROPERTIES = sizeof properties / sizeof *properties };

static bool changes_something(const pb_electronics *e) {
  return e->gain != 1 || e->quantisation > 0 || e->delay > 0 || e->noise > 0 || is_bounded(e) ||
         e->slew > 0;
}

bool electronics_any(const pb_model *m) {
  return m->input_electronics || m->output_electronics;
}

// ---- table --------------------------------------------------------------------------------------

static void add_row(pb_table *table, const pb_signal *signal, const pb_electronics *e) {
  char range[80] = "";
  if (is_bounded(e)) snprintf(range, sizeof range, "%g … %g", e->low, e->high);
  pb_table_text(table, signal->name);
  pb_table_text(table, signal->unit);
  pb_table_number(table, e->gain);
  pb_table_number(table, e->quantisation > 0 ? e->quantisation : NAN);
  pb_table_count(table, e->delay);
  pb_table_number(table, e->noise > 0 ? e->noise : NAN);
  pb_table_text(table, range);
  pb_table_number(table, slew(e));
}

pb_status electronics_print(const pb_model *m, pb_error *err) {
  pb_table table = {0};
  if (!electronics_any(m)) return PB_OK;
  pb_table_text_column(&table, "signal");
  pb_table_text_column(&table, "unit");
  pb_table_number_column(&table, "gain", NULL, 6);
  pb_table_number_column(&table, "quantisation", NULL, 4);
  pb_table_number_column(&table, "delay", "samples", 4);
  pb_table_number_column(&table, "noise rms", NULL, 4);
  pb_table_text_column(&table, "saturation");
  pb_table_number_column(&table, "slew per s", NULL, 4);
  for (size_t k = 0; k < m->nu + m->ny; k++) {
    bool is_input = k < m->nu;
    pb_electronics e =
        is_input ? pb_model_input_electronics(m, k) : pb_model_output_electronics(m, k - m->nu);
    if (changes_something(&e)) add_row(&table, is_input ? &m->input[k] : &m->output[k - m->nu], &e);
  }
  printf("electronics\n");
  pb_status status = pb_table_print(&table, stdout, 2, err);
  putchar('\n');
  pb_table_free(&table);
  return status;
}

// ---- JSON: the keys of the plant file -----------------------------------------------------------

static void signal_json(pb_jsonout *json, const pb_signal *signal, const pb_electronics *e,
                        bool is_input) {
  pb_jsonout_object(json, NULL);
  pb_jsonout_text(json, "name", signal->name);
  if (is_input) pb_jsonout_number(json, "gain", e->gain);
  pb_jsonout_number(json, "quantisation", e->quantisation);
  pb_jsonout_integer(json, "delay", e->delay);
  pb_jsonout_number(json, "noise", e->noise);
  pb_jsonout_integer(json, "seed", e->seed);
  if (is_input && is_bounded(e)) {
    const double range[2] = {e->low, e->high};
    pb_jsonout_numbers(json, "saturation", range, 2);
  }
  if (is_input && e->slew > 0) pb_jsonout_number(json, "slew", e->slew);
  pb_jsonout_object_end(json);
}

void electronics_json(pb_jsonout *json, const pb_model *m) {
  if (!electronics_any(m)) return;
  pb_jsonout_object(json, "electronics");
  pb_jsonout_array(json, "inputs");
  for (size_t i = 0; i < m->nu; i++) {
    pb_electronics e = pb_model_input_electronics(m, i);
    signal_json(json, &m->input[i], &e, true);
  }
  pb_jsonout_array_end(json);
  pb_jsonout_array(json, "outputs");
  for (size_t o = 0; o < m->ny; o++) {
    pb_electronics e = pb_model_output_electronics(m, o);
    signal_json(json, &m->output[o], &e, false);
  }
  pb_jsonout_array_end(json);
  pb_jsonout_object_end(json);
}

// ---- columns ------------------------------------------------------------------------------------

void electronics_each(const pb_model *m, electronics_function *take, void *context) {
  double value[PB_ELECTRONICS_SIGNALS];
  if (!electronics_any(m)) return;
  for (size_t k = 0; k < PROPERTIES; k++) {
    for (size_t i = 0; i < m->nu && i < PB_ELECTRONICS_SIGNALS; i++) {
      pb_electronics e = pb_model_input_electronics(m, i);
      value[i] = properties[k].value(&e);
    }
    take(context, properties[k].input, value, m->nu);
    if (!properties[k].output) continue;
    for (size_t o = 0; o < m->ny && o < PB_ELECTRONICS_SIGNALS; o++) {
      pb_electronics e = pb_model_output_electronics(m, o);
      value[o] = properties[k].value(&e);
    }
    take(context, properties[k].output, value, m->ny);
  }
}
