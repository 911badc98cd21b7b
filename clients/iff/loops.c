// Choosing the loops that IFF closes.
#include <stdlib.h>
#include <string.h>

#include "iff_tool.h"
#include "roots.h"

void iff_loops_clear(iff_loops *loops) {
  free(loops->input);
  free(loops->output);
  *loops = (iff_loops){0};
}

static pb_status by_names(const pb_model *model, const iff_options *o, iff_loops *out,
                          pb_error *err) {
  if (o->inputs.count != o->outputs.count) {
    return pb_fail(err, PB_ERR_ARGUMENT, "--input", "%zu inputs and %zu outputs do not pair",
                   o->inputs.count, o->outputs.count);
  }
  size_t outputs = 0;
  pb_status status =
      pb_bench_choose(&o->inputs, model->input, model->nu, "input", &out->input, &out->count, err);
  if (status == PB_OK) {
    status = pb_bench_choose(&o->outputs, model->output, model->ny, "output", &out->output,
                             &outputs, err);
  }
  return status;
}

static pb_status by_actuators(const pb_model *model, iff_loops *out, pb_error *err) {
  out->input = malloc((model->nu + 1) * sizeof *out->input);
  out->output = malloc((model->nu + 1) * sizeof *out->output);
  if (!out->input || !out->output) return pb_fail_memory(err, "loops");
  for (size_t i = 0; i < model->nu; i++) {
    int sensor = pb_sensor_of(model, i);
    if (sensor < 0) continue;
    out->input[out->count] = i;
    out->output[out->count++] = (size_t)sensor;
  }
  if (out->count > 0) return PB_OK;
  return pb_fail(
      err, PB_ERR_STATE, model->name ? model->name : "",
      "no input Va… or f… has a sensor Vs… or fm… of the same name: use --input and --output");
}

pb_status iff_choose_loops(const pb_model *model, const iff_options *o, iff_loops *out,
                           pb_error *err) {
  *out = (iff_loops){0};
  bool named = o->inputs.count > 0 || o->outputs.count > 0;
  pb_status status = named ? by_names(model, o, out, err) : by_actuators(model, out, err);
  if (status == PB_OK && o->strut > out->count) {
    status = pb_fail(err, PB_ERR_ARGUMENT, "--strut", "there are %zu loops", out->count);
  }
  if (status == PB_OK && o->strut > 0) {
    out->input[0] = out->input[o->strut - 1];
    out->output[0] = out->output[o->strut - 1];
    out->count = 1;
  }
  if (status != PB_OK) iff_loops_clear(out);
  return status;
}
