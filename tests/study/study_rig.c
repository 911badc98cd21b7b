// See study_rig.h.
#include "study_rig.h"

cJSON *rig_file(const char *path) {
  cJSON *file = NULL;
  REQUIRE(pb_json_read(path, &file, NULL, &err));
  return file;
}

cJSON *rig_vary(const cJSON *file, pb_study_kind kind, const char *value) {
  const pb_variation v = {kind, value, {NAN, NAN, NAN, NAN}, PB_CONFIG "/plants"};
  cJSON *out = NULL;
  REQUIRE(pb_variation_apply(file, &v, &out, &err));
  return out;
}

pb_study_point rig_point(const cJSON *file, pb_study_kind kind, const char *value) {
  const pb_study_options options = {.from = 1, .to = 500, .points = 60};
  cJSON *varied = rig_vary(file, kind, value);
  pb_study_point point = {0};
  REQUIRE(pb_study_point_find(varied, PB_CONFIG "/plants", &options, &point, &err));
  cJSON_Delete(varied);
  return point;
}
