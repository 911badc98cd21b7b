// The frequency response structure: see frf.h.
#include "signal/frf.h"

#include <stdlib.h>

pb_status pb_frf_new(size_t nf, size_t ny, size_t nu, pb_frf *out, pb_error *err) {
  *out = (pb_frf){0};
  if (nf == 0 || ny == 0 || nu == 0) {
    return pb_fail(err, PB_ERR_ARGUMENT, "frf", "%zu frequencies, %zu outputs, %zu inputs", nf, ny,
                   nu);
  }
  pb_frf frf = {.nf = nf, .ny = ny, .nu = nu};
  frf.frequency_hz = calloc(nf, sizeof *frf.frequency_hz);
  frf.h = calloc(nf * ny * nu, sizeof *frf.h);
  frf.coherence = calloc(nf * ny, sizeof *frf.coherence);
  frf.variance = calloc(nf * ny * nu, sizeof *frf.variance);
  if (!frf.frequency_hz || !frf.h || !frf.coherence || !frf.variance) {
    pb_frf_clear(&frf);
    return pb_fail_memory(err, "frf");
  }
  *out = frf;
  return PB_OK;
}

void pb_frf_clear(pb_frf *frf) {
  if (!frf) return;
  free(frf->frequency_hz);
  free(frf->h);
  free(frf->coherence);
  free(frf->variance);
  *frf = (pb_frf){0};
}
