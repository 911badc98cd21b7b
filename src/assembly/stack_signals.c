// Signals in stacked coordinates: where inputs push, and what outputs see.
//
// A voltage on an actuator is a force ±g_a V on the two ends of its actuator stacks; a sensor
// voltage is g_s times the elongation of the sensor stack. With `polarity` −1 (an amplified
// actuator that gets shorter as its stacks expand) both change sign, so that V_a > 0 extends the
// strut and V_s > 0 is tension.  [report 1.2, 2.4]
#include <math.h>

#include "assembly/stack.h"
#include "plant/boundary.h"

// column += gain × (direction · translation or rotation of the frame)
static void add_direction(double *column, const pb_motion *m, int first, const double direction[3],
                          double gain) {
  for (size_t i = 0; i < m->count; i++)
    for (int a = 0; a < 3; a++)
      column[m->column[i]] += gain * direction[a] * m->value[first + a][i];
}

// column += gain × elongation between two frames of a component along an axis in part axes
static void add_elongation(double *column, const pb_plant *plant, const pb_layout *layout,
                           int component, const size_t frame[2], const double axis[3],
                           double gain) {
  const double *r = plant->component[component].pose.rotation;
  double direction[3] = {0};
  for (int i = 0; i < 3; i++)
    for (int a = 0; a < 3; a++) direction[i] += r[i + 3 * a] * axis[a];
  for (int end = 0; end < 2; end++) {
    pb_motion m;
    pb_motion_frame(plant, layout, (pb_anchor){component, frame[end]}, &m);
    add_direction(column, &m, 0, direction, end ? gain : -gain);
  }
}

static pb_status warn_axis(const pb_plant *plant, const pb_component *c, const pb_stack *stack,
                           int component, pb_warnings *warnings, pb_error *err) {
  double a[3], b[3], along = 0;
  pb_frame_position(plant, (pb_anchor){component, stack->frame[0]}, a);
  pb_frame_position(plant, (pb_anchor){component, stack->frame[1]}, b);
  for (int i = 0; i < 3; i++)
    for (int k = 0; k < 3; k++)
      along += c->pose.rotation[i + 3 * k] * stack->axis[k] * (b[i] - a[i]);
  if (along > 0) return PB_OK;
  return pb_warn(
      warnings, err, c->pointer,
      "a stack's axis does not point from its first frame to its second: the signs of its "
      "force and elongation are as the axis says");
}

static void actuate(const pb_plant *plant, const pb_layout *layout, const pb_port *port,
                    double *column) {
  const pb_component *c = &plant->component[port->component];
  bool voltage = port->type == PB_ACTUATOR_VOLTAGE;
  size_t start = layout->component[port->component];
  if (c->type == PB_SUPER_ELEMENT) {
    double gain = c->super.polarity * (voltage ? c->super.g_a : 1);
    add_elongation(column, plant, layout, port->component, c->super.actuator.frame,
                   c->super.actuator.axis, gain);
  } else if (c->type == PB_APA_2DOF) {
    column[start + 7] +=
        voltage ? c->strut.g_a : 1;  // pushes lower half and intermediate mass apart
  } else {
    column[start + 6] += 1;
  }
}

static void stack_input(const pb_plant *plant, const pb_layout *layout, const pb_port *port,
                        double *column) {
  if (port->type == PB_ACTUATOR_VOLTAGE || port->type == PB_ACTUATOR_FORCE) {
    actuate(plant, layout, port, column);
    return;
  }
  pb_motion m;
  pb_motion_frame(plant, layout, port->frame, &m);
  add_direction(column, &m, port->type == PB_TORQUE ? 3 : 0, port->direction, 1);
}

void pb_stack_sensor_elongation(const pb_plant *plant, const pb_layout *layout, int component,
                                double gain, double *column) {
  const pb_component *c = &plant->component[component];
  size_t start = layout->component[component];
  if (c->type == PB_SUPER_ELEMENT) {
    add_elongation(column, plant, layout, component, c->super.sensor.frame, c->super.sensor.axis,
                   gain);
  } else {
    column[start + 6] += gain;
    column[start + 7] -= gain;
  }
}

// The voltage over a resistor is that of the part of the elongation that has not relaxed.
static void sense_voltage(const pb_plant *plant, const pb_layout *layout, const pb_port *port,
                          double *column) {
  const pb_component *c = &plant->component[port->component];
  const double gain = c->type == PB_SUPER_ELEMENT ? c->super.polarity * c->super.g_s : c->strut.g_s;
  pb_stack_sensor_elongation(plant, layout, port->component, gain, column);
  if (c->boundary.kind == PB_BOUNDARY_RESISTOR)
    column[layout->component[port->component] + pb_component_motions(c)] -= gain;
}

// strut_1dof: the sensor in series with k, c and f measures f_m = k d + c ḋ − f. apa_2dof: the
// force in the sensor stack, k_e d_e + c_e ḋ_e.
static void sense_force(const pb_plant *plant, const pb_layout *layout, const pb_port *port,
                        size_t output, pb_stack_equations *s) {
  const pb_component *c = &plant->component[port->component];
  size_t start = layout->component[port->component];
  double *y0 = s->y[0] + output * s->n, *y1 = s->y[1] + output * s->n;
  if (c->type == PB_APA_2DOF) {
    const double more = pb_boundary_stiffening(&c->boundary), k = c->strut.k_e + more;
    y0[start + 6] += k, y0[start + 7] -= k;
    if (c->boundary.kind == PB_BOUNDARY_RESISTOR) y0[start + pb_component_motions(c)] -= more;
    y1[start + 6] += c->strut.c_e, y1[start + 7] -= c->strut.c_e;
    return;
  }
  y0[start + 6] += c->strut.k_1;
  y1[start + 6] += c->strut.c_1;
  for (size_t i = 0; i < plant->input_count; i++) {
    const pb_port *input = &plant->input[i];
    if (input->type == PB_ACTUATOR_FORCE && input->component == port->component)
      s->d[output + i * s->ny] -= 1;
  }
}

static void sense_elongation(const pb_plant *plant, const pb_layout *layout, const pb_port *port,
                             double *column) {
  const pb_component *c = &plant->component[port->component];
  const double z[3] = {0, 0, 1};
  if (c->type == PB_SUPER_ELEMENT) {
    add_elongation(column, plant, layout, port->component, c->super.ends, z, 1);
  } else {
    column[layout->component[port->component] + 6] += 1;
  }
}

static void stack_output(const pb_plant *plant, const pb_layout *layout, const pb_port *port,
                         size_t output, pb_stack_equations *s) {
  double *y0 = s->y[0] + output * s->n;
  pb_motion m;
  switch (port->type) {
  case PB_SENSOR_VOLTAGE:
    sense_voltage(plant, layout, port, y0);
    return;
  case PB_SENSOR_FORCE:
    sense_force(plant, layout, port, output, s);
    return;
  case PB_STRUT_ELONGATION:
    sense_elongation(plant, layout, port, y0);
    return;
  default:
    break;
  }
  int order = port->type == PB_VELOCITY ? 1 : port->type == PB_ACCELERATION ? 2 : 0;
  double *column = s->y[order] + output * s->n;
  pb_motion_frame(plant, layout, port->frame, &m);
  add_direction(column, &m, port->type == PB_ROTATION ? 3 : 0, port->direction, 1);
  if (port->type != PB_RELATIVE_DISPLACEMENT) return;
  pb_motion_frame(plant, layout, port->from, &m);
  add_direction(column, &m, 0, port->direction, -1);
}

pb_status pb_stack_signals(const pb_plant *plant, const pb_layout *layout, pb_warnings *warnings,
                           pb_stack_equations *s, pb_error *err) {
  for (size_t i = 0; i < plant->component_count; i++) {
    const pb_component *c = &plant->component[i];
    if (c->type != PB_SUPER_ELEMENT) continue;
    const pb_stack *stack[2] = {&c->super.actuator, &c->super.sensor};
    for (int k = 0; k < 2; k++) {
      if (!stack[k]->present) continue;
      pb_status st = warn_axis(plant, c, stack[k], (int)i, warnings, err);
      if (st) return st;
    }
  }
  for (size_t i = 0; i < plant->input_count; i++)
    stack_input(plant, layout, &plant->input[i], s->f + i * s->n);
  for (size_t i = 0; i < plant->output_count; i++)
    stack_output(plant, layout, &plant->output[i], i, s);
  return PB_OK;
}
