// One point of a study: everything that is asked of a hexapod with one thing varied.
//
//   HAC plant   actuators → dL, the struts' motion by external metrology   report fig. 3.2a, 3.4a
//   IFF plant   actuators → force sensors                                  report fig. 3.2b, 3.4b
//   IFF locus   K = g/(s + ω_i)·s/(s + ω_h) (control/iff.h), the same gain g on all struts, as the
//               plant's sample rate closes it                              report fig. 3.3, 3.5a
//   RGA number  of the HAC plant, undamped and with IFF at its best gain   report fig. 3.5b
//   zeros       of the IFF plant: where its loci end
//
// "Optimization using Finite Element Models" (T. Dehaeze, 2025).
#ifndef PB_STUDY_POINT_H
#define PB_STUDY_POINT_H

#include <complex.h>

#include "model/model.h"
#include "study/damping.h"
#include "study/struts.h"

enum { PB_STUDY_STRUTS = 6 };

typedef struct pb_study_options {
  double from, to;                    // Hz, of the frequency responses
  size_t points;                      // frequencies, in equal ratios
  double f1, f2;                      // Hz, the modes to damp; both 0: the six lowest
  double integrator_hz, highpass_hz;  // corners of K_IFF; 0: 2 Hz and 0.5 Hz
} pb_study_options;

// Counts of a point's arrays.
typedef struct pb_study_sizes {
  size_t lines;     // frequencies
  size_t modes;     // damped by IFF
  size_t branches;  // of the root locus
  size_t gains;
  size_t zeros;
} pb_study_sizes;

// Plain numbers first, so that they travel between processes as they are; the arrays share one
// block. Zero-initialise; free with pb_study_point_clear.
typedef struct pb_study_point {
  pb_study_sizes size;
  char input[16], sensor[16];            // of the first strut: "Va1" and "Vs1", or "f1" and "fm1"
  char input_unit[16], sensor_unit[16];  // "V" or "N"
  size_t states, dof;
  double sample_rate;  // Hz
  double f1, f2;       // Hz, band of the modes
  pb_strut_condition struts;
  double zero_hz;              // lowest complex zero of the 6 × 6 IFF plant; NaN: none below `to`
  double zero_alone_hz;        // of the first strut's channel alone
  pb_gain_choice best;         // IFF gain with the largest smallest damping, on the locus
  pb_gain_choice stable;       // … among gains that keep all modes stable; gain 0: there is none
  double stable_to;            // IFF gain up to which they are
  double smallest_attainable;  // least of the attainable dampings
  double rga_undamped, rga_damped;   // largest RGA number up to the highest mode of the band
  size_t chosen;                     // of gain[]: best.gain
  double *data;                      // the block
  double *hz;                        // [lines]
  double complex *hac, *iff;         // [lines][6][6] undamped, [line][output][input]
  double complex *hac_damped;        // [lines][6][6] at best.gain
  double *rga, *rga_open;            // [lines] RGA number of hac_damped and hac
  double *mode_hz, *mode_damping;    // [modes]
  double *attainable, *attained_at;  // [modes]
  double *gain;                      // [gains]
  double complex *locus;             // [branches][gains] rad/s; NaN where a branch was lost
  double *is_mode;                   // [branches] 1: starts at a mode of the band
  double complex *zero;              // [zeros] rad/s, upper half plane, of the 6 × 6 IFF plant
} pb_study_point;

// Analyses a plant file's tree; element files are relative to directory. [init] Fails as
// pb_plant_parse, pb_model_compile, pb_attainable_find; PB_ERR_STATE where the plant lacks the
// template's signals.
pb_status pb_study_point_find(const cJSON *file, const char *directory,
                              const pb_study_options *options, pb_study_point *out, pb_error *err);

// Allocates the arrays for out->size (zeroed) and sets the pointers; what else *out holds stays.
// Fails with PB_ERR_MEMORY. [init]
pb_status pb_study_point_allocate(pb_study_point *out, pb_error *err);

// Doubles in the block of a point of these sizes. [any]
size_t pb_study_point_doubles(const pb_study_sizes *size);

void pb_study_point_clear(pb_study_point *point);

// Indices of a hexapod's channels in a model: inputs Va… or f…, sensors Vs… or fm…, dL….
typedef struct pb_hexapod_channels {
  size_t input[PB_STUDY_STRUTS], sensor[PB_STUDY_STRUTS], metrology[PB_STUDY_STRUTS];
} pb_hexapod_channels;

// PB_ERR_STATE names the signal that is missing. [init]
pb_status pb_hexapod_channels_find(const pb_model *model, pb_hexapod_channels *out, pb_error *err);

// The band that holds the six lowest modes of a model and no other: from a third of the first to
// between the sixth and the seventh, at most 0.4 of the sample rate. PB_ERR_STATE: fewer modes, or
// one without stiffness. [any]
pb_status pb_hexapod_band(const pb_model *model, double *f1, double *f2, pb_error *err);

#endif
