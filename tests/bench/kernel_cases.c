// The kernels whose instructions are counted, each in a function of its own: case_NAME. Run under
// callgrind by test_instructions; alone it says for which compiler and C library a count holds, and
// which cases this processor has.
#include <gnu/libc-version.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "modal_model.h"
#include "model/step_kernel.h"

enum { MODES = 24, INPUTS = 12, OUTPUTS = 18, STEPS = 200, FREQUENCIES = 20 };

static double u[INPUTS], y[OUTPUTS];

// As many states, inputs and outputs as the hexapod has.
static pb_model *hexapod_size(void) {
  static test_mode mode[MODES];
  static double in[MODES][INPUTS], out[MODES][OUTPUTS], direct[INPUTS * OUTPUTS];
  for (int k = 0; k < MODES; k++) {
    mode[k] = (test_mode){20 + 30 * k, 0.01, in[k], out[k]};
    for (int i = 0; i < INPUTS; i++) in[k][i] = sin(1 + k + 7 * i);
    for (int o = 0; o < OUTPUTS; o++) out[k][o] = cos(2 + k + 5 * o);
  }
  direct[3] = 0.5;
  return test_model(mode, MODES, INPUTS, OUTPUTS, 10000, direct);
}

static void steps(pb_model *m, pb_state *s) {
  for (int k = 0; k < STEPS; k++) {
    u[k % INPUTS] = 0.01 * k;
    pb_step_output(m, s, y);
    pb_step_advance(m, s, u);
  }
}

#define STEP_CASE(name)                                                            \
  __attribute__((noinline, used)) void case_step_##name(pb_model *m, pb_state *s); \
  void case_step_##name(pb_model *m, pb_state *s) {                                \
    steps(m, s);                                                                   \
  }

STEP_CASE(portable)
STEP_CASE(avx2)

__attribute__((noinline, used)) void case_frf(const pb_model *m, const double *hz,
                                              double complex *h);
void case_frf(const pb_model *m, const double *hz, double complex *h) {
  if (pb_model_frf(m, PB_CONTINUOUS, hz, FREQUENCIES, h, NULL)) printf("frf failed\n");
}

static void run_step(pb_model *m, const char *name, void (*run)(pb_model *, pb_state *)) {
  const pb_step_kernel *kernel[3];
  const size_t kernels = pb_step_kernels(kernel);
  pb_state *s = pb_state_new(m);
  for (size_t k = 0; s && k < kernels; k++) {
    if (strcmp(kernel[k]->name, name) != 0) continue;
    m->step->kernel = kernel[k];
    run(m, s);
    printf("case step_%s\n", name);
  }
  free(s);
}

int main(void) {
  static double hz[FREQUENCIES];
  static double complex h[FREQUENCIES * OUTPUTS * INPUTS];
  pb_model *m = hexapod_size();
  for (int k = 0; k < FREQUENCIES; k++) hz[k] = 7 + 31 * k;
  printf("compiler %s\nlibc %s\n", __VERSION__, gnu_get_libc_version());
  run_step(m, "portable", case_step_portable);
  run_step(m, "avx2", case_step_avx2);
  case_frf(m, hz, h);
  printf("case frf\n");
  pb_model_free(m);
  return 0;
}
