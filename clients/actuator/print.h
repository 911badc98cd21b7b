// Figures and responses of a part as tables, JSON, CSV and MAT.
#ifndef PB_ACTUATOR_PRINT_H
#define PB_ACTUATOR_PRINT_H

#include <complex.h>

#include "jsonout.h"
#include "matfile.h"
#include "model/model.h"

// nf frequencies from f1 to f2, equally spaced on a logarithmic axis; the caller's, NULL: no
// memory.
double *log_frequencies(double f1, double f2, size_t nf);

// The response of one channel of a model, by names; the caller's. Fails as pb_model_frf.
pb_status channel_response(const pb_model *model, const char *input, const char *output,
                           const double *hz, size_t nf, double complex **h, pb_error *err);

// A row "name, value in its unit, data sheet, difference" of a table of figures.
typedef struct part_figure {
  const char *key, *name, *unit;
  double scale, value;  // SI value × scale is in unit; JSON, CSV and MAT have the SI value
  double low, high;     // data sheet; NaN: unknown
} part_figure;
pb_status figures_print(const part_figure *list, size_t count, bool sheet, pb_error *err);
void figures_json(pb_jsonout *json, const part_figure *list, size_t count);
pb_status figures_csv(const char *path, const part_figure *list, size_t count, pb_error *err);
void figures_mat(pb_matfile *mat, const part_figure *list, size_t count);

// A CSV of responses: frequency, real and imaginary part of each.
typedef struct response {
  const char *name, *unit;
  const double complex *h;  // [nf]
} response;
pb_status responses_csv(const char *path, const double *hz, size_t nf, const response *response,
                        size_t count, pb_error *err);
void responses_mat(pb_matfile *mat, const double *hz, size_t nf, const response *response,
                   size_t count);

#endif
