// The plant that is to be controlled: from a file, or on the bus.
#include <stdlib.h>

#include "base/text.h"
#include "control_tool.h"

static pb_status load(const char *file, control_plant *out, pb_error *err) {
  pb_warnings warnings = {0};
  size_t length;
  pb_status status = pb_text_read(file, &out->text, &length, err);
  if (status == PB_OK) status = pb_model_load(file, &warnings, &out->model, err);
  pb_print_warnings(stderr, &warnings);
  pb_warnings_clear(&warnings);
  if (status != PB_OK) return status;
  out->description = (pb_description){.name = out->model->name ? out->model->name : file,
                                      .plant_text = out->text,
                                      .plant_sha256 = ""};
  out->bench = (pb_bench){.model = out->model, .description = &out->description};
  return PB_OK;
}

pb_status control_plant_open(const char *file, const iff_options *options, control_plant *out,
                             pb_error *err) {
  *out = (control_plant){0};
  pb_status status = file
                         ? load(file, out, err)
                         : pb_bench_open(&options->common, options->excite.reset, &out->bench, err);
  if (status != PB_OK) control_plant_close(out);
  return status;
}

void control_plant_close(control_plant *plant) {
  if (plant->bench.session) pb_bench_close(&plant->bench);
  pb_model_free(plant->model);
  free(plant->text);
  *plant = (control_plant){0};
}
