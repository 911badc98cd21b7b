// What the files of the truncation share: the element by its own interior modes
// (truncate_interior.c), and the poles and zeros by which it is judged (truncate_proof.c).
#ifndef PB_PART_TRUNCATE_INTERNAL_H
#define PB_PART_TRUNCATE_INTERNAL_H

#include <complex.h>

#include "part/truncate.h"

// The element in the coordinates of T with all of Φ: dropping modes is dropping rows.
typedef struct interior {
  size_t b, p;    // coordinates of the frames, modes
  double *k, *m;  // (b + p)², frames first; K is block diagonal
  double *hz;     // [p] ascending
  size_t *order;  // [p] modes by what they do to the frames in the band, most first
} interior;

// All modes of the element with its frames held. Fails with PB_ERR_ELEMENT, PB_ERR_NUMERIC,
// PB_ERR_MEMORY. [init]
pb_status interior_make(const char *name, const pb_element_data *e, interior *x, pb_error *err);
void interior_clear(interior *x);

// Fills x->order for a band up to high_hz. Fails with PB_ERR_MEMORY. [init]
pb_status interior_rank(const char *name, interior *x, double high_hz, pb_error *err);

// The first `modes` of the ranking, by frequency. Fails with PB_ERR_MEMORY. [init]
pb_status interior_take(const char *name, const pb_element_data *e, const interior *x, size_t modes,
                        pb_element_data *out, pb_error *err);

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
