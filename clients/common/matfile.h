// MAT v5 files, readable by MATLAB, Octave and scipy. Arrays are column-major, first index fastest.
//
// The first failure is kept and reported by pb_matfile_close, so that a sequence of writes needs no
// checks in between; the file appears only when everything was written.
#ifndef PB_CLIENTS_MATFILE_H
#define PB_CLIENTS_MATFILE_H

#include <complex.h>
#include <stddef.h>

#include "base/status.h"

typedef struct pb_matfile pb_matfile;

// Fails with PB_ERR_IO, PB_ERR_MEMORY. *out is released by pb_matfile_close or pb_matfile_discard.
pb_status pb_matfile_open(const char *path, pb_matfile **out, pb_error *err);

// Variables. name: a MATLAB identifier of at most 63 characters (else PB_ERR_ARGUMENT at close).
void pb_matfile_scalar(pb_matfile *mat, const char *name, double value);
void pb_matfile_real(pb_matfile *mat, const char *name, size_t rows, size_t cols,
                     const double *data);
void pb_matfile_complex(pb_matfile *mat, const char *name, size_t rows, size_t cols,
                        const double complex *data);

// A frequency response h [nf][ny][nu] (as pb_model_frf writes it) as a complex ny × nu × nf array,
// the order of MATLAB's frd and idfrd objects.
void pb_matfile_frf(pb_matfile *mat, const char *name, size_t nf, size_t ny, size_t nu,
                    const double complex *h);

void pb_matfile_text(pb_matfile *mat, const char *name, const char *text);

// A count × 1 cell array of strings.
void pb_matfile_names(pb_matfile *mat, const char *name, const char *const *text, size_t count);

// Completes the file under its name; fails with the first error met. mat is released either way.
pb_status pb_matfile_close(pb_matfile *mat, pb_error *err);
void pb_matfile_discard(pb_matfile *mat);

#endif
