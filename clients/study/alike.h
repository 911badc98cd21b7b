// Curves of a study that cannot be told apart: drawn once, with both labels.
#ifndef PB_STUDY_ALIKE_H
#define PB_STUDY_ALIKE_H

#include "study.h"

typedef char study_label[160];

// Whether the figures of two values look the same.
typedef bool study_look(const pb_study_point *a, const pb_study_point *b);
study_look study_hac_alike, study_iff_alike, study_rga_alike;

// Values that need curves of their own into shown [s->count]; the label of one that does not is
// added to that of the value that it looks like. Returns their number.
size_t study_alike(const study *s, study_look *look, study_label *label, size_t *shown);

// Whether two curves lie on one another; NaN: no point.
bool study_same(const double *a, const double *b, size_t count);

#endif
