// Poles and zeros of an element by which a truncation is judged (truncate_proof.c).
#ifndef PB_PART_TRUNCATE_INTERNAL_H
#define PB_PART_TRUNCATE_INTERNAL_H

#include <complex.h>

#include "part/truncate.h"

enum { PB_PROOF_GROUPS = 18 };

// Poles, or zeros of one channel, ascending in magnitude.
typedef struct pb_proof_group {
  const char *boundary, *what;
  bool zeros;
  size_t count;
  double complex *hz;
} pb_proof_group;

typedef struct pb_proof {
  size_t groups;
  pb_proof_group group[PB_PROOF_GROUPS];
} pb_proof;

// All of them up to 1.5 times the band's upper end. Fails with PB_ERR_NUMERIC, PB_ERR_ELEMENT,
// PB_ERR_MEMORY. [init]
pb_status pb_proof_make(const char *name, const pb_element_data *e, const pb_truncate_options *o,
                        pb_proof *out, pb_error *err);
void pb_proof_clear(pb_proof *proof);

#endif
