// An actuator in the figures of a data sheet: see actuator_character.h.
#include "study/actuator_character.h"

#include <math.h>

#include "assembly/motion.h"
#include "plant/boundary.h"

static double distance(const pb_component *c, const pb_plant *plant, size_t a, size_t b) {
  const int part = (int)(c - plant->component);
  double p[3], q[3];
  pb_frame_position(plant, (pb_anchor){part, a}, p);
  pb_frame_position(plant, (pb_anchor){part, b}, q);
  return hypot(hypot(p[0] - q[0], p[1] - q[1]), p[2] - q[2]);
}

// Stacks of the nominal length in the actuator's and the sensor's span.
static size_t count_stacks(const pb_component *c, const pb_plant *plant, double length) {
  double sum = 0;
  const pb_stack *stack[2] = {&c->super.actuator, &c->super.sensor};
  for (int k = 0; k < 2; k++)
    if (stack[k]->present) sum += distance(c, plant, stack[k]->frame[0], stack[k]->frame[1]);
  return (size_t)lround(sum / length);
}

static pb_status element_figures(const pb_component *c, pb_actuator_character *out, pb_error *err) {
  out->mass = c->super.element->health.mass;
  if (!c->super.sensor.present) return PB_OK;
  const pb_stack *s = &c->super.sensor;
  const size_t node[2] = {c->frame[s->frame[0]].node, c->frame[s->frame[1]].node};
  return pb_element_stack_stiffness(c->super.element, node, s->axis, &out->stack_stiffness, err);
}

static pb_status amplification(const pb_element_source *source, const pb_component *c,
                               const pb_plant *plant, const pb_stack_nominal *nominal,
                               pb_warnings *warnings, pb_actuator_character *out, pb_error *err) {
  pb_bench_model spanned;
  double top, stacks;
  const pb_actuator_bench options = {.all_stacks = true};
  out->stacks = nominal->count ? nominal->count : count_stacks(c, plant, nominal->length);
  pb_status st = pb_actuator_bench_build(source, &options, warnings, &spanned, err);
  if (st) return st;
  st = pb_bench_gain(&spanned, "f", "y", &top, err);
  if (!st) st = pb_bench_gain(&spanned, "f", "e", &stacks, err);
  pb_bench_model_clear(&spanned);
  if (st) return st;
  out->amplification = fabs(top / stacks);
  out->stroke = (double)out->stacks * nominal->stroke * out->amplification;
  out->blocked_force = out->stroke * out->stiffness;
  return PB_OK;
}

pb_status pb_actuator_characterize(const pb_element_source *source, const pb_stack_nominal *nominal,
                                   pb_warnings *warnings, pb_bench_model *bench,
                                   pb_actuator_character *out, pb_error *err) {
  const pb_actuator_bench options = {0};
  double compliance = NAN;
  *out = (pb_actuator_character){
      .amplification = NAN, .stack_stiffness = NAN, .stroke = NAN, .blocked_force = NAN};
  pb_status st = pb_actuator_bench_build(source, &options, warnings, bench, err);
  if (st) return st;
  const pb_component *c = pb_bench_part(bench);
  st = pb_bench_gain(bench, "F", "y", &compliance, err);
  if (!st) st = pb_bench_gain(bench, "Va", "y", &out->voltage_gain, err);
  if (!st) st = pb_bench_gain(bench, "Va", "Vs", &out->sensor_gain, err);
  if (!st) st = pb_bench_gain(bench, "F", "Vs", &out->sensor_of_force, err);
  out->stiffness = 1 / compliance;
  pb_bench_first_mode(bench, "F", "y", 0.2, &out->resonance, &out->damping);
  out->height = distance(c, bench->plant, (size_t)pb_component_frame(c, "bottom"),
                         (size_t)pb_component_frame(c, "top"));
  if (c->type != PB_SUPER_ELEMENT)
    out->mass = c->strut.mass + c->strut.intermediate_mass;
  else if (!st)
    st = element_figures(c, out, err);
  if (!st && c->type == PB_SUPER_ELEMENT && c->super.actuator.present)
    st = amplification(source, c, bench->plant, nominal, warnings, out, err);
  if (st) pb_bench_model_clear(bench);
  return st;
}
