// What the doctor's files share. Matrices are the working copy of the element: symmetric.
#ifndef PB_PLANT_ELEMENT_DOCTOR_INTERNAL_H
#define PB_PLANT_ELEMENT_DOCTOR_INTERNAL_H

#include "plant/element_doctor.h"

// Adds a finding, `would` formatted after `saw`.
pb_finding *pb_doctor_note(pb_diagnosis *d, pb_finding_code code, bool curable);

// ---- measures (element_measure.c) ----

int pb_measure_digits(const double *x, size_t n);
double pb_measure_asymmetry(const double *x, size_t n);

// 0: both triangles are there; 'u', 'l': entries only above, below the diagonal.
char pb_measure_half(const double *x, size_t n);

// Rigid motions of the frames, about their mean position: r is size × 6.
void pb_rigid_motions(const pb_element_data *e, double *r);

// Largest |K R_a| against √K_ii √(Σ K_jj R_ja²), over rows, for translations and rotations.
void pb_measure_rigid(const pb_element_data *e, const double *r, double *translation,
                      double *rotation);

// Smallest eigenvalue of M with unit diagonal. Fails with PB_ERR_MEMORY, PB_ERR_NUMERIC.
pb_status pb_measure_mass(const char *name, const pb_element_data *e, double *smallest,
                          pb_error *err);

// Hz with the sign of the eigenvalue.
double pb_signed_hz(double omega2);

// Signed frequencies of K φ = ω² M φ, ascending by eigenvalue, and, with shape (n × n) not NULL,
// its vectors. PB_ERR_ELEMENT: M is not positive definite.
pb_status pb_measure_modes(const char *name, size_t n, const double *k, const double *m, double *hz,
                           double *shape, pb_error *err);

// ---- places of the frames (element_place.c) ----

// Where the null space of K says that the frames are and how they are turned, relative to frame 0.
typedef struct pb_placement {
  bool found;        // the null space is that of a free body
  double misfit;     // what its motions lack of rigid ones, relative
  double *position;  // 3 × n, m
  double *rotation;  // 9 × n, column-major: axes of the frame in those of frame 0
} pb_placement;

pb_status pb_placement_solve(const char *name, const pb_element_data *e, pb_placement *out,
                             pb_error *err);
void pb_placement_clear(pb_placement *placement);

// ---- their comparison with the file (element_frames.c) ----

// Compares it with the coordinates of the file, notes what it finds and cures the working copy.
// tolerance: relative accuracy that the digits allow. Fails with PB_ERR_MEMORY.
pb_status pb_doctor_place(const char *name, pb_element_data *e, double tolerance, pb_diagnosis *d,
                          pb_error *err);

// ---- cures (element_cure.c) ----

void pb_cure_mirror(double *x, size_t n, char half);
void pb_cure_mean(double *x, size_t n);

// K ← P K P; *change: its relative size. Fails with PB_ERR_MEMORY, PB_ERR_NUMERIC.
pb_status pb_cure_rigid(const char *name, pb_element_data *e, bool weighted, double *change,
                        pb_error *err);

// Raises the eigenvalues of M with unit diagonal to `least`. Fails as above.
pb_status pb_cure_mass(const char *name, pb_element_data *e, double least, pb_error *err);

#endif
