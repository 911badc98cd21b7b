// A joint or an actuator of the template "nano_hexapod", written out.
#ifndef PB_STUDY_TEMPLATE_PART_H
#define PB_STUDY_TEMPLATE_PART_H

#include "base/json.h"
#include "study/joint_character.h"

// The model NAME of a plant file; it stays the file's. [any] PB_ERR_REFERENCE.
pb_status pb_file_model_find(const cJSON *file, const char *name, const cJSON **out, pb_error *err);

// The template of a plant file; it stays the file's. [any] PB_ERR_STATE: there is none.
pb_status pb_template_find(const cJSON *file, const cJSON **out, pb_error *err);

// What "key" of the template (actuator, bottom_joint, top_joint) names, as one object with the keys
// of its model in it. *out is the caller's (cJSON_Delete). [init] PB_ERR_STATE, PB_ERR_REFERENCE,
// PB_ERR_MEMORY.
pb_status pb_template_part(const cJSON *file, const char *key, cJSON **out, pb_error *err);

// The same as something to characterise; element files are relative to directory. *out is the
// caller's (pb_element_source_clear). [init] Fails as pb_template_part.
pb_status pb_template_source(const cJSON *file, const char *key, const char *directory,
                             pb_element_source *out, pb_error *err);

// The six stiffnesses of a joint of the template, by its keys or by an element's matrices; infinite
// where it is locked. [init] Fails as pb_template_source, pb_joint_characterize.
pb_status pb_template_joint(const cJSON *file, const char *key, const char *directory, double k[6],
                            pb_error *err);

// Its "type", or "" where it has none. [any]
const char *pb_part_type(const cJSON *part);

#endif
