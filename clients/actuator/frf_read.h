// Reading measured responses that plantbus-identify wrote.
#ifndef PB_ACTUATOR_FRF_READ_H
#define PB_ACTUATOR_FRF_READ_H

#include "study/actuator_fit.h"

// Names of the signals that are looked for.
typedef struct frf_names {
  const char *input, *output[PB_APA_OUTPUTS];
} frf_names;

// identify.csv (.csv) or identify.mat (.mat). sample_rate of *out: that of a MAT file, else 0.
// Fails with PB_ERR_IO, PB_ERR_SYNTAX (file and line, or variable), PB_ERR_REFERENCE (a signal is
// not in the file; those that are, are named), PB_ERR_MEMORY. [init]
pb_status frf_read(const char *path, const frf_names *names, pb_apa_data *out, pb_error *err);

// Of frf_read, by format.
pb_status frf_read_csv(const char *path, const frf_names *names, pb_apa_data *out, pb_error *err);
pb_status frf_read_mat(const char *path, const frf_names *names, pb_apa_data *out, pb_error *err);

#endif
