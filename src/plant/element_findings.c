// Findings of a diagnosis: names, list, one line. See element_doctor.h.
#include <math.h>
#include <stdio.h>

#include "plant/element_doctor_internal.h"

const char *pb_finding_name(pb_finding_code code) {
  switch (code) {
#define PB_FINDING_NAME(name, text) \
  case PB_FINDING_##name:           \
    return text;
    PB_FINDING_LIST(PB_FINDING_NAME)
#undef PB_FINDING_NAME
  }
  return "unknown";
}

// The last place takes what is too much: no walk finds that many.
pb_finding *pb_doctor_note(pb_diagnosis *d, pb_finding_code code, bool curable) {
  if (d->findings < PB_FINDINGS) d->findings++;
  pb_finding *f = &d->finding[d->findings - 1];
  *f = (pb_finding){.code = code, .curable = curable};
  return f;
}

void pb_diagnosis_summary(const pb_diagnosis *d, char *text, size_t size) {
  if (!d->findings) {
    snprintf(text, size,
             "sound: %d digits, rigid motions within %.2g Hz, first mode %.5g Hz, %.4g kg",
             d->digits_k < d->digits_m ? d->digits_k : d->digits_m, fabs(d->rigid_hz[5]),
             d->flexible_hz, d->mass);
    return;
  }
  size_t at = 0;
  for (size_t k = 0; k < d->findings && at < size; k++)
    at += (size_t)snprintf(text + at, size - at, "%s%s: %s", k ? "; " : "",
                           pb_finding_name(d->finding[k].code), d->finding[k].saw);
}
