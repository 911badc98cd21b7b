// The template "nano_hexapod" as its file gives it, and with the struts placed.
#ifndef PB_PLANT_TEMPLATE_H
#define PB_PLANT_TEMPLATE_H

#include "plant/loader.h"

typedef struct pb_hexapod_geometry {
  double base_radius, base_half_angle, base_height;
  double top_radius, top_half_angle, top_height;
} pb_hexapod_geometry;

typedef struct pb_hexapod_solid {
  double mass, radius, height, center_height;
} pb_hexapod_solid;

typedef struct pb_hexapod_strut {
  double bottom[3], top[3];  // joint centres, m
  double z[3], x[3];         // axes
  double length;             // joint to joint, m
} pb_hexapod_strut;

// Electronics for all signals of one kind, as the file gives them; NULL: none.
typedef struct pb_hexapod_electronics {
  const cJSON *actuators;  // Va…, f…
  const cJSON *sensors;    // Vs…, fm…
  const cJSON *metrology;  // dL…, Dx … Rz
} pb_hexapod_electronics;

typedef struct pb_hexapod {
  pb_hexapod_geometry geometry;
  pb_hexapod_solid platform, payload;
  bool has_payload;
  double point_of_interest_height;
  const cJSON *actuator, *bottom_joint, *top_joint;  // model names or objects
  const char *actuator_type;
  pb_hexapod_electronics electronics;
  double half_height;  // of a super-element actuator
  double ends[2];      // its end nodes, 1-based as in the file
  pb_hexapod_strut strut[6];
} pb_hexapod;

// Reads the "template" of a plant file and places the struts. Errors name the place. [init]
pb_status pb_hexapod_read(const cJSON *file, pb_hexapod *out, pb_error *err);

#endif
