// The frames that K tells (element_place.c) against those of the file: turned, swapped, displaced,
// in another unit. Each is noted and put right in the working copy.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "plant/element_doctor_internal.h"

static double spread(const double *p, size_t frames, double mean[3]) {
  double sum = 0;
  memset(mean, 0, 3 * sizeof *mean);
  for (size_t f = 0; f < frames; f++)
    for (size_t a = 0; a < 3; a++) mean[a] += p[3 * f + a] / (double)frames;
  for (size_t f = 0; f < frames; f++)
    for (size_t a = 0; a < 3; a++) sum += pow(p[3 * f + a] - mean[a], 2);
  return sqrt(sum);
}

static double distance(const double *a, const double *b, const double *shift) {
  double sum = 0;
  for (size_t x = 0; x < 3; x++) sum += pow(a[x] - b[x] - shift[x], 2);
  return sqrt(sum);
}

// Which of the file's coordinates each frame has; false: they are no permutation of the places.
static bool match(const double *file, const double *place, const double *shift, size_t frames,
                  double tolerance, size_t *from) {
  for (size_t f = 0; f < frames; f++) {
    size_t best = frames;
    double least = tolerance;
    for (size_t g = 0; g < frames; g++) {
      bool taken = false;
      for (size_t h = 0; h < f; h++) taken |= from[h] == g;
      double apart = distance(file + 3 * g, place + 3 * f, shift);
      // Its own coordinates win where several are equally near: coincident frames stay.
      if (taken || apart > least || (apart == least && best != frames)) continue;
      if (best != f || apart < 0.5 * least) least = apart, best = g;
    }
    if (best == frames) return false;
    from[f] = best;
  }
  return true;
}

// The shift that lets most frames agree with the file; *agree of them do.
static void best_shift(const double *file, const double *place, size_t frames, double tolerance,
                       double shift[3], size_t *agree) {
  *agree = 0;
  for (size_t f = 0; f < frames; f++) {
    double candidate[3];
    size_t count = 0;
    for (size_t a = 0; a < 3; a++) candidate[a] = file[3 * f + a] - place[3 * f + a];
    for (size_t g = 0; g < frames; g++)
      count += distance(file + 3 * g, place + 3 * g, candidate) <= tolerance;
    if (count <= *agree) continue;
    *agree = count;
    memcpy(shift, candidate, sizeof candidate);
  }
}

// ---- cures --------------------------------------------------------------------------------------

static double turn_angle(const double *q) {
  return acos(fmax(-1, fmin(1, 0.5 * (q[0] + q[4] + q[8] - 1))));
}

// Bᵀ X B with B = diag(Q_i) in threes.
static void turn_matrix(double *x, size_t n, size_t frames, const double *rotation) {
  for (int side = 0; side < 2; side++) {
    size_t along = side ? 1 : n, across = side ? n : 1;  // columns first, then rows
    for (size_t b = 0; b < 2 * frames; b++) {
      const double *q = rotation + 9 * (b / 2);
      for (size_t i = 0; i < n; i++) {
        double *at = x + 3 * b * along + i * across, old[3];
        for (size_t l = 0; l < 3; l++) old[l] = at[l * along];
        for (size_t j = 0; j < 3; j++)
          at[j * along] = old[0] * q[3 * j] + old[1] * q[1 + 3 * j] + old[2] * q[2 + 3 * j];
      }
    }
  }
}

// Columns of q made orthonormal (Gram–Schmidt): K tells them to the accuracy of its null space.
static void make_rotation(double *q) {
  for (size_t j = 0; j < 3; j++) {
    double norm = 0;
    for (size_t l = 0; l < j; l++) {
      double dot = 0;
      for (size_t i = 0; i < 3; i++) dot += q[i + 3 * l] * q[i + 3 * j];
      for (size_t i = 0; i < 3; i++) q[i + 3 * j] -= dot * q[i + 3 * l];
    }
    for (size_t i = 0; i < 3; i++) norm += q[i + 3 * j] * q[i + 3 * j];
    for (size_t i = 0; i < 3; i++) q[i + 3 * j] /= sqrt(norm);
  }
}

// Half a degree, or what the digits leave uncertain: frames that are turned by less stay.
static void treat_turned(pb_element_data *e, pb_placement *p, double tolerance, pb_diagnosis *d) {
  static const double none[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  size_t turned = 0, first = 0;
  for (size_t f = e->frames; f-- > 0;) {
    double *q = p->rotation + 9 * f;
    bool is = turn_angle(q) > fmax(10 * tolerance, 8.7e-3);
    if (is) {
      make_rotation(q);
      turned++;
      first = f;
    } else {
      memcpy(q, none, sizeof none);
    }
  }
  if (!turned) return;
  pb_finding *note = pb_doctor_note(d, PB_FINDING_TURNED_FRAMES, true);
  snprintf(note->saw, sizeof note->saw,
           "the axes of %zu of %zu frames are not those of frame 1 (frame %zu is turned by %.4g°)",
           turned, e->frames, first + 1, turn_angle(p->rotation + 9 * first) * 57.29577951308232);
  snprintf(note->would, sizeof note->would, "turns their coordinates in K and M to frame 1's axes");
  turn_matrix(e->k, e->size, e->frames, p->rotation);
  turn_matrix(e->m, e->size, e->frames, p->rotation);
}

static void treat_scale(pb_element_data *e, double ratio, pb_diagnosis *d) {
  static const double known[] = {1000, 0.001, 100, 0.01, 39.37007874015748, 0.0254};
  static const char *const unit[] = {"mm", "km", "cm", "hm", "in", "40 m"};
  for (int k = 0; k < 6; k++) {
    if (fabs(ratio / known[k] - 1) > 0.02) continue;
    pb_finding *note = pb_doctor_note(d, PB_FINDING_COORDINATE_UNIT, true);
    snprintf(note->saw, sizeof note->saw, "the coordinates are %.4g times what K says%s%s",
             known[k], k % 2 ? ": K and M are in another unit of length" : ": they are in ",
             k % 2 ? "" : unit[k]);
    snprintf(note->would, sizeof note->would, "%s the coordinates by %.4g",
             known[k] > 1 ? "divides" : "multiplies", known[k] > 1 ? known[k] : 1 / known[k]);
    for (size_t i = 0; i < 3 * e->frames; i++) e->position[i] /= known[k];
    return;
  }
}

static void note_swapped(pb_element_data *e, const size_t *from, pb_diagnosis *d) {
  pb_finding *note = pb_doctor_note(d, PB_FINDING_SWAPPED_FRAMES, true);
  size_t at = 0;
  for (size_t f = 0; f < e->frames && at < 200; f++)
    if (from[f] != f)
      at += (size_t)snprintf(note->saw + at, sizeof note->saw - at, "%s%zu has those of %zu",
                             at ? ", " : "the coordinates are swapped: by K frame ", f + 1,
                             from[f] + 1);
  snprintf(note->would, sizeof note->would, "puts the coordinates in the order of K");
}

static pb_status treat_swapped(const char *name, pb_element_data *e, const size_t *from,
                               pb_diagnosis *d, pb_error *err) {
  bool same = true;
  for (size_t f = 0; f < e->frames; f++) same &= from[f] == f;
  if (same) return PB_OK;
  double *old = malloc(3 * e->frames * sizeof *old);
  if (!old) return pb_fail_memory(err, name);
  memcpy(old, e->position, 3 * e->frames * sizeof *old);
  note_swapped(e, from, d);
  for (size_t f = 0; f < e->frames; f++)
    memcpy(e->position + 3 * f, old + 3 * from[f], 3 * sizeof *old);
  free(old);
  return PB_OK;
}

static void treat_displaced(pb_element_data *e, const pb_placement *p, double tolerance,
                            pb_diagnosis *d) {
  double shift[3] = {0};
  size_t agree, first = 0;
  best_shift(e->position, p->position, e->frames, tolerance, shift, &agree);
  for (size_t f = e->frames; f-- > 0;)
    if (distance(e->position + 3 * f, p->position + 3 * f, shift) > tolerance) first = f;
  const double *was = e->position + 3 * first, *is = p->position + 3 * first;
  pb_finding *note = pb_doctor_note(d, PB_FINDING_DISPLACED_FRAMES, true);
  snprintf(note->saw, sizeof note->saw,
           "%zu of %zu frames are not where the file says: frame %zu is at (%.6g, %.6g, %.6g) m by "
           "K, at (%.6g, %.6g, %.6g) m by the file",
           e->frames - agree, e->frames, first + 1, is[0] + shift[0], is[1] + shift[1],
           is[2] + shift[2], was[0], was[1], was[2]);
  snprintf(note->would, sizeof note->would,
           "takes the places from K's rigid motions, so that %s stay%s",
           agree > 1 ? "the others" : "the first frame", agree > 1 ? "" : "s");
  for (size_t f = 0; f < e->frames; f++)
    for (size_t a = 0; a < 3; a++)
      if (distance(e->position + 3 * f, p->position + 3 * f, shift) > tolerance)
        e->position[3 * f + a] = p->position[3 * f + a] + shift[a];
}

// Coordinates against the places that K tells; turned axes are put right before.
static pb_status compare(const char *name, pb_element_data *e, const pb_placement *p,
                         double tolerance, pb_diagnosis *d, pb_error *err) {
  double mean_file[3], mean_place[3], shift[3];
  double far = spread(e->position, e->frames, mean_file);
  double near = spread(p->position, e->frames, mean_place);
  if (near > 0 && far > 0) treat_scale(e, far / near, d);
  spread(e->position, e->frames, mean_file);
  size_t *from = malloc(e->frames * sizeof *from);
  if (!from) return pb_fail_memory(err, name);
  for (size_t a = 0; a < 3; a++) shift[a] = mean_file[a] - mean_place[a];
  double within = fmax(1e-9, fmin(0.05, 100 * tolerance) * near);
  pb_status st = PB_OK;
  if (match(e->position, p->position, shift, e->frames, within, from))
    st = treat_swapped(name, e, from, d, err);
  else
    treat_displaced(e, p, within, d);
  free(from);
  return st;
}

pb_status pb_doctor_place(const char *name, pb_element_data *e, double tolerance, pb_diagnosis *d,
                          pb_error *err) {
  pb_placement p;
  pb_status st = pb_placement_solve(name, e, &p, err);
  if (st == PB_ERR_MEMORY) return st;
  if (!st && p.found && p.misfit < fmax(1e-4, fmin(0.3, 100 * tolerance))) {
    treat_turned(e, &p, tolerance, d);
    st = compare(name, e, &p, tolerance, d, err);
  } else {
    st = PB_OK;
    bool held = d->translation_residual > tolerance;
    pb_finding *note =
        pb_doctor_note(d, held ? PB_FINDING_GROUNDED : PB_FINDING_UNEXPLAINED_FRAMES, false);
    if (held)
      snprintf(note->saw, sizeof note->saw,
               "K resists translations (by %.2g of its stiffness): the part was held, or rows are "
               "missing",
               d->translation_residual);
    else
      snprintf(note->saw, sizeof note->saw,
               "K resists rotations about the frames' coordinates (by %.2g of its stiffness) and "
               "has no rigid motions of its own that would explain them",
               d->rotation_residual);
    snprintf(note->would, sizeof note->would, "%s",
             held ? "not curable here: export the part free, without supports"
                  : "not curable here: export the part again, with its frames' coordinates");
  }
  pb_placement_clear(&p);
  return st;
}
