// A plant as its file describes it: components, connections and signals, validated, with elements
// loaded and the template expanded. Immutable after loading. SI units without prefixes.
// The schema "plantbus.plant/1" is described in the README and config/plants.
#ifndef PB_PLANT_PLANT_H
#define PB_PLANT_PLANT_H

#include <stdbool.h>
#include <stddef.h>

#include "base/status.h"
#include "model/electronics.h"
#include "plant/element.h"
#include "plant/element_store.h"

#define PB_MAX_INPUTS 32  // of the bus's Sample and Command types
#define PB_MAX_OUTPUTS 64

typedef struct pb_pose {
  double position[3];  // m, world
  double rotation[9];  // column-major 3 × 3, columns are the part's x, y, z in world axes
} pb_pose;

typedef struct pb_frame {
  char *name;
  double
      position[3];  // rigid_body: in body axes; apa_2dof, strut_1dof: on z; super_element: offset
  size_t node;      // super_element: interface frame, 0-based
  int half;         // apa_2dof, strut_1dof: 0 lower, 1 upper half
} pb_frame;

typedef enum pb_component_type {
  PB_RIGID_BODY,
  PB_SUPER_ELEMENT,
  PB_APA_2DOF,
  PB_STRUT_1DOF,
} pb_component_type;

typedef struct pb_rigid_body {
  double mass;        // kg
  double inertia[9];  // kg m², about the centre of mass, body axes, column-major
  double center[3];   // centre of mass, body axes, m
} pb_rigid_body;

// Keys of apa_2dof (report 2.4) and strut_1dof; what a type does not have is 0.
typedef struct pb_strut {
  double k_1, c_1;           // shell (strut_1dof: k, c), N/m, Ns/m
  double k_a, c_a;           // actuator stacks
  double k_e, c_e;           // sensor stack
  double g_a, g_s;           // N/V, V/m
  double mass;               // kg, both halves
  double intermediate_mass;  // kg
  double radius, length;     // m
} pb_strut;

typedef struct pb_stack {
  bool present;
  size_t frame[2];  // indices into the component's frames
  double axis[3];   // unit vector, part axes
} pb_stack;

typedef struct pb_super_element {
  pb_element *element;
  double modal_damping;  // ξ
  double alpha, beta;    // Rayleigh: C = αM + βK
  pb_stack actuator, sensor;
  double g_a, g_s;     // N/V, V/m
  double polarity;     // +1 or −1
  size_t ends[2];      // bottom and top interface frames, 0-based
  double half_height;  // m; 0: not given
  bool has_ends;
} pb_super_element;

// What the electrodes of a sensor stack are connected to. [report 2.5]
typedef enum pb_boundary_kind {
  PB_BOUNDARY_SHORT,     // one another, or a charge amplifier: the stack has its short-circuit
                         // stiffness
  PB_BOUNDARY_OPEN,      // nothing, or a voltage amplifier
  PB_BOUNDARY_RESISTOR,  // one another through a resistor
} pb_boundary_kind;

typedef struct pb_boundary {
  pb_boundary_kind kind;
  double coupling;     // k_33, 0 … 1
  double capacitance;  // F, of the free stack
  double resistance;   // Ohm
  double stiffness;    // N/m, of the short-circuited stack
} pb_boundary;

typedef struct pb_component {
  char *name;
  char *pointer;  // JSON pointer, for messages
  pb_component_type type;
  pb_pose pose;
  size_t frame_count;
  pb_frame *frame;
  pb_boundary boundary;  // apa_2dof, super_element
  union {
    pb_rigid_body body;
    pb_strut strut;
    pb_super_element super;
  };
} pb_component;

// One end of a connection, or the frame of a signal.
typedef struct pb_anchor {
  int component;  // index, −1: ground
  size_t frame;
} pb_anchor;

typedef enum pb_joint_type {
  PB_WELD,
  PB_UNIVERSAL,
  PB_SPHERICAL,
  PB_UNIVERSAL_AXIAL,
  PB_SPHERICAL_AXIAL,
  PB_BUSHING,
  PB_PRISMATIC,
  PB_JOINT_ELEMENT,
} pb_joint_type;

typedef struct pb_joint {
  pb_joint_type type;
  bool locked[6];          // x y z rx ry rz in joint axes: a constraint
  double k[6], c[6];       // of the free directions
  pb_super_element super;  // PB_JOINT_ELEMENT: element and damping
  size_t node[2];          // PB_JOINT_ELEMENT: interface frame at from, at to, 0-based
} pb_joint;

typedef struct pb_connection {
  char *name;
  char *pointer;
  pb_anchor from, to;
  pb_joint joint;
  double rotation[9];  // joint axes in world axes
} pb_connection;

typedef enum pb_signal_type {
  PB_ACTUATOR_VOLTAGE,
  PB_ACTUATOR_FORCE,
  PB_FORCE,
  PB_TORQUE,
  PB_SENSOR_VOLTAGE,
  PB_SENSOR_FORCE,
  PB_STRUT_ELONGATION,
  PB_DISPLACEMENT,
  PB_ROTATION,
  PB_VELOCITY,
  PB_ACCELERATION,
  PB_RELATIVE_DISPLACEMENT,
} pb_signal_type;

typedef struct pb_port {
  char *name;
  char *pointer;
  pb_signal_type type;
  int component;        // actuator and sensor signals
  pb_anchor frame;      // the others; `to` of relative_displacement
  pb_anchor from;       // relative_displacement
  double direction[3];  // unit vector, world axes
  bool has_electronics;
  pb_electronics electronics;
} pb_port;

typedef struct pb_plant {
  char *name;
  char *text;  // the plant file in canonical form, element paths made absolute; loads again as is
  double sample_rate;    // Hz
  double max_frequency;  // Hz; 0: null in the file
  size_t component_count, connection_count, input_count, output_count;
  pb_component *component;
  pb_connection *connection;
  pb_port *input, *output;
} pb_plant;

// Reads a plant file; element paths are relative to it. [init]
// Fails with PB_ERR_IO, PB_ERR_SYNTAX, PB_ERR_SCHEMA, PB_ERR_REFERENCE, PB_ERR_GEOMETRY,
// PB_ERR_ELEMENT, PB_ERR_MEMORY; err->where is the JSON pointer of the offender.
pb_status pb_plant_load(const char *path, pb_warnings *warnings, pb_plant **out, pb_error *err);

// The same from a text; element paths are relative to directory (NULL: the working directory).
// [init]
pb_status pb_plant_parse(const char *text, size_t length, const char *directory,
                         pb_warnings *warnings, pb_plant **out, pb_error *err);

// The same with elements that `store` (NULL: none) kept of plants read before; those read now are
// kept in it. Their warnings are given again, notes on their health only as they are read. [init]
pb_status pb_plant_parse_stored(const char *text, size_t length, const char *directory,
                                pb_element_store *store, pb_warnings *warnings, pb_plant **out,
                                pb_error *err);

void pb_plant_free(pb_plant *plant);

// SI unit of a signal type: "V", "N", "Nm", "m", "rad", "m/s", "m/s^2". [any]
const char *pb_signal_unit(pb_signal_type type);

// Frame of a component by name, or −1 (also for "origin", which only a rigid body has). [any]
int pb_component_frame(const pb_component *component, const char *name);

#endif
