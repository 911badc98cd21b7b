// Interface frames from JSON: see frames.h.
#include "frames.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "frames_internal.h"
#include "jsonout.h"
#include "outfile.h"

static const char schema[] = "plantbus.frames/1";

// ---- one frame ----------------------------------------------------------------------------------

static pb_status read_origin(const frame_source *s, const pb_reader *r, pb_fem_frame *frame,
                             pb_error *err) {
  char where[256];
  const cJSON *value = pb_reader_find(r, "origin", where);
  if (cJSON_IsString(value) && !strcmp(value->valuestring, "centroid")) {
    for (size_t i = 0; i < frame->nodes; i++)
      for (size_t a = 0; a < 3; a++)
        frame->origin[a] += s->fem->xyz[a + 3 * frame->node[i]] / (double)frame->nodes;
    return PB_OK;
  }
  if (!value)
    return pb_fail(err, PB_ERR_SCHEMA, where, "is missing: expected [x, y, z] or \"centroid\"");
  pb_status st = pb_json_numbers(value, where, 3, frame->origin, err);
  for (size_t a = 0; a < 3; a++) frame->origin[a] *= s->length;
  return st;
}

static pb_status read_moments(const frame_source *s, const cJSON *value, const char *where,
                              pb_fem_frame *frame, pb_error *err) {
  if (!cJSON_IsArray(value) || (size_t)cJSON_GetArraySize(value) != frame->nodes)
    return pb_fail(err, PB_ERR_SCHEMA, where,
                   "expected four numbers for each of the frame's %zu nodes", frame->nodes);
  frame->moment = malloc(4 * frame->nodes * sizeof *frame->moment);
  if (!frame->moment) return pb_fail_memory(err, where);
  double *to = frame->moment;
  const cJSON *item;
  cJSON_ArrayForEach(item, value) {
    pb_status st = pb_json_numbers(item, where, 4, to, err);
    if (st) return st;
    for (size_t a = 1; a < 4; a++) to[a] *= s->length;
    to += 4;
  }
  return PB_OK;
}

static pb_status read_weight_list(const frame_source *s, const cJSON *value, const char *where,
                                  pb_fem_frame *frame, pb_error *err) {
  double *w = malloc(frame->nodes * sizeof *w);
  if (!w) return pb_fail_memory(err, where);
  pb_status st = pb_json_numbers(value, where, frame->nodes, w, err);
  for (size_t i = 0; !st && i < frame->nodes; i++)
    if (!(w[i] > 0)) st = pb_fail(err, PB_ERR_SCHEMA, where, "weight %zu is not positive", i + 1);
  if (!st) st = pb_fem_frame_weights(s->fem, frame, w, err);
  free(w);
  return st;
}

static pb_status read_weights(const frame_source *s, const pb_reader *r, pb_fem_frame *frame,
                              pb_error *err) {
  char where[256], moments_where[256];
  const cJSON *weights = pb_reader_find(r, "weights", where);
  const cJSON *moments = pb_reader_find(r, "moments", moments_where);
  if (frame->tie == PB_TIE_RIGID && (weights || moments))
    return pb_fail(err, PB_ERR_SCHEMA, weights ? where : moments_where,
                   "a rigid frame has no weights");
  if (frame->tie == PB_TIE_RIGID) return PB_OK;
  if (weights && moments)
    return pb_fail(err, PB_ERR_SCHEMA, moments_where, "weights are given already");
  if (moments) return read_moments(s, moments, moments_where, frame, err);
  bool word = cJSON_IsString(weights);
  if (!weights || (word && !strcmp(weights->valuestring, "equal")))
    return pb_fem_frame_weights(s->fem, frame, NULL, err);
  if (word && !strcmp(weights->valuestring, "mass")) return pb_fem_frame_mass(s->fem, frame, err);
  if (word)
    return pb_fail(err, PB_ERR_SCHEMA, where,
                   "expected \"equal\", \"mass\" or a number for each node");
  return read_weight_list(s, weights, where, frame, err);
}

static pb_status read_tie(const pb_reader *r, pb_fem_frame *frame, pb_error *err) {
  const char *tie = NULL;
  char where[256];
  pb_status st = pb_reader_string(r, "tie", false, &tie);
  if (st || !tie) return st;  // averaged is 0
  pb_reader_find(r, "tie", where);
  if (strcmp(tie, "rigid") && strcmp(tie, "averaged"))
    return pb_fail(err, PB_ERR_SCHEMA, where, "expected \"averaged\" or \"rigid\"");
  frame->tie = strcmp(tie, "rigid") ? PB_TIE_AVERAGED : PB_TIE_RIGID;
  return PB_OK;
}

static pb_status read_frame(frame_source *s, const cJSON *object, const char *name,
                            const char *pointer, pb_error *err) {
  static const char *const known[] = {"origin", "tie",      "nodes",   "set",     "box",
                                      "plane",  "cylinder", "weights", "moments", NULL};
  pb_fem *fem = s->fem;
  pb_reader r;
  for (size_t f = 0; f < fem->frames; f++)
    if (!strcmp(fem->frame[f].name, name))
      return pb_fail(err, PB_ERR_SCHEMA, pointer, "there is a frame %s already", name);
  pb_fem_frame *more = realloc(fem->frame, (fem->frames + 1) * sizeof *more);
  if (!more) return pb_fail_memory(err, pointer);
  fem->frame = more;
  pb_fem_frame *frame = &fem->frame[fem->frames];
  *frame = (pb_fem_frame){.name = pb_text_copy(name)};
  if (!frame->name) return pb_fail_memory(err, pointer);
  fem->frames++;
  pb_status st = pb_reader_open(object, pointer, NULL, &r, err);
  if (!st) st = pb_reader_known(&r, known, NULL, 0);
  if (!st) st = read_tie(&r, frame, err);
  if (!st) st = frame_choose_nodes(s, &r, frame, err);
  if (!st) st = read_origin(s, &r, frame, err);
  if (!st) st = read_weights(s, &r, frame, err);
  return st;
}

// ---- files and flags ----------------------------------------------------------------------------

// Errors of the JSON readers point into the text: say which text.
static pb_status name_source(pb_status st, const char *name, pb_error *err) {
  if (!st || !err || (err->where[0] && err->where[0] != '/')) return st;
  char where[sizeof err->where];
  snprintf(where, sizeof where, "%.120s%s%.120s", name, err->where[0] ? ": " : "", err->where);
  memcpy(err->where, where, sizeof where);
  return st;
}

// A path beside the file that names it.
static char *beside(const char *path, const char *name) {
  pb_text text = {0};
  const char *slash = strrchr(path, '/');
  if (name[0] != '/' && slash) pb_text_append_n(&text, path, (size_t)(slash - path) + 1);
  pb_text_append(&text, name);
  return text.text;
}

static pb_status read_file(frame_source *s, const char *path, const cJSON *json, char **sets,
                           pb_error *err) {
  static const char *const known[] = {"schema", "sets", "frames", NULL};
  pb_reader r;
  const char *says, *deck = NULL;
  pb_status st = pb_reader_open(json, "", NULL, &r, err);
  if (!st) st = pb_reader_known(&r, known, NULL, 0);
  if (!st) st = pb_reader_string(&r, "schema", true, &says);
  if (!st && strcmp(says, schema))
    st = pb_fail(err, PB_ERR_SCHEMA, "/schema", "expected \"%s\", not \"%.60s\"", schema, says);
  if (!st) st = pb_reader_string(&r, "sets", false, &deck);
  if (!st && deck) {
    s->sets = *sets = beside(path, deck);
    if (!*sets) st = pb_fail_memory(err, path);
  }
  const cJSON *frames = pb_json_member(json, "frames"), *item;
  if (!st && (!cJSON_IsObject(frames) || !frames->child))
    st = pb_fail(err, PB_ERR_SCHEMA, "/frames", "expected an object of frames by name");
  for (item = st ? NULL : frames->child; !st && item; item = item->next) {
    char pointer[256];
    pb_json_pointer(pointer, sizeof pointer, "/frames", item->string);
    st = read_frame(s, item, item->string, pointer, err);
  }
  return st;
}

pb_status pb_frames_read(const char *path, double length, pb_fem *fem, pb_error *err) {
  frame_source s = {.name = path, .length = length, .fem = fem};
  cJSON *json = NULL;
  char *sets = NULL;
  s.chosen = calloc(fem->nodes + 1, sizeof *s.chosen);
  pb_status st = s.chosen ? pb_json_read(path, &json, NULL, err) : pb_fail_memory(err, path);
  if (!st) st = name_source(read_file(&s, path, json, &sets, err), path, err);
  cJSON_Delete(json);
  free(sets);
  free(s.chosen);
  return st;
}

pb_status pb_frames_add(const char *text, const char *sets, double length, pb_fem *fem,
                        pb_error *err) {
  const char *equal = strchr(text, '=');
  if (!equal || equal == text)
    return pb_fail(err, PB_ERR_ARGUMENT, "--frame", "expected NAME={…}, not '%.80s'", text);
  pb_text name = {0};
  cJSON *json = NULL;
  char pointer[256];
  frame_source s = {.name = "--frame", .sets = sets, .length = length, .fem = fem};
  s.chosen = calloc(fem->nodes + 1, sizeof *s.chosen);
  pb_text_append_n(&name, text, (size_t)(equal - text));
  pb_status st = name.failed || !s.chosen ? pb_fail_memory(err, "--frame")
                                          : pb_json_parse(equal + 1, strlen(equal + 1), &json, err);
  if (!st) {
    pb_json_pointer(pointer, sizeof pointer, "", name.text);
    st = read_frame(&s, json, name.text, pointer, err);
  }
  st = name_source(st, "--frame", err);
  cJSON_Delete(json);
  free(name.text);
  free(s.chosen);
  return st;
}

static void write_frame(const pb_fem *fem, const pb_fem_frame *frame, pb_jsonout *json) {
  pb_jsonout_object(json, frame->name);
  pb_jsonout_numbers(json, "origin", frame->origin, 3);
  pb_jsonout_text(json, "tie", frame->tie == PB_TIE_RIGID ? "rigid" : "averaged");
  pb_jsonout_row(json, "nodes");
  for (size_t i = 0; i < frame->nodes; i++)
    pb_jsonout_integer(json, NULL, (uint64_t)pb_fem_node_number(fem, frame->node[i]));
  pb_jsonout_array_end(json);
  if (frame->tie == PB_TIE_AVERAGED) {
    pb_jsonout_array(json, "moments");
    for (size_t i = 0; i < frame->nodes; i++)
      pb_jsonout_numbers(json, NULL, frame->moment + 4 * i, 4);
    pb_jsonout_array_end(json);
  }
  pb_jsonout_object_end(json);
}

pb_status pb_frames_write(const pb_fem *fem, const char *path, pb_error *err) {
  pb_outfile out;
  pb_jsonout json;
  pb_status st = pb_outfile_open(path, &out, err);
  if (st) return st;
  pb_jsonout_begin(&json, out.stream);
  pb_jsonout_object(&json, NULL);
  pb_jsonout_text(&json, "schema", schema);
  pb_jsonout_object(&json, "frames");
  for (size_t i = 0; i < fem->frames; i++) write_frame(fem, &fem->frame[i], &json);
  pb_jsonout_object_end(&json);
  pb_jsonout_object_end(&json);
  pb_jsonout_end(&json);
  return pb_outfile_close(&out, err);
}
