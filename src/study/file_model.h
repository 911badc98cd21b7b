// A plant file that exists as a tree only, compiled: what studies vary in memory.
#ifndef PB_STUDY_FILE_MODEL_H
#define PB_STUDY_FILE_MODEL_H

#include "base/json.h"
#include "model/model.h"

// Element files are relative to directory (NULL: the working directory). *out is the caller's
// (pb_model_free). [init] Fails as pb_plant_parse, pb_system_assemble, pb_model_compile.
pb_status pb_file_model(const cJSON *file, const char *directory, pb_model **out, pb_error *err);

#endif
