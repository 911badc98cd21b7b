// Shared command-line parts: see source.h.
#include "source.h"

#include <libgen.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"

enum {
  KEY_MODEL = 0x500,
  KEY_ENDS,
  KEY_ACTUATOR,
  KEY_SENSOR,
  KEY_AXIS,
  KEY_POLARITY,
  KEY_G_A,
  KEY_G_S,
  KEY_DAMPING,
  KEY_PART_LENGTH,
};

// ---- the part -----------------------------------------------------------------------------------

static const struct argp_option source_table[] = {
    {"model", KEY_MODEL, "NAME", 0, "Model of the plant file (default: the only one that fits)", 4},
    {"length", KEY_PART_LENGTH, "M", 0,
     "Of a lumped model that has no length of its own, as a template's", 4},
    {"ends", KEY_ENDS, "B,T", 0, "Element: bottom and top frame (default 1,2)", 5},
    {"actuator-frames", KEY_ACTUATOR, "A,B", 0,
     "Element: ends of the actuator stacks (default 5,7)", 5},
    {"sensor-frames", KEY_SENSOR, "A,B", 0, "Element: ends of the sensor stack (default 3,4)", 5},
    {"axis", KEY_AXIS, "X,Y,Z", 0, "Element: direction of the stacks (default 1,0,0)", 5},
    {"polarity", KEY_POLARITY, "S", 0,
     "Element: -1 (default) where the part gets shorter as its stacks expand, else 1", 5},
    {"g-a", KEY_G_A, "N/V", 0, "Element: actuator constant (default: of 'constants')", 5},
    {"g-s", KEY_G_S, "V/M", 0, "Element: sensor constant (default: of 'constants')", 5},
    {"modal-damping", KEY_DAMPING, "XI", 0, "Element: damping ratio of all modes (default 0.01)",
     5},
    {0},
};

static error_t source_parse(int key, char *text, struct argp_state *state) {
  source_options *o = state->input;
  pb_actuator_layout *l = o ? &o->layout : NULL;
  if (key == KEY_MODEL) {
    o->model = text;
    return 0;
  }
  if (key == KEY_PART_LENGTH) {
    o->length = pb_option_double(state, "--length", text, 1e-9, 1e3);
    return 0;
  }
  switch (key) {
  case KEY_ENDS:
    pb_option_frames(state, "--ends", text, l->ends);
    break;
  case KEY_ACTUATOR:
    pb_option_frames(state, "--actuator-frames", text, l->actuator);
    break;
  case KEY_SENSOR:
    pb_option_frames(state, "--sensor-frames", text, l->sensor);
    break;
  case KEY_AXIS:
    pb_option_direction(state, "--axis", text, l->axis);
    break;
  case KEY_POLARITY:
    l->polarity = pb_option_double(state, "--polarity", text, -1, 1);
    if (l->polarity != 1 && l->polarity != -1)
      argp_error(state, "--polarity: '%s' is not 1 or -1", text);
    break;
  case KEY_G_A:
    l->g_a = pb_option_double(state, "--g-a", text, -1e12, 1e12);
    break;
  case KEY_G_S:
    l->g_s = pb_option_double(state, "--g-s", text, -1e15, 1e15);
    break;
  case KEY_DAMPING:
    l->modal_damping = pb_option_double(state, "--modal-damping", text, 0, 1);
    break;
  default:
    return ARGP_ERR_UNKNOWN;
  }
  o->layout_given = true;
  return 0;
}

const struct argp source_argp = {source_table, source_parse, NULL, NULL, NULL, NULL, NULL};

void source_defaults(source_options *o) {
  *o = (source_options){.layout = pb_actuator_layout_default()};
}

bool source_is_element_file(const char *path) {
  const size_t length = strlen(path);
  return length > 4 && !strcmp(path + length - 4, ".mat");
}

pb_status source_read_plant(const char *path, char **text, char **directory, pb_error *err) {
  size_t length;
  *text = *directory = NULL;
  char *copy = pb_text_copy(path);
  if (!copy) return pb_fail_memory(err, path);
  pb_status st = pb_text_read(path, text, &length, err);
  if (!st && !(*directory = pb_text_copy(dirname(copy)))) {
    free(*text);
    *text = NULL;
    st = pb_fail_memory(err, path);
  }
  free(copy);
  return st;
}

// A template gives its struts their length; here it must come from the command line.
static pb_status need_length(const source_options *o, pb_element_source *source, pb_error *err) {
  const cJSON *type = pb_json_member(source->model, "type");
  const bool element = cJSON_IsString(type) && !strcmp(type->valuestring, "super_element");
  if (element || pb_json_member(source->model, "length")) return PB_OK;
  if (!(o->length > 0))
    return pb_fail(err, PB_ERR_ARGUMENT, "--length",
                   "model %s has no length (a template would give it one): how long is it?",
                   source->name);
  if (cJSON_AddNumberToObject(source->model, "length", o->length)) return PB_OK;
  return pb_fail_memory(err, source->name);
}

pb_status source_open(const source_options *o, pb_element_source *out, pb_error *err) {
  char *text = NULL, *directory = NULL;
  *out = (pb_element_source){0};
  if (source_is_element_file(o->file)) {
    if (o->model)
      return pb_fail(err, PB_ERR_ARGUMENT, "--model", "%s is an element, not a plant file",
                     o->file);
    return pb_element_source_actuator(o->file, &o->layout, out, err);
  }
  if (o->layout_given)
    return pb_fail(err, PB_ERR_ARGUMENT, o->file,
                   "a plant file says itself how its element is used: layout options are for "
                   "element files (.mat)");
  pb_status st = source_read_plant(o->file, &text, &directory, err);
  if (!st)
    st = pb_element_source_plant(text, o->file, directory, o->model, pb_element_is_actuator, out,
                                 err);
  if (!st && (st = need_length(o, out, err))) pb_element_source_clear(out);
  free(text);
  free(directory);
  return st;
}
