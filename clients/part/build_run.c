// One part from its description to its element.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/json.h"
#include "base/text.h"
#include "blas_threads.h"
#include "build.h"
#include "patch.h"
#include "plant/element.h"
#include "progress.h"

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

pb_status build_set(const cJSON *json, const char *pointer, const char *text, cJSON **out,
                    pb_error *err) {
  cJSON *value = NULL, *patch = NULL;
  const cJSON *present = NULL;
  pb_error ignored;
  *out = NULL;
  pb_status st = pb_pointer_find(json, pointer, &present, err);
  if (st) return pb_fail(err, st, pointer, "is not in the part file");
  if (pb_json_parse(text, strlen(text), &value, &ignored)) value = cJSON_CreateString(text);
  st = value ? pb_patch_make(json, pointer, value, &patch, err) : pb_fail_memory(err, pointer);
  if (!st) {
    *out = pb_json_merge(json, patch);
    if (!*out) st = pb_fail_memory(err, pointer);
  }
  cJSON_Delete(value);
  cJSON_Delete(patch);
  return st;
}

// Takes "/pointer=value" apart and sets it.
static pb_status apply(cJSON **json, const char *assignment, pb_error *err) {
  const char *equal = strchr(assignment, '=');
  cJSON *changed = NULL;
  char *pointer = equal ? strndup(assignment, (size_t)(equal - assignment)) : NULL;
  if (!equal)
    return pb_fail(err, PB_ERR_ARGUMENT, assignment, "expected /pointer=value after --set");
  pb_status st = pointer ? build_set(*json, pointer, equal + 1, &changed, err)
                         : pb_fail_memory(err, assignment);
  free(pointer);
  if (st) return st;
  cJSON_Delete(*json);
  *json = changed;
  return PB_OK;
}

pb_status build_read(const build_options *options, cJSON **json, pb_error *err) {
  pb_status st = pb_json_read(options->file, json, NULL, err);
  for (size_t i = 0; !st && i < options->sets; i++) st = apply(json, options->set[i], err);
  if (st) {
    cJSON_Delete(*json);
    *json = NULL;
  }
  return st;
}

pb_status build_model(const cJSON *json, build *out, pb_error *err) {
  double begun = now();
  *out = (build){.json = cJSON_Duplicate(json, 1)};
  if (!out->json) return pb_fail_memory(err, "part");
  pb_status st = pb_part_read(json, &out->part, err);
  if (!st) st = pb_part_mesh(&out->part, &out->mesh, err);
  if (!st) st = pb_part_model(&out->part, &out->mesh, &out->fem, err);
  out->seconds[0] = now() - begun;
  return st;
}

static bool show_progress(void *context, pb_reduce_phase phase, double done, double total) {
  pb_blas_threads(phase);
  pb_progress_update(context, done, total, pb_reduce_phase_name(phase));
  return true;
}

// How free the element is, by the same eyes as everything that loads it.
static pb_status examine(build *b, pb_error *err) {
  pb_element *element = NULL;
  const pb_reduction *r = b->element;
  pb_status st = pb_element_new(b->part.name, r->frames, r->size, r->position, r->k, r->m, NULL,
                                &element, err);
  if (st) return st;
  b->rigid_hz = element->health.rigid_hz;
  b->flexible_hz = element->health.flexible_hz;
  pb_element_free(element);
  return PB_OK;
}

pb_status build_reduce(build *b, bool keep_shapes, pb_error *err) {
  double begun = now();
  pb_progress progress;
  pb_progress_begin(&progress, stderr, b->part.name);
  pb_reduce_options options = {
      .modes = b->part.modes, .progress = show_progress, .context = &progress};
  pb_status st = pb_reduce(&b->fem, &options, keep_shapes, &b->element, err);
  pb_progress_end(&progress);
  b->seconds[1] = now() - begun;
  if (!st) st = examine(b, err);
  if (!st) st = pb_part_characteristics(&b->part, b->element, b->value, &b->values, err);
  return st;
}

void build_clear(build *b) {
  pb_reduction_free(b->element);
  pb_fem_clear(&b->fem);
  pb_mesh_clear(&b->mesh);
  pb_part_clear(&b->part);
  cJSON_Delete(b->json);
  *b = (build){0};
}

// What made the element: version, mesh, and the part's description in full; no place, no date.
static pb_status provenance(const build *b, pb_text *text, pb_error *err) {
  char *description = NULL;
  pb_status st = pb_json_print(b->json, &description, err);
  if (st) return st;
  pb_text_format(text, "plantbus-part build, version %s\n", PB_VERSION);
  pb_text_format(text, "mesh: %zu 20-node hexahedra, %zu nodes, %zu degrees of freedom\n",
                 b->mesh.elements, b->mesh.nodes, b->element->full_dof);
  pb_text_append(text, description);
  free(description);
  return text->failed ? pb_fail_memory(err, b->part.name) : PB_OK;
}

pb_status build_write(const build *b, const build_options *options, pb_error *err) {
  const char *frame[PB_PART_FRAMES];
  pb_text text = {0};
  const pb_reduction *r = b->element;
  for (size_t i = 0; i < r->frames; i++) frame[i] = pb_part_frame_name(b->part.type, i);
  pb_status st = provenance(b, &text, err);
  pb_element_out element = {.name = b->part.name,
                            .frames = r->frames,
                            .size = r->size,
                            .position = r->position,
                            .k = r->k,
                            .m = r->m,
                            .frame_name = frame,
                            .fixed_hz = r->fixed_hz,
                            .provenance = text.text};
  if (!st) st = pb_element_write(&element, options->out, options->format, err);
  free(text.text);
  return st;
}
