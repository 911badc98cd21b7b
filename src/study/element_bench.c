// Benches for actuators and joints: see element_bench.h.
#include "study/element_bench.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "assembly/motion.h"
#include "assembly/system.h"
#include "base/text.h"

static const double default_rate = 10000;

void pb_bench_model_clear(pb_bench_model *b) {
  pb_model_free(b->model);
  pb_plant_free(b->plant);
  *b = (pb_bench_model){0};
}

const pb_component *pb_bench_part(const pb_bench_model *b) {
  for (size_t i = 0; i < b->plant->component_count; i++)
    if (!strcmp(b->plant->component[i].name, "part")) return &b->plant->component[i];
  return NULL;
}

// ---- plant files --------------------------------------------------------------------------------

static pb_status begin(const pb_element_source *source, double sample_rate, pb_text *text,
                       pb_error *err) {
  char *model = NULL, rate[32];
  pb_status st = pb_json_print_compact(source->model, &model, err);
  if (st) return st;
  pb_text_number(rate, sizeof rate, sample_rate > 0 ? sample_rate : default_rate);
  pb_text_format(text,
                 "{\"schema\":\"plantbus.plant/1\",\"name\":\"bench\",\"sample_rate\":%s,"
                 "\"models\":{\"part\":%s}",
                 rate, model);
  free(model);
  return PB_OK;
}

// The text is used up.
static pb_status parse(const pb_element_source *source, pb_text *text, pb_warnings *warnings,
                       pb_plant **out, pb_error *err) {
  pb_status st = text->failed ? pb_fail_memory(err, source->name)
                              : pb_plant_parse(text->text, text->length, source->directory,
                                               warnings, out, err);
  free(text->text);
  *text = (pb_text){0};
  return st;
}

static pb_status compile(pb_bench_model *b, pb_warnings *warnings, pb_error *err) {
  pb_system *system = NULL;
  pb_status st = pb_system_assemble(b->plant, warnings, &system, err);
  if (!st) st = pb_model_compile(system, warnings, &b->model, err);
  pb_system_free(system);
  return st;
}

// ---- actuators ----------------------------------------------------------------------------------

// What the bench needs to know of the actuator before it can be described.
typedef struct actuator {
  const pb_element_source *source;
  bool element;
  bool voltage, sensor, inner;  // has g_a, g_s, and a place for a force inside
  char stack[2][256];           // names of the outermost ends of an element's stacks; empty: none
  double axis[3];
  double top[3];  // m
} actuator;

// The frames at the two ends of all stacks together.
static void outermost(const pb_plant *plant, const pb_component *c, actuator *out) {
  const pb_stack *stack[2] = {&c->super.actuator, &c->super.sensor};
  double low = INFINITY, high = -INFINITY;
  memcpy(out->axis, c->super.actuator.axis, sizeof out->axis);
  for (int k = 0; k < 2; k++)
    for (int i = 0; i < 2 && stack[k]->present; i++) {
      double p[3], along = 0;
      pb_frame_position(plant, (pb_anchor){0, stack[k]->frame[i]}, p);
      for (int a = 0; a < 3; a++) along += out->axis[a] * p[a];
      const char *name = c->frame[stack[k]->frame[i]].name;
      if (along < low) low = along, snprintf(out->stack[0], sizeof out->stack[0], "%s", name);
      if (along > high) high = along, snprintf(out->stack[1], sizeof out->stack[1], "%s", name);
    }
}

// A name inside a JSON string.
static void add_name(pb_text *text, const char *name) {
  for (; *name; name++) {
    if ((unsigned char)*name < ' ')
      pb_text_format(text, "\\u%04x", (unsigned)*name);
    else
      pb_text_format(text, *name == '"' || *name == '\\' ? "\\%c" : "%c", *name);
  }
}

static void add_signals(pb_text *text, const actuator *a, const char *top) {
  pb_text_append(text, ",\"inputs\":[");
  if (a->voltage)
    pb_text_append(text, "{\"name\":\"Va\",\"type\":\"actuator_voltage\",\"component\":\"part\"},");
  if (a->inner)
    pb_text_append(text, "{\"name\":\"f\",\"type\":\"actuator_force\",\"component\":\"part\"},");
  pb_text_format(text,
                 "{\"name\":\"F\",\"type\":\"force\",\"frame\":\"%s\",\"direction\":[0,0,1]}],"
                 "\"outputs\":[",
                 top);
  if (a->sensor)
    pb_text_append(text, "{\"name\":\"Vs\",\"type\":\"sensor_voltage\",\"component\":\"part\"},");
  if (a->stack[0][0]) {
    pb_text_append(text, "{\"name\":\"e\",\"type\":\"relative_displacement\",\"from\":\"part.");
    add_name(text, a->stack[0]);
    pb_text_append(text, "\",\"to\":\"part.");
    add_name(text, a->stack[1]);
    pb_text_format(text, "\",\"direction\":[%.17g,%.17g,%.17g]},", a->axis[0], a->axis[1],
                   a->axis[2]);
  }
  pb_text_format(text,
                 "{\"name\":\"y\",\"type\":\"displacement\",\"frame\":\"%s\",\"direction\":[0,0,1]}"
                 "]}",
                 top);
}

static bool is_element(const pb_element_source *source) {
  const cJSON *type = pb_json_member(source->model, "type");
  return cJSON_IsString(type) && !strcmp(type->valuestring, "super_element");
}

static pb_status look(const pb_element_source *source, actuator *out, pb_error *err) {
  pb_text text = {0};
  pb_plant *plant = NULL;
  *out = (actuator){.source = source, .element = is_element(source)};
  if (out->element && !pb_json_member(source->model, "ends"))
    return pb_fail(err, PB_ERR_SCHEMA, source->name,
                   "the element has no \"ends\": which frames are its bottom and its top?");
  pb_status st = begin(source, 0, &text, err);
  if (!st) {
    pb_text_append(&text, ",\"components\":{\"part\":{\"model\":\"part\"}}");
    add_signals(&text, out, "part.top");
    st = parse(source, &text, NULL, &plant, err);
  }
  if (st) return st;
  const pb_component *c = &plant->component[0];
  pb_frame_position(plant, (pb_anchor){0, (size_t)pb_component_frame(c, "top")}, out->top);
  out->voltage = (out->element ? c->super.g_a : c->strut.g_a) != 0;
  out->sensor = (out->element ? c->super.g_s : c->strut.g_s) != 0;
  out->inner = !out->element || c->super.actuator.present;
  if (out->element && c->super.actuator.present) outermost(plant, c, out);
  pb_plant_free(plant);
  return PB_OK;
}

static void add_load(pb_text *text, const actuator *a, double load) {
  char number[4][32];
  for (int i = 0; i < 3; i++) pb_text_number(number[i], sizeof number[i], a->top[i]);
  pb_text_number(number[3], sizeof number[3], load);
  pb_text_format(text,
                 ",\"components\":{\"part\":{\"model\":\"part\"},\"load\":{\"type\":\"rigid_body\","
                 "\"mass\":%s,\"inertia\":[0.01,0.01,0.01],\"position\":[%s,%s,%s]}},"
                 "\"connections\":{"
                 "\"mount\":{\"from\":\"part.top\",\"to\":\"load\",\"joint\":{\"type\":\"weld\"}},",
                 number[3], number[0], number[1], number[2]);
  // The halves of a lumped actuator are a guide by themselves.
  if (a->element)
    pb_text_append(text, "\"guide\":{\"from\":\"ground\",\"to\":\"load\",\"joint\":{\"type\":"
                         "\"prismatic\"}},");
}

// The source with its actuator stacks from one outermost end to the other.
static pb_status span_stacks(const actuator *a, pb_element_source *out, pb_error *err) {
  cJSON *patch = cJSON_CreateObject(), *stacks, *stack = NULL;
  const char *names[2] = {a->stack[0], a->stack[1]};
  cJSON *frames = cJSON_CreateStringArray(names, 2);
  stacks = patch ? cJSON_AddObjectToObject(patch, "stacks") : NULL;
  stack = stacks ? cJSON_AddObjectToObject(stacks, "actuator") : NULL;
  pb_status st = PB_OK;
  if (stack && frames && cJSON_AddItemToObject(stack, "frames", frames)) {
    st = pb_element_source_patch(a->source, patch, out, err);
  } else {
    cJSON_Delete(frames);
    st = pb_fail_memory(err, a->source->name);
  }
  cJSON_Delete(patch);
  return st;
}

pb_status pb_actuator_bench_build(const pb_element_source *source, const pb_actuator_bench *bench,
                                  pb_warnings *warnings, pb_bench_model *out, pb_error *err) {
  actuator a;
  pb_element_source spanned = {0};
  pb_text text = {0};
  *out = (pb_bench_model){0};
  pb_status st = look(source, &a, err);
  if (!st && bench->all_stacks && a.stack[0][0]) {
    st = span_stacks(&a, &spanned, err);
    source = &spanned;
  }
  if (!st) st = begin(source, bench->sample_rate, &text, err);
  if (!st) {
    if (bench->load > 0)
      add_load(&text, &a, bench->load);
    else
      pb_text_append(&text, ",\"components\":{\"part\":{\"model\":\"part\"}},\"connections\":{");
    pb_text_append(&text,
                   "\"base\":{\"from\":\"ground\",\"to\":\"part.bottom\",\"joint\":{\"type\":"
                   "\"weld\"}}}");
    add_signals(&text, &a, bench->load > 0 ? "load" : "part.top");
    st = parse(source, &text, warnings, &out->plant, err);
  }
  if (!st) st = compile(out, warnings, err);
  if (st) pb_bench_model_clear(out);
  pb_element_source_clear(&spanned);
  return st;
}

// ---- joints -------------------------------------------------------------------------------------

static void add_joint_signals(pb_text *text) {
  static const char *const axis[] = {"x", "y", "z"};
  static const char *const direction[] = {"[1,0,0]", "[0,1,0]", "[0,0,1]"};
  for (int output = 0; output < 2; output++) {
    pb_text_append(text, output ? "],\"outputs\":[" : ",\"inputs\":[");
    for (int i = 0; i < 6; i++)
      pb_text_format(text,
                     "%s{\"name\":\"%c%s\",\"type\":\"%s\",\"frame\":\"body\",\"direction\":%s}",
                     i ? "," : "", output ? (i < 3 ? 'D' : 'R') : (i < 3 ? 'F' : 'M'), axis[i % 3],
                     output ? (i < 3 ? "displacement" : "rotation") : (i < 3 ? "force" : "torque"),
                     direction[i % 3]);
  }
  pb_text_append(text, "]}");
}

pb_status pb_joint_bench_build(const pb_element_source *source, double mass, pb_warnings *warnings,
                               pb_bench_model *out, pb_error *err) {
  pb_text text = {0};
  const double inertia = 0.4 * mass * 0.01 * 0.01;
  *out = (pb_bench_model){0};
  pb_status st = begin(source, 0, &text, err);
  if (st) return st;
  pb_text_format(&text,
                 ",\"components\":{\"body\":{\"type\":\"rigid_body\",\"mass\":%.17g,\"inertia\":"
                 "[%.17g,%.17g,%.17g]}},\"connections\":{\"joint\":{\"from\":\"ground\",\"to\":"
                 "\"body\",\"joint\":{\"model\":\"part\"}}}",
                 mass, inertia, inertia, inertia);
  add_joint_signals(&text);
  st = parse(source, &text, warnings, &out->plant, err);
  if (!st) st = compile(out, warnings, err);
  if (st) pb_bench_model_clear(out);
  return st;
}

// ---- what a bench says --------------------------------------------------------------------------

pb_status pb_bench_gain(const pb_bench_model *b, const char *input, const char *output,
                        double *gain, pb_error *err) {
  const pb_model *m = b->model;
  const int i = pb_model_input(m, input), o = pb_model_output(m, output);
  *gain = NAN;
  if (i < 0 || o < 0) return PB_OK;
  double *all = malloc(m->nu * m->ny * sizeof *all);
  if (!all) return pb_fail_memory(err, "gain");
  pb_status st = pb_model_dc(m, all, err);
  if (!st) *gain = all[(size_t)o * m->nu + (size_t)i];
  free(all);
  return st;
}

// −c A⁻¹ b of a 2 × 2 block.
static double static_part(const pb_model *m, size_t block, size_t input, size_t output) {
  const double *a = m->a + m->block_value[block];
  const size_t x = m->block_start[block];
  const double b0 = m->b[x + input * m->nx], b1 = m->b[x + 1 + input * m->nx];
  const double det = a[0] * a[3] - a[1] * a[2];
  const double x0 = (a[3] * b0 - a[2] * b1) / det, x1 = (a[0] * b1 - a[1] * b0) / det;
  return -(m->c[output + x * m->ny] * x0 + m->c[output + (x + 1) * m->ny] * x1);
}

void pb_bench_first_mode(const pb_bench_model *b, const char *input, const char *output,
                         double share, double *hz, double *damping) {
  const pb_model *m = b->model;
  const int i = pb_model_input(m, input), o = pb_model_output(m, output);
  *hz = *damping = NAN;
  if (i < 0 || o < 0) return;
  double total = m->d[(size_t)o + (size_t)i * m->ny], lowest = INFINITY;
  for (size_t k = 0; k < m->pairs; k++) total += static_part(m, k, (size_t)i, (size_t)o);
  for (size_t k = 0; k < m->pairs; k++) {
    const double *a = m->a + m->block_value[k], mean = 0.5 * (a[0] + a[3]);
    const double square = a[0] * a[3] - a[1] * a[2];
    if (!(square > mean * mean)) continue;  // overdamped: no resonance
    const double omega = sqrt(square);
    if (omega >= lowest || fabs(static_part(m, k, (size_t)i, (size_t)o)) < share * fabs(total))
      continue;
    lowest = omega;
    *hz = omega / 6.283185307179586476925286766559;
    *damping = -mean / omega;
  }
}
