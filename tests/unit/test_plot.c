// The plots: PNG files of the right size with something drawn in them, failures that name their
// cause and leave nothing behind. PB_PLOT_KEEP=DIR (of the environment) keeps the pictures for the
// eye.
#include "plot.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

enum { N = 400 };

static char folder[256];
static bool keep;

static const char *path_of(const char *name) {
  static char path[512];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  return path;
}

static int make_folder(void **state) {
  (void)state;
  const char *kept = getenv("PB_PLOT_KEEP");
  keep = kept != NULL;
  snprintf(folder, sizeof folder, "%s", kept ? kept : "/tmp/pb-plot-XXXXXX");
  return kept || mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state) {
  (void)state;
  // The folder must be empty: every test removes what it made, and no temporary file may stay.
  return keep ? 0 : rmdir(folder);
}

static uint32_t big_endian(const unsigned char *p) {
  return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

// Checks signature and size of the picture, and that it is not an empty frame; removes it.
static void check_png(const char *path, uint32_t width, uint32_t height, long least) {
  unsigned char head[24];
  FILE *file = fopen(path, "rb");
  assert_non_null(file);
  assert_int_equal(fread(head, 1, sizeof head, file), sizeof head);
  fseek(file, 0, SEEK_END);
  long size = ftell(file);
  fclose(file);
  assert_memory_equal(head, "\x89PNG\r\n\x1a\n", 8);
  assert_int_equal(big_endian(head + 16), width);
  assert_int_equal(big_endian(head + 20), height);
  assert_true(size > least);
  if (!keep) assert_int_equal(unlink(path), 0);
}

static void check_ok(pb_status status, const pb_error *err) {
  if (status) fail_msg("%s: %s", err->where, err->message);
}

// The bench as two resonances: (s² + 2ζz s + z²) / (s² + 2ζp s + p²).
static double complex bench(double hz, double damping) {
  double complex s = 2 * M_PI * I * hz;
  double p = 2 * M_PI * 93.7, z = 2 * M_PI * 39.0;
  return -0.22 * (s * s + 0.01 * z * s + z * z) / (s * s + 2 * damping * p * s + p * p);
}

static void test_bode(void **state) {
  (void)state;
  static double hz[N], coherence[N];
  static double complex exact[N], measured[N], damped[N];
  for (int i = 0; i < N; i++) {
    hz[i] = 5 * pow(100, (double)i / (N - 1));
    exact[i] = bench(hz[i], 0.01);
    damped[i] = bench(hz[i], 0.2);
    measured[i] = exact[i] + 0.01 * (cos(97 * i) + I * sin(131 * i));
    coherence[i] = 1 / (1 + 1e-4 / pow(cabs(exact[i]), 2));
  }
  pb_bode_curve curve[3] = {
      {.label = "Va → Vs measured",
       .style = PB_PLOT_THIN,
       .count = N,
       .hz = hz,
       .h = measured,
       .coherence = coherence,
       .color = 6},
      {.label = "Va → Vs model",
       .style = PB_PLOT_DASHED,
       .count = N,
       .hz = hz,
       .h = exact,
       .color = 1},
      {.label = "Va → Vs with K_IFF, g = 100", .count = N, .hz = hz, .h = damped, .color = 2},
  };
  pb_bode_plot plot = {.title = "apa300ml-bench-2dof: identified and exact",
                       .unit = "V/V",
                       .count = 3,
                       .curve = curve};
  pb_error err = {0};
  const char *path = path_of("bode.png");
  check_ok(pb_plot_bode(path, &plot, &err), &err);
  check_png(path, 1200, 900, 20000);
  plot.decibel = true;
  curve[0].coherence = NULL;
  check_ok(pb_plot_bode(path_of("bode_db.png"), &plot, &err), &err);
  check_png(path_of("bode_db.png"), 1200, 900, 20000);
}

static void test_many_curves(void **state) {
  (void)state;
  static double hz[N];
  static double complex h[36][N];
  static char label[36][16];
  pb_bode_curve curve[36];
  for (int k = 0; k < 36; k++) {
    snprintf(label[k], sizeof label[k], "Va%d → Vs%d", k / 6 + 1, k % 6 + 1);
    for (int i = 0; i < N; i++) {
      hz[i] = pow(1000, (double)i / (N - 1));
      h[k][i] = (k % 7 ? 0.05 : 1) * bench(hz[i] * (1 + 0.02 * k), 0.01);
    }
    curve[k] = (pb_bode_curve){.label = label[k], .count = N, .hz = hz, .h = h[k]};
  }
  pb_bode_plot plot = {.title = "nano-hexapod", .unit = "V/V", .count = 36, .curve = curve};
  pb_error err = {0};
  check_ok(pb_plot_bode(path_of("bode_36.png"), &plot, &err), &err);
  check_png(path_of("bode_36.png"), 1200, 900 + 3 * 25, 40000);
}

static void test_locus(void **state) {
  (void)state;
  enum { GAINS = 200 };
  static double complex branch[2 * GAINS];
  double z = 2 * M_PI * 39, p = 2 * M_PI * 93.7;
  // Integral force feedback: s (s² + p²) + g (s² + z²) = 0, followed from g = 0 by Newton's method.
  for (int b = 0; b < 2; b++) {
    double complex s = b ? 0 : I * p;
    for (int k = 0; k < GAINS; k++) {
      double g = 1500.0 * k / (GAINS - 1);
      for (int i = 0; i < 30; i++) {
        s -= (s * (s * s + p * p) + g * (s * s + z * z)) / (3 * s * s + p * p + 2 * g * s);
      }
      branch[b * GAINS + k] = s;
    }
  }
  double complex pole[] = {0, I * p, -I * p}, zero[] = {I * z, -I * z};
  double complex closed[] = {branch[GAINS / 3], branch[GAINS + GAINS / 3]};
  pb_locus_plot plot = {.title = "Integral force feedback on the bench",
                        .poles = 3,
                        .zeros = 2,
                        .pole = pole,
                        .zero = zero,
                        .closed = closed,
                        .chosen = 2,
                        .chosen_label = "g = 500",
                        .branches = 2,
                        .gains = GAINS,
                        .branch = branch,
                        .measured = closed,
                        .measured_count = 1};
  pb_error err = {0};
  check_ok(pb_plot_locus(path_of("locus.png"), &plot, &err), &err);
  check_png(path_of("locus.png"), 1200, 900, 20000);
}

static void test_time(void **state) {
  (void)state;
  static double t[N], before[N], after[N];
  for (int i = 0; i < N; i++) {
    t[i] = 1e-3 * i;
    before[i] = i == 200 ? NAN : exp(-6 * t[i]) * sin(2 * M_PI * 20 * t[i]);
    after[i] = exp(-40 * t[i]) * sin(2 * M_PI * 20 * t[i]);
  }
  pb_plot_curve curve[2] = {
      {.label = "it's open loop", .count = N, .x = t, .y = before},
      {.label = "IFF", .style = PB_PLOT_STEPS, .count = N, .x = t, .y = after}};
  pb_plot_panel panel[2] = {
      {.x = {.label = "Time (s)"}, .y = {.label = "y (µm)"}, .count = 2, .curve = curve},
      {.x = {.label = "Time (s)"}, .y = {.label = "y (µm)"}, .count = 1, .curve = curve + 1}};
  pb_plot_figure figure = {
      .title = "Step of Va, 1 V", .shared_x = true, .count = 2, .panel = panel};
  pb_error err = {0};
  check_ok(pb_plot(path_of("time.png"), &figure, &err), &err);
  check_png(path_of("time.png"), 1200, 900, 15000);
}

// ---- failures -----------------------------------------------------------------------------------

static pb_plot_figure small_figure(void) {
  static const double x[2] = {0, 1}, y[2] = {1, 2};
  static pb_plot_curve curve = {.label = "a", .count = 2, .x = x, .y = y};
  static pb_plot_panel panel = {
      .x = {.label = "x"}, .y = {.label = "y"}, .count = 1, .curve = &curve};
  return (pb_plot_figure){.count = 1, .panel = &panel};
}

static void test_missing_gnuplot(void **state) {
  (void)state;
  pb_plot_figure figure = small_figure();
  char *saved = strdup(getenv("PATH"));
  pb_error err = {0};
  setenv("PATH", folder, 1);
  pb_status status = pb_plot(path_of("none.png"), &figure, &err);
  setenv("PATH", saved, 1);
  free(saved);
  assert_int_equal(status, PB_ERR_IO);
  assert_non_null(strstr(err.message, "gnuplot-nox"));
  assert_int_equal(access(path_of("none.png"), F_OK), -1);
}

static void test_failing_gnuplot(void **state) {
  (void)state;
  char tool[512];
  snprintf(tool, sizeof tool, "%s/gnuplot", folder);
  FILE *script = fopen(tool, "w");
  fputs("#!/bin/sh\necho 'line 3: no such terminal' >&2\nexit 1\n", script);
  fclose(script);
  chmod(tool, 0755);
  pb_plot_figure figure = small_figure();
  char *saved = strdup(getenv("PATH"));
  pb_error err = {0};
  setenv("PATH", folder, 1);
  pb_status status = pb_plot(path_of("bad.png"), &figure, &err);
  setenv("PATH", saved, 1);
  free(saved);
  unlink(tool);
  assert_int_equal(status, PB_ERR_IO);
  assert_non_null(strstr(err.message, "line 3: no such terminal"));
  assert_int_equal(access(path_of("bad.png"), F_OK), -1);
}

static void test_refusals(void **state) {
  (void)state;
  pb_plot_figure nothing = {.count = 0}, figure = small_figure();
  pb_error err = {0};
  assert_int_equal(pb_plot(path_of("x.png"), &nothing, &err), PB_ERR_ARGUMENT);
  assert_int_equal(pb_plot(path_of("no/such/x.png"), &figure, &err), PB_ERR_IO);
  assert_non_null(strstr(err.where, "no/such/x.png"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_bode),
      cmocka_unit_test(test_many_curves),
      cmocka_unit_test(test_locus),
      cmocka_unit_test(test_time),
      cmocka_unit_test(test_missing_gnuplot),
      cmocka_unit_test(test_failing_gnuplot),
      cmocka_unit_test(test_refusals),
  };
  return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
