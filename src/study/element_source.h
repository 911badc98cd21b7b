// What is characterised: the model of an actuator or of a joint, out of a plant file or around an
// element file.
#ifndef PB_STUDY_ELEMENT_SOURCE_H
#define PB_STUDY_ELEMENT_SOURCE_H

#include <stdbool.h>

#include "base/json.h"
#include "base/status.h"

typedef struct pb_element_source {
  cJSON *model;       // keys of a component or of a joint of the plant file, without its place
  char *directory;    // of the model's relative element path; NULL: the working directory
  char *name;         // of the model, or the element file's without path and ending
} pb_element_source;  // zero-initialise; free with pb_element_source_clear

// How an element file's interface frames are used: the layout of an amplified actuator.
typedef struct pb_actuator_layout {
  size_t ends[2];      // bottom, top: interface frames from 1 on
  size_t actuator[2];  // first and last frame of the actuator stacks
  size_t sensor[2];    // of the sensor stack; 0: none
  double axis[3];      // of the stacks, part axes
  double polarity;     // −1: the part gets shorter as its stacks expand
  double g_a, g_s;     // N/V, V/m
  double modal_damping;
} pb_actuator_layout;

// The seven frames of an amplified actuator of three stacks: bottom, top, two ends of the sensor
// stack, then three of the two actuator stacks, along x. Piezo constants of Table 1.4. [any]
pb_actuator_layout pb_actuator_layout_default(void);

// Model NAME of a plant file's text; with NULL the only one of its models that `wanted` accepts.
// `file` is for messages, directory for element paths. Fails with PB_ERR_SYNTAX, PB_ERR_REFERENCE
// (no such model; none or several that would do, which are named), PB_ERR_MEMORY. [init]
typedef bool pb_element_wanted(const cJSON *model);
pb_status pb_element_source_plant(const char *text, const char *file, const char *directory,
                                  const char *name, pb_element_wanted *wanted,
                                  pb_element_source *out, pb_error *err);

// Models that are an actuator (apa_2dof, strut_1dof, a super_element with stacks), or a joint.
// [any]
pb_element_wanted pb_element_is_actuator, pb_element_is_joint;

// An element file as an actuator of this layout, or as a joint between two of its frames (nodes
// [at from, at to], from 1 on). Fails with PB_ERR_MEMORY. [init]
pb_status pb_element_source_actuator(const char *path, const pb_actuator_layout *layout,
                                     pb_element_source *out, pb_error *err);
pb_status pb_element_source_joint(const char *path, const size_t nodes[2], double modal_damping,
                                  pb_element_source *out, pb_error *err);

// A copy with a JSON merge patch (RFC 7396) on the model. Fails with PB_ERR_MEMORY. [init]
pb_status pb_element_source_patch(const pb_element_source *source, const cJSON *patch,
                                  pb_element_source *out, pb_error *err);

void pb_element_source_clear(pb_element_source *source);

#endif
