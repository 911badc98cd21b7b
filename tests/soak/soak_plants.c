// soak_plants PLANT DIRECTORY: writes DIRECTORY/plant.json, the shipped hexapod, and
// DIRECTORY/joint.mat, an element that can take the place of its joints:
//
//   two half joints in a row, all three frames at one point, a mass at each:
//   K = 2 [k −k 0; −k 2k −k; 0 −k k],  k = diag(k_s k_s k_a k_f k_f k_t),  M = diag
//
// Then applies every patch of patch.h one after the other and compiles the plant each time, so that
// a soak does not measure how a daemon refuses.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/json.h"
#include "model/model.h"
#include "patch.h"
#include "support/beam.h"

enum { FRAMES = 3, SIZE = 6 * FRAMES };

static const double rate[6] = {1e7, 1e7, 94e6, 4.83, 4.83, 260};     // N/m, N m/rad
static const double mass[6] = {4e-3, 4e-3, 4e-3, 2e-7, 2e-7, 1e-7};  // kg, kg m², of a frame

static int element_write(const char *path) {
  static double k[SIZE * SIZE], m[SIZE * SIZE];
  static const double position[3 * FRAMES];
  for (size_t f = 0; f + 1 < FRAMES; f++)
    for (size_t d = 0; d < 6; d++) {
      const size_t i = 6 * f + d, j = i + 6;
      k[i + SIZE * i] += 2 * rate[d];
      k[j + SIZE * j] += 2 * rate[d];
      k[i + SIZE * j] = k[j + SIZE * i] = -2 * rate[d];
    }
  for (size_t i = 0; i < SIZE; i++) m[i + SIZE * i] = mass[i % 6];
  return beam_write(path, FRAMES, SIZE, k, m, position);
}

static pb_status plant_write(const char *path, const cJSON *plant, pb_error *err) {
  char *text = NULL;
  pb_status status = pb_json_print(plant, &text, err);
  if (status) return status;
  FILE *file = fopen(path, "w");
  if (!file || fputs(text, file) < 0) status = pb_fail(err, PB_ERR_IO, path, "cannot be written");
  if (file && fclose(file) != 0) status = pb_fail(err, PB_ERR_IO, path, "cannot be written");
  cJSON_free(text);
  return status;
}

static pb_status patch_try(cJSON **plant, const char *patch_text, const char *path, pb_error *err) {
  cJSON *patch = NULL;
  pb_model *model = NULL;
  pb_status status = pb_json_parse(patch_text, strlen(patch_text), &patch, err);
  if (status) return status;
  cJSON *next = pb_json_merge(*plant, patch);
  cJSON_Delete(patch);
  if (!next) return pb_fail_memory(err, path);
  cJSON_Delete(*plant);
  *plant = next;
  status = plant_write(path, *plant, err);
  if (!status) status = pb_model_load(path, NULL, &model, err);
  if (!status) printf("soak_plants: %zu states with %.60s...\n", model->nx, patch_text);
  pb_model_free(model);
  return status;
}

static pb_status work(const char *shipped, const char *directory, pb_error *err) {
  char path[512], variant[512];
  cJSON *plant = NULL;
  char *text = NULL;
  snprintf(path, sizeof path, "%s/" SOAK_ELEMENT, directory);
  if (element_write(path)) return pb_fail(err, PB_ERR_IO, path, "cannot be written");
  snprintf(path, sizeof path, "%s/plant.json", directory);
  snprintf(variant, sizeof variant, "%s/variant.json", directory);
  pb_status status = pb_json_read(shipped, &plant, &text, err);
  if (!status) status = plant_write(path, plant, err);
  for (int i = 0; !status && i < SOAK_PATCHES; i++) {
    char patch[SOAK_PATCH_TEXT];
    soak_patch(i, 0.5, patch);
    status = patch_try(&plant, patch, variant, err);
  }
  unlink(variant);
  cJSON_Delete(plant);
  free(text);
  return status;
}

int main(int argc, char **argv) {
  pb_error err = {PB_OK, "", ""};
  if (argc != 3) return 2;
  if (!work(argv[1], argv[2], &err)) return 0;
  fprintf(stderr, "soak_plants: %s: %s\n", err.where, err.message);
  return 1;
}
