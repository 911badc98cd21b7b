// What an identification says, beside what the published model says: agreement of the responses,
// modes, zeros and static gains.
#ifndef PB_IDENTIFY_ANALYSIS_H
#define PB_IDENTIFY_ANALYSIS_H

#include "control/fit.h"
#include "experiment.h"
#include "roots.h"

// Agreement of one output's responses with the exact ones, over the lines where its coherence
// exceeds 0.99 and the response its noise floor: three standard deviations of the estimate, and
// 1e-5 of the largest response of the output at that line. Where the exact response itself is below
// its floor (pb_response_floor) there is nothing to compare.
typedef struct pb_agreement {
  size_t used, lines;        // entries compared, entries there are (lines × inputs)
  size_t below;              // entries whose exact response is rounding: below its floor
  double magnitude_percent;  // largest error
  double phase_degree;       // largest error
  double worst_hz;           // where the magnitude error is largest
  double coherence;          // smallest of the output
} pb_agreement;

typedef struct pb_mode_row {
  pb_pole exact, measured;  // measured.hz is NaN where no fitted pole is near
  size_t cluster;           // 1, 2, …: of the modes that lie closer than the resolution; 0: none
} pb_mode_row;

typedef struct pb_zero_row {
  pb_exact_zero exact;
  pb_pole measured;  // as above
} pb_zero_row;

// A channel looked at closely.
typedef struct pb_channel_row {
  size_t output, input;          // of the model
  double dc_exact, dc_measured;  // NaN where the band starts too high to tell
  size_t zeros;
  pb_zero_row *zero;  // [zeros]
} pb_channel_row;

typedef struct pb_analysis {
  const pb_model *model;
  pb_experiment_channels channels;
  pb_frf frf;               // measured, owned
  pb_frf early;             // the same without the outputs' delays; only its h may be its own
  double complex *exact;    // [nf][outputs][inputs]
  double *exact_floor;      // [nf][outputs]
  pb_agreement *agreement;  // [outputs]
  pb_agreement overall;
  double fit_error;   // of the fit that gave the modes
  double resolution;  // Hz between lines
  size_t modes, clusters;
  pb_mode_row *mode;  // [modes]
  size_t rows;
  pb_channel_row *row;  // [rows]
} pb_analysis;

// Takes the measured response over (also on failure). floor: relative accuracy the measurement can
// have at best, 1e-6 for periodic, 1e-3 for random excitation. [init]
pb_status pb_analyse(const pb_model *model, const pb_experiment_channels *channels, pb_frf *frf,
                     double floor, pb_analysis *out, pb_error *err);

void pb_analysis_clear(pb_analysis *analysis);

// The floors of outputs at one line: 1e-9 of the largest response of each to any of the nu inputs,
// all as SI numbers. h [ny][nu] all responses. What lies below is what cancelling modes leave of
// rounding (a symmetric plant's Fz → Rx), and is no number. floor [outputs]. [any]
void pb_response_floor(const double complex *h, size_t nu, const size_t *output, size_t outputs,
                       double *floor);

// Exact responses of chosen channels, [nf][outputs][inputs], and their floors, [nf][outputs], both
// owned by the caller. base: PB_APPLIED for responses from the inputs as applied, PB_SAMPLED for
// those from commands. [init]
pb_status pb_exact_responses(const pb_model *model, pb_time_base base,
                             const pb_experiment_channels *channels, const double *hz, size_t nf,
                             double complex **out, double **floor, pb_error *err);

// *out: the measured response without the delays of the electronics that `base` includes, which no
// fit need find. It shares the arrays of frf but for h, the caller's (free) unless it is frf's too:
// where nothing is delayed. [init]
pb_status pb_responses_advance(const pb_model *model, pb_time_base base,
                               const pb_experiment_channels *channels, const pb_frf *frf,
                               pb_frf *out, pb_error *err);

// Agreement of h with exact, both [nf][ny][nu] as frf, for output o (index in the frf); floor
// [nf][ny] of exact. [any]
pb_agreement pb_agreement_of(const pb_frf *frf, const double complex *exact, const double *floor,
                             size_t o);

// Up to `most` channels of a response in which all its inputs and outputs appear where they respond
// best; channel[most], returns their number. [any]
size_t pb_fit_channels(const pb_frf *frf, pb_fit_channel *channel, size_t most);

#endif
