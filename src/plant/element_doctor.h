// What is wrong with an element's matrices, and what can be done about it.
//
// A free part with frames at p_i has K R = 0 for its six rigid motions R (u_i = v + θ × p_i,
// θ_i = θ, modal rows 0). Rounded exports, half-stored matrices, other units, wrong or swapped
// coordinates and held parts each break this in their own way:
//   half-stored         one triangle is empty                         mirrored
//   asymmetric          K, M differ from their transposes             mean
//   grounded            K resists translations: the part was held     – (export it free)
//   frames              K resists rotations about the coordinates given, not those that its own
//                       null space tells: swapped, displaced, turned, in another unit
//   units               mass, size and density of no part in SI, but of one in mm, t, N, s
//   rigid motions       what is left is rounding: K ← P K P with P = I − R(RᵀR)⁻¹Rᵀ, the smallest
//                       change (Frobenius) after which K R = 0; or, weighted, the smallest change
//                       measured entry by entry against √(K_ii K_jj), the scale of rounding
//   indefinite mass     M has a negative eigenvalue                   lifted, where rounding
//   explains it
// Nothing is changed unless asked for; whoever asks gets told each change.
// Source: design note on the health of imported elements; report "Optimization using Finite Element
// Models" (T. Dehaeze, 2025), section 1.1.
#ifndef PB_PLANT_ELEMENT_DOCTOR_H
#define PB_PLANT_ELEMENT_DOCTOR_H

#include <stdbool.h>

#include "plant/element.h"

#define PB_FINDING_LIST(X)                    \
  X(NOT_FINITE, "not-finite")                 \
  X(HALF_STORED, "half-stored")               \
  X(ASYMMETRIC, "asymmetric")                 \
  X(FEW_DIGITS, "few-digits")                 \
  X(INDEFINITE_MASS, "indefinite-mass")       \
  X(GROUNDED, "grounded")                     \
  X(TURNED_FRAMES, "turned-frames")           \
  X(SWAPPED_FRAMES, "swapped-frames")         \
  X(COORDINATE_UNIT, "coordinate-unit")       \
  X(DISPLACED_FRAMES, "displaced-frames")     \
  X(UNEXPLAINED_FRAMES, "unexplained-frames") \
  X(UNITS, "units")                           \
  X(RIGID_MOTIONS, "rigid-motions")

typedef enum pb_finding_code {
#define PB_FINDING_ENUM(name, text) PB_FINDING_##name,
  PB_FINDING_LIST(PB_FINDING_ENUM)
#undef PB_FINDING_ENUM
} pb_finding_code;

typedef struct pb_finding {
  pb_finding_code code;
  bool curable;
  char saw[320];    // one clause
  char would[320];  // what a repair does, or what to do elsewhere
} pb_finding;

enum { PB_FINDINGS = 16 };

typedef struct pb_diagnosis {
  size_t frames, size;
  int digits_k, digits_m;  // significant digits of the entries: 16 and more are a full double
  double asymmetry_k, asymmetry_m;
  double translation_residual, rotation_residual;  // largest |K R| against √K_ii √(Σ K_jj R_j²)
  double mass_smallest;                            // eigenvalue of M with unit diagonal
  double rigid_hz[6];   // by magnitude; the sign is the eigenvalue's; NaN: M is not definite
  double flexible_hz;   // first free frequency beyond them
  double mass, extent;  // kg; m, largest distance between frames
  double change;        // ‖ΔK‖/‖K‖, by √(K_ii K_jj), of the projection that is proposed
  size_t findings;
  pb_finding finding[PB_FINDINGS];
} pb_diagnosis;

typedef struct pb_doctor_options {
  bool weighted;     // see above; the plain projection otherwise
  bool trust_units;  // the caller knows the units: SI
} pb_doctor_options;

const char *pb_finding_name(pb_finding_code code);  // never NULL [any]

// Examines an element; with `cured` (may be NULL) also hands out a copy in which every curable
// finding is cured, owned by the caller. name is used in errors. Fails with PB_ERR_MEMORY,
// PB_ERR_NUMERIC; PB_ERR_ELEMENT where `cured` is asked for and a finding is not curable, the
// diagnosis being complete in that case. [init]
pb_status pb_element_diagnose(const char *name, const pb_element_data *data,
                              const pb_doctor_options *options, pb_diagnosis *out,
                              pb_element_data *cured, pb_error *err);

// The same of a loaded element, whose matrices are the means with their transposes. [init]
pb_status pb_element_check(const pb_element *element, pb_diagnosis *out, pb_error *err);

// One line: "sound: 16 digits, rigid motions at 0.05 Hz, first mode 1879 Hz, 0.115 kg", or the
// findings. [any]
void pb_diagnosis_summary(const pb_diagnosis *diagnosis, char *text, size_t size);

// Converts coordinates, K and M from consistent units of `length` m, `force` N and `time` s to SI
// (mm, t, N, s: 1e-3, 1, 1); modes stay mass-normalised. [any]
void pb_element_convert(pb_element_data *element, double length, double force, double time);

// Frequencies of the part as users know it: one frame held, another one free.
typedef struct pb_element_held {
  double hz[4];     // the first modes with frame `base` held; NaN where there are fewer
  double axial_hz;  // the first of all modes that holds a tenth of the tip's compliance along axis
} pb_element_held;

// base, tip: frames from 0; axis: unit vector. Fails with PB_ERR_ARGUMENT, PB_ERR_ELEMENT (M),
// PB_ERR_NUMERIC, PB_ERR_MEMORY. [init]
pb_status pb_element_hold(const char *name, const pb_element_data *data, size_t base, size_t tip,
                          const double axis[3], pb_element_held *out, pb_error *err);

#endif
