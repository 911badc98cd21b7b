// Curves that cannot be told apart: see alike.h.
#include "alike.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const double width = 2e-3;  // of a line, as a part of the value

bool study_same(const double *a, const double *b, size_t count) {
  for (size_t i = 0; i < count; i++)
    if (isnan(a[i]) != isnan(b[i]) || fabs(a[i] - b[i]) > width * fabs(a[i])) return false;
  return true;
}

// The first strut's response; with inputs of different units each is over its first value, as it is
// drawn.
static bool same_responses(const pb_study_point *p, const double complex *a,
                           const pb_study_point *q, const double complex *b) {
  const bool units = p->input_unit[0] == q->input_unit[0];
  const double scale = units ? 1 : cabs(a[0]) / cabs(b[0]);
  const size_t stride = PB_STUDY_STRUTS * PB_STUDY_STRUTS;
  for (size_t f = 0; f < p->size.lines; f++)
    if (cabs(a[f * stride] - scale * b[f * stride]) > width * cabs(a[f * stride])) return false;
  return true;
}

bool study_hac_alike(const pb_study_point *a, const pb_study_point *b) {
  return same_responses(a, a->hac, b, b->hac);
}

bool study_iff_alike(const pb_study_point *a, const pb_study_point *b) {
  return same_responses(a, a->iff, b, b->iff);
}

bool study_rga_alike(const pb_study_point *a, const pb_study_point *b) {
  return study_same(a->rga, b->rga, a->size.lines) &&
         study_same(a->rga_open, b->rga_open, a->size.lines);
}

size_t study_alike(const study *s, study_look *look, study_label *label, size_t *shown) {
  size_t count = 0;
  for (size_t k = 0; k < s->count; k++) {
    size_t j = 0;
    while (j < count && !look(&s->point[shown[j]], &s->point[k])) j++;
    if (j == count) {
      shown[count++] = k;
      continue;
    }
    char *text = label[shown[j]];
    const size_t length = strlen(text);
    snprintf(text + length, sizeof label[0] - length, ", %s", s->label[k]);
  }
  return count;
}
