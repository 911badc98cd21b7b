// A plant file's tree compiled: see file_model.h.
#include "study/file_model.h"

#include <stdlib.h>
#include <string.h>

#include "assembly/system.h"

pb_status pb_file_model(const cJSON *file, const char *directory, pb_model **out, pb_error *err) {
  char *text = NULL;
  pb_plant *plant = NULL;
  pb_system *system = NULL;
  *out = NULL;
  pb_status status = pb_json_print_compact(file, &text, err);
  if (!status) status = pb_plant_parse(text, strlen(text), directory, NULL, &plant, err);
  if (!status) status = pb_system_assemble(plant, NULL, &system, err);
  if (!status) status = pb_model_compile(system, NULL, out, err);
  pb_system_free(system);
  pb_plant_free(plant);
  free(text);
  return status;
}
