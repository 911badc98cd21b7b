// Measured frequency responses in files: CSV and MAT v5.
#ifndef PB_IDENTIFY_FRF_FILES_H
#define PB_IDENTIFY_FRF_FILES_H

#include "experiment.h"
#include "matfile.h"
#include "results.h"

// A measured response with the exact one beside it, and the names of its channels.
typedef struct pb_frf_record {
  const pb_model *model;
  pb_experiment_channels channels;
  const pb_frf *measured;
  const double complex *exact;  // [nf][outputs][inputs]
} pb_frf_record;

// One row a line: frequency, real, imag and variance of each channel, exact real and imag,
// coherence of each output. [init] PB_ERR_IO, PB_ERR_MEMORY.
pb_status pb_frf_write_csv(const pb_frf_record *record, const char *path, pb_error *err);

// Variables PREFIX_frequency_hz, PREFIX_h, PREFIX_exact (ny × nu × nf), PREFIX_variance (nu ×
// ny·nf) and PREFIX_coherence (ny × nf) into an open file; failures are kept by the file.
void pb_frf_write_mat(const pb_frf_record *record, const char *prefix, pb_matfile *mat);

// Names of the channels: input_names, output_names.
void pb_frf_write_names(const pb_frf_record *record, pb_matfile *mat);

// "m/V", "(m/s^2)/N"; in text of the given size, always terminated. [any]
void pb_channel_unit(const pb_model *model, size_t output, size_t input, char *text, size_t size);

#endif
