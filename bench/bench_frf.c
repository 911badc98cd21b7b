// What do a thousand frequencies cost, all inputs and outputs, beside one complex solve for each by
// LAPACK, and beside Octave's control package?
//
// Baseline: H(jω) = C (jωI − A)⁻¹ B + D of the dense state space by zgesv at each frequency, as a
// program does that knows nothing of A. It takes minutes at 2100 states; a few frequencies are
// solved and the time for one is multiplied, which favours the baseline (its caches are warm).
#include <complex.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/lapack.h"
#include "bench.h"
#include "model/model.h"
#include "plants.h"

enum { FREQUENCIES = 1000 };

typedef struct subject {
  const pb_model *m;
  double *hz;  // [FREQUENCIES]
  double complex *h;
  // The dense state space, and what a solve destroys.
  double *a;
  double complex *matrix, *x, *dense;
  int *pivot;
} subject;

static double *dense_matrix(const pb_model *m) {
  double *a = bench_memory(m->nx * m->nx, sizeof *a);
  for (size_t k = 0; k < m->blocks; k++) {
    const size_t start = m->block_start[k], size = m->block_start[k + 1] - start;
    for (size_t j = 0; j < size; j++)
      memcpy(a + start + (start + j) * m->nx, m->a + m->block_value[k] + j * size,
             size * sizeof *a);
  }
  return a;
}

static subject subject_open(const pb_model *m) {
  subject s = {.m = m, .a = dense_matrix(m)};
  s.hz = bench_memory(FREQUENCIES, sizeof *s.hz);
  s.h = bench_memory(FREQUENCIES * m->ny * m->nu, sizeof *s.h);
  s.matrix = bench_memory(m->nx * m->nx, sizeof *s.matrix);
  s.x = bench_memory(m->nx * m->nu, sizeof *s.x);
  s.dense = bench_memory(m->ny * m->nu, sizeof *s.dense);
  s.pivot = bench_memory(m->nx, sizeof *s.pivot);
  for (size_t f = 0; f < FREQUENCIES; f++)
    s.hz[f] = pow(10, 3.5 * (double)f / (FREQUENCIES - 1));  // 1 Hz … 3.2 kHz
  return s;
}

static void subject_close(subject *s) {
  free(s->a);
  free(s->hz);
  free(s->h);
  free(s->matrix);
  free(s->x);
  free(s->dense);
  free(s->pivot);
}

static void respond_ours(void *context, size_t repeats) {
  subject *s = context;
  pb_error err = {0};
  for (size_t k = 0; k < repeats; k++)
    bench_check(pb_model_frf(s->m, PB_CONTINUOUS, s->hz, FREQUENCIES, s->h, &err), &err);
}

// One frequency into s->dense [ny][nu].
static void solve_dense(subject *s, double hz) {
  const pb_model *m = s->m;
  const size_t n = m->nx;
  const double complex p = I * 2 * M_PI * hz;
  int size = (int)n, nu = (int)m->nu, info = 0;
  for (size_t i = 0; i < n * n; i++) s->matrix[i] = -s->a[i];
  for (size_t i = 0; i < n; i++) s->matrix[i + i * n] += p;
  for (size_t i = 0; i < n * m->nu; i++) s->x[i] = m->b[i];
  zgesv_(&size, &nu, s->matrix, &size, s->pivot, s->x, &size, &info);
  if (info) bench_fail("zgesv: %d", info);
  for (size_t o = 0; o < m->ny; o++)
    for (size_t i = 0; i < m->nu; i++) {
      double complex sum = m->d[o + i * m->ny];
      for (size_t r = 0; r < n; r++) sum += m->c[o + r * m->ny] * s->x[r + i * n];
      s->dense[o * m->nu + i] = sum;
    }
}

static void respond_dense(void *context, size_t repeats) {
  subject *s = context;
  for (size_t k = 0; k < repeats; k++) solve_dense(s, s->hz[k % FREQUENCIES]);
}

// Both must find the same; a model with electronics would not.
static void check_agreement(subject *s, const char *name) {
  const size_t entries = s->m->ny * s->m->nu;
  respond_ours(s, 1);
  for (size_t f = 400; f<FREQUENCIES; f += s->m->nx> 1000 ? FREQUENCIES : 300) {
    double worst = 0, scale = 0;
    solve_dense(s, s->hz[f]);
    for (size_t i = 0; i < entries; i++) {
      scale = fmax(scale, cabs(s->dense[i]));
      worst = fmax(worst, cabs(s->dense[i] - s->h[f * entries + i]));
    }
    if (!(worst <= 1e-9 * scale))
      bench_fail("%s: at %g Hz the dense solve differs by %g of %g", name, s->hz[f], worst, scale);
  }
}

// A large dense solve takes seconds: ours is measured by itself, then two solves.
static bench_ratio compare_large(subject *s) {
  bench_ratio r = {.ours = bench_measure(respond_ours, s, 1)};
  const double since = bench_now();
  respond_dense(s, 2);
  const double each = 0.5 * (bench_now() - since);
  r.baseline.median = each;
  r.ratio.median = each / r.ours.median;
  return r;
}

// ---- Octave -------------------------------------------------------------------------------------

static void write_matrix(FILE *file, const char *name, const double *a, size_t rows, size_t cols) {
  fprintf(file, "# name: %s\n# type: matrix\n# rows: %zu\n# columns: %zu\n", name, rows, cols);
  for (size_t i = 0; i < rows; i++) {
    for (size_t j = 0; j < cols; j++) fprintf(file, " %.17g", a[i + j * rows]);
    fputc('\n', file);
  }
}

// Seconds of freqresp of Octave's control package for the same thousand frequencies; NaN: it is not
// installed.
static double octave_seconds(const subject *s) {
  char data[] = "/tmp/bench-frf-XXXXXX", command[512], line[64] = "";
  const int fd = mkstemp(data);
  FILE *file = fd < 0 ? NULL : fdopen(fd, "w");
  if (!file) bench_fail("%s: cannot be written", data);
  const pb_model *m = s->m;
  write_matrix(file, "a", s->a, m->nx, m->nx);
  write_matrix(file, "b", m->b, m->nx, m->nu);
  write_matrix(file, "c", m->c, m->ny, m->nx);
  write_matrix(file, "d", m->d, m->ny, m->nu);
  write_matrix(file, "hz", s->hz, 1, FREQUENCIES);
  fclose(file);
  snprintf(command, sizeof command,
           "octave-cli --norc --quiet --eval \"sigterm_dumps_octave_core(0); pkg load control; "
           "load('%s'); s = ss(a,b,c,d); "
           "freqresp(s, 1); tic; freqresp(s, 2*pi*hz); printf('%%.9g\\n', toc)\" 2>/dev/null",
           data);
  FILE *pipe = popen(command, "r");
  const bool read = pipe && fgets(line, sizeof line, pipe);
  const bool ended = pipe && pclose(pipe) == 0;
  unlink(data);
  return read && ended ? strtod(line, NULL) : NAN;
}

static const bench_column columns[] = {
    {"states", "states", NULL, 4},
    {"inputs", "inputs", NULL, 2},
    {"outputs", "outputs", NULL, 2},
    {"ms", "1000 frequencies", "ms", 4},
    {"dense_ms", "zgesv", "ms", 4},
    {"ratio", "ratio", NULL, 3},
    {"octave_ms", "Octave control", "ms", 4},
    {"octave_ratio", "ratio to Octave", NULL, 3},
};

static void judge(bench *b, size_t states, double dense, double octave) {
  char what[120];
  if (states != 252 && states != 2100) return;
  snprintf(what, sizeof what, "%zu states: 1000 frequencies beside a dense solve for each", states);
  bench_goal(b, what, dense, BENCH_AT_LEAST, 30);
  if (isnan(octave)) return;
  snprintf(what, sizeof what, "%zu states: 1000 frequencies beside Octave's control package",
           states);
  bench_goal(b, what, octave, BENCH_AT_LEAST, 30);
}

int main(int argc, char **argv) {
  bench *b = bench_begin(argc, argv, "frf", "What do a thousand frequencies cost?");
  bench_blas_threads(1);
  bench_plants plants = bench_plants_load(bench_quick(b) ? 1000 : 0);
  bench_table *t = bench_table_add(b, "frf", "Frequency responses", "plant",
                                   sizeof columns / sizeof columns[0], columns);
  bool octave_missing = false;
  for (size_t k = 0; k < plants.count; k++) {
    const bench_plant *p = &plants.item[k];
    const pb_model *m = p->model;
    subject s = subject_open(m);
    check_agreement(&s, p->name);
    const double seconds = bench_quick(b) ? 0.3 : 1;
    const bench_ratio r = m->nx > 1000
                              ? compare_large(&s)
                              : bench_compare(respond_ours, &s, respond_dense, &s, seconds);
    const double octave = m->nx <= 300 && !bench_quick(b) ? octave_seconds(&s) : NAN;
    octave_missing = octave_missing || (m->nx <= 300 && !bench_quick(b) && isnan(octave));
    const double row[] = {(double)m->nx,
                          (double)m->nu,
                          (double)m->ny,
                          1e3 * r.ours.median,
                          1e3 * FREQUENCIES * r.baseline.median,
                          FREQUENCIES * r.ratio.median,
                          1e3 * octave,
                          octave / r.ours.median};
    bench_row(t, p->name, row);
    judge(b, m->nx, row[5], row[7]);
    subject_close(&s);
  }
  bench_growth(b, t, "states", "ms", 20);
  bench_growth(b, t, "states", "dense_ms", 20);
  if (octave_missing) bench_note(b, "Octave with its control package is not installed: skipped");
  if (bench_quick(b)) bench_note(b, "quick: without plants above 1000 states and without Octave");
  bench_note(b, "above 300 states Octave is left out: its text file alone would take minutes");
  bench_plants_free(&plants);
  return bench_end(b);
}
