// What the tests of studies share: the shipped plants, and points of them with one thing varied.
#ifndef PB_TESTS_STUDY_RIG_H
#define PB_TESTS_STUDY_RIG_H

#include "study/point.h"
#include "study/variation.h"
#include "support/check.h"

#define HEXAPOD PB_CONFIG "/plants/nano-hexapod.json"
#define HEXAPOD_1DOF PB_CONFIG "/plants/nano-hexapod-1dof.json"

// A plant file; owned (cJSON_Delete).
cJSON *rig_file(const char *path);

// The file with one thing varied; owned. The stiffnesses of joint models are the plant's.
cJSON *rig_vary(const cJSON *file, pb_study_kind kind, const char *value);

// The same analysed; owned (pb_study_point_clear).
pb_study_point rig_point(const cJSON *file, pb_study_kind kind, const char *value);

#endif
