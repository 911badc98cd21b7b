// Small plants for the tests: modes given one by one, compiled by the library's own builder.
//
//   q̈_k + 2 ζ_k ω_k q̇_k + ω_k² q_k = Σ_i φ_ki u_i,   y_o = Σ_k ψ_ok q_k + Σ_i d_oi u_i
#ifndef TESTS_MODAL_MODEL_H
#define TESTS_MODAL_MODEL_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "model/build.h"

typedef struct test_mode {
  double hz, damping;
  const double *in;   // [nu]
  const double *out;  // [ny]
} test_mode;

static inline pb_model *test_model(const test_mode *mode, size_t modes, size_t nu, size_t ny,
                                   double sample_rate, const double *direct) {
  pb_model_builder builder;
  if (pb_model_builder_open(&builder, 2 * modes, nu, ny, modes, NULL) != PB_OK) abort();
  pb_model *m = builder.model;
  m->name = pb_text_copy("test");
  m->sample_rate = sample_rate;
  for (size_t i = 0; i < nu + ny; i++) {
    char name[32];
    pb_signal *s = i < nu ? &m->input[i] : &m->output[i - nu];
    snprintf(name, sizeof name, "%c%zu", i < nu ? 'u' : 'y', i < nu ? i + 1 : i - nu + 1);
    s->name = pb_text_copy(name);
    s->unit = pb_text_copy("V");
  }
  if (direct) memcpy(m->d, direct, nu * ny * sizeof *direct);
  double b[2 * 32], c[2 * 32];
  for (size_t k = 0; k < modes; k++) {
    double w = 2 * M_PI * mode[k].hz, a[4] = {0, -w, w, -2 * mode[k].damping * w};
    // States (w q, q̇).
    for (size_t i = 0; i < nu; i++) b[2 * i] = 0, b[2 * i + 1] = mode[k].in[i];
    for (size_t o = 0; o < ny; o++) c[o] = mode[k].out[o] / w, c[ny + o] = 0;
    pb_model_part part = {.size = 2, .a = a, .b = b, .c = c, .lda = 2, .ldb = 2, .ldc = ny};
    m->mode_hz[k] = mode[k].hz;
    m->mode_damping[k] = mode[k].damping;
    if (pb_model_builder_add(&builder, &part, NULL) != PB_OK) abort();
  }
  pb_model *out = NULL;
  if (pb_model_builder_close(&builder, 0, &out, NULL) != PB_OK) abort();
  return out;
}

#endif
