// plantbus-part doctor: what its files share.
#ifndef PB_CLIENTS_PART_DOCTOR_H
#define PB_CLIENTS_PART_DOCTOR_H

#include "plant/element_doctor.h"
#include "source.h"

typedef struct doctor_options {
  source in;
  const char *out;
  bool json, repair;
  pb_doctor_options doctor;
  size_t base, tip;
  bool has_axis;
  double axis[3];
} doctor_options;

// The element in one state, with what is seen of it.
typedef struct doctor_stage {
  const char *name;
  bool known;
  pb_diagnosis d;
  pb_element_held held;
} doctor_stage;

typedef struct doctor_visit {
  const doctor_options *o;
  loaded from;
  pb_element_data cured;
  size_t stages;
  doctor_stage stage[3];
  bool written;
} doctor_visit;

bool doctor_all_curable(const pb_diagnosis *diagnosis);

// Tables or JSON on standard output.
pb_status doctor_report(const doctor_visit *visit, pb_error *err);

#endif
