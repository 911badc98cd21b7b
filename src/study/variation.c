// One thing varied over a plant: see variation.h.
#include "study/variation.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "study/template_part.h"
#include "study/variation_internal.h"

static const pb_study_kind_facts kinds[PB_STUDY_KINDS] = {
    [PB_STUDY_BENDING] = {"bending", "k_f", "Nm/rad", "0,50,100,500"},
    [PB_STUDY_TORSION] = {"torsion", "k_t", "Nm/rad", "0,100,500,1000"},
    [PB_STUDY_AXIAL] = {"axial", "k_a", "N/m", "1e6,1e7,1e8,1e9,inf"},
    [PB_STUDY_MASS] = {"mass", "payload", "kg", "1,25,50"},
    [PB_STUDY_JOINT_MODEL] = {"joint-model", "joints", NULL, "ideal,bending,axial,plant"},
    [PB_STUDY_ACTUATOR_MODEL] = {"actuator-model", "actuator", NULL, "1dof,2dof,plant"},
};

const pb_study_kind_facts *pb_study_kind_of(pb_study_kind kind) {
  return &kinds[kind];
}

pb_status pb_variation_number(const pb_variation *v, double *out, pb_error *err) {
  const pb_study_kind_facts *facts = pb_study_kind_of(v->kind);
  char *end;
  *out = NAN;
  if (!facts->unit) return PB_OK;
  if (v->kind == PB_STUDY_AXIAL && !strcmp(v->text, "inf")) {
    *out = INFINITY;
    return PB_OK;
  }
  errno = 0;
  double value = strtod(v->text, &end);
  // strtod alone also takes blanks and hexadecimal.
  bool plain = !v->text[strspn(v->text, "+-.0123456789eE")];
  bool good = plain && end != v->text && !*end && isfinite(value) && errno == 0;
  bool positive = v->kind == PB_STUDY_AXIAL;
  if (!good || value < 0 || (positive && value == 0)) {
    return pb_fail(err, PB_ERR_ARGUMENT, facts->name, "'%s' is not a number %s 0 in %s%s", v->text,
                   positive ? "above" : "of at least", facts->unit, positive ? ", nor inf" : "");
  }
  *out = value;
  return PB_OK;
}

// ---- joints -------------------------------------------------------------------------------------

static const char *const joint_key[2] = {"bottom_joint", "top_joint"};

// Whether a joint of this type has the stiffness, or may be given it.
static bool has_direction(const char *type, pb_study_kind kind) {
  bool bushing = !strcmp(type, "bushing"), spherical = !strncmp(type, "spherical", 9);
  if (kind == PB_STUDY_TORSION) return bushing || spherical;
  return bushing || spherical || !strncmp(type, "universal", 9);
}

// The type with its axial direction free or locked.
static const char *axial_type(const char *type, bool free_axis) {
  if (!strncmp(type, "universal", 9)) return free_axis ? "universal_axial" : "universal";
  if (!strncmp(type, "spherical", 9)) return free_axis ? "spherical_axial" : "spherical";
  return free_axis ? "bushing" : NULL;
}

static pb_status set_axial(cJSON *joint, const char *where, double value, pb_error *err) {
  const char *type = axial_type(pb_part_type(joint), isfinite(value));
  if (!type)
    return pb_fail(err, PB_ERR_STATE, where, "a bushing's axial direction cannot be locked");
  pb_status status = pb_object_put(joint, "type", cJSON_CreateString(type), err);
  if (!status && isfinite(value)) return pb_object_put_number(joint, "k_a", value, err);
  cJSON_DeleteItemFromObjectCaseSensitive(joint, "k_a");
  cJSON_DeleteItemFromObjectCaseSensitive(joint, "c_a");
  return status;
}

static pb_status set_stiffness(cJSON *joint, const char *where, pb_study_kind kind, double value,
                               pb_error *err) {
  if (kind == PB_STUDY_AXIAL) return set_axial(joint, where, value, err);
  return pb_object_put_number(joint, kind == PB_STUDY_BENDING ? "k_f" : "k_t", value, err);
}

// Sets a stiffness in one joint where it has the direction; *changed tells.
static pb_status vary_joint(const cJSON *file, cJSON *template, const char *key, pb_study_kind kind,
                            double value, bool *changed, pb_error *err) {
  char where[64];
  cJSON *joint = NULL;
  pb_json_pointer(where, sizeof where, "/template", key);
  pb_status status = pb_template_part(file, key, &joint, err);
  if (status) return status;
  const char *type = pb_part_type(joint);
  if (!strcmp(type, "super_element"))
    status =
        pb_fail(err, PB_ERR_STATE, where,
                "an element's stiffness cannot be set; joint-model puts a simpler joint in its "
                "place");
  *changed = !status && has_direction(type, kind);
  if (*changed) status = set_stiffness(joint, where, kind, value, err);
  if (*changed && !status) return pb_object_put(template, key, joint, err);
  cJSON_Delete(joint);
  return status;
}

// Both joints, or the one that has the direction.
static pb_status vary_stiffness(const cJSON *file, cJSON *template, pb_study_kind kind,
                                double value, pb_error *err) {
  bool changed[2] = {false, false};
  pb_status status = PB_OK;
  for (int side = 0; side < 2 && !status; side++)
    status = vary_joint(file, template, joint_key[side], kind, value, &changed[side], err);
  if (status || changed[0] || changed[1]) return status;
  return pb_fail(err, PB_ERR_STATE, "/template", "neither joint of the struts has a stiffness %s",
                 pb_study_kind_of(kind)->quantity);
}

// ---- joint models -------------------------------------------------------------------------------

// A simple joint: its types at the bottom and at the top, and the stiffnesses that it has.
static const struct joint_form {
  const char *name, *type[2];
  bool rotations, axial, shear;
} joint_forms[] = {
    {"ideal", {"universal", "spherical"}, false, false, false},
    {"bending", {"universal", "spherical"}, true, false, false},
    {"axial", {"universal_axial", "spherical_axial"}, true, true, false},
    {"bushing", {"bushing", "bushing"}, true, true, true},
};

// The entry of a joint's six stiffnesses that a key stands for, of the stiffer of two axes.
static double stiffness_of(const double k[6], const char *key) {
  switch (key[2]) {
  case 'f':
    return fmax(k[3], k[4]);
  case 't':
    return k[5];
  case 'a':
    return k[2];
  default:
    return fmax(k[0], k[1]);
  }
}

// The stiffness of the file's joint: its key, or what its element's matrices say. NaN: neither.
static pb_status own_stiffness(const cJSON *file, const char *joint, const char *directory,
                               const char *key, double *out, pb_error *err) {
  cJSON *part;
  double k[6];
  pb_status status = pb_template_part(file, joint, &part, err);
  if (status) return status;
  const cJSON *item = pb_json_member(part, key);
  bool element = !strcmp(pb_part_type(part), "super_element");
  *out = cJSON_IsNumber(item) ? item->valuedouble : NAN;
  cJSON_Delete(part);
  if (!element) return PB_OK;
  status = pb_template_joint(file, joint, directory, k, err);
  if (!status) *out = stiffness_of(k, key);
  return status;
}

// A stiffness as told, else as the file's joint has it, else as the other joint of the struts has.
static pb_status take_stiffness(const cJSON *file, const pb_variation *v, int side, const char *key,
                                double given, cJSON *joint, pb_error *err) {
  for (int turn = 0; turn < 2 && isnan(given); turn++) {
    pb_status status =
        own_stiffness(file, joint_key[turn ? 1 - side : side], v->directory, key, &given, err);
    if (status) return status;
  }
  if (isfinite(given)) return pb_object_put_number(joint, key, given, err);
  return pb_fail(err, PB_ERR_ARGUMENT, joint_key[side],
                 "the joint model needs %s, which the plant's joints do not have (--joint-%s)", key,
                 key);
}

static pb_status make_joint(const cJSON *file, const struct joint_form *form, int side,
                            const pb_variation *v, cJSON **out, pb_error *err) {
  const pb_joint_stiffness *k = &v->stiffness;
  cJSON *joint = cJSON_CreateObject();
  bool turns = strncmp(form->type[side], "universal", 9) != 0;
  pb_status status = joint ? pb_object_put(joint, "type", cJSON_CreateString(form->type[side]), err)
                           : pb_fail_memory(err, "joint");
  if (!status && !form->rotations) status = pb_object_put_number(joint, "k_f", 0, err);
  if (!status && !form->rotations && turns) status = pb_object_put_number(joint, "k_t", 0, err);
  if (!status && form->rotations) status = take_stiffness(file, v, side, "k_f", k->k_f, joint, err);
  if (!status && form->rotations && turns)
    status = take_stiffness(file, v, side, "k_t", k->k_t, joint, err);
  if (!status && form->axial) status = take_stiffness(file, v, side, "k_a", k->k_a, joint, err);
  if (!status && form->shear) status = take_stiffness(file, v, side, "k_s", k->k_s, joint, err);
  if (status)
    cJSON_Delete(joint);
  else
    *out = joint;
  return status;
}

// A model of the file for one side, out of "NAME" or "BOTTOM+TOP".
static pb_status name_joint(const cJSON *file, const char *text, int side, cJSON **out,
                            pb_error *err) {
  const cJSON *model;
  char *copy = pb_text_copy(text), *plus = copy ? strchr(copy, '+') : NULL;
  if (!copy) return pb_fail_memory(err, text);
  if (plus) *plus = '\0';
  const char *name = plus && side > 0 ? plus + 1 : copy;
  pb_status status = pb_file_model_find(file, name, &model, err);
  if (!status) *out = cJSON_CreateString(name);
  free(copy);
  return status;
}

static pb_status vary_joint_model(const cJSON *file, cJSON *template, const pb_variation *v,
                                  pb_error *err) {
  const struct joint_form *form = NULL;
  pb_status status = PB_OK;
  for (size_t i = 0; i < sizeof joint_forms / sizeof *joint_forms; i++)
    if (!strcmp(joint_forms[i].name, v->text)) form = &joint_forms[i];
  for (int side = 0; side < 2 && !status; side++) {
    cJSON *joint = NULL;
    status = form ? make_joint(file, form, side, v, &joint, err)
                  : name_joint(file, v->text, side, &joint, err);
    if (!status) status = pb_object_put(template, joint_key[side], joint, err);
  }
  return status;
}

// ---- the payload --------------------------------------------------------------------------------

static pb_status vary_mass(cJSON *template, double mass, pb_error *err) {
  if (mass == 0) return pb_object_put(template, "payload", cJSON_CreateNull(), err);
  cJSON *payload = cJSON_GetObjectItemCaseSensitive(template, "payload");
  if (!cJSON_IsObject(payload))
    return pb_fail(err, PB_ERR_STATE, "/template/payload",
                   "the plant has no payload, so its size is not known");
  return pb_object_put_number(payload, "mass", mass, err);
}

// ---- all of them --------------------------------------------------------------------------------

pb_status pb_variation_apply(const cJSON *file, const pb_variation *v, cJSON **out, pb_error *err) {
  const cJSON *own;
  double value = NAN;
  *out = NULL;
  pb_status status = pb_template_find(file, &own, err);
  if (!status) status = pb_variation_number(v, &value, err);
  if (status) return status;
  cJSON *copy = cJSON_Duplicate(file, 1);
  if (!copy) return pb_fail_memory(err, "plant file");
  cJSON *template = cJSON_GetObjectItemCaseSensitive(copy, "template");
  bool by_name = !pb_study_kind_of(v->kind)->unit;
  if (by_name && !strcmp(v->text, "plant"))
    status = PB_OK;
  else if (v->kind == PB_STUDY_JOINT_MODEL)
    status = vary_joint_model(file, template, v, err);
  else if (v->kind == PB_STUDY_ACTUATOR_MODEL)
    status = pb_vary_actuator_model(file, template, v->text, err);
  else if (v->kind == PB_STUDY_MASS)
    status = vary_mass(template, value, err);
  else
    status = vary_stiffness(file, template, v->kind, value, err);
  if (status)
    cJSON_Delete(copy);
  else
    *out = copy;
  return status;
}
