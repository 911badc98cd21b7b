// What the files of a variation share.
#ifndef PB_STUDY_VARIATION_INTERNAL_H
#define PB_STUDY_VARIATION_INTERNAL_H

#include "study/variation.h"

// Sets or replaces a member of an object; takes the value over (NULL: out of memory).
pb_status pb_object_put(cJSON *object, const char *key, cJSON *value, pb_error *err);
pb_status pb_object_put_number(cJSON *object, const char *key, double value, pb_error *err);

// The template with the actuator that a value of actuator-model names. Fails as pb_variation_apply.
pb_status pb_vary_actuator_model(const cJSON *file, cJSON *template, const char *name,
                                 pb_error *err);

#endif
