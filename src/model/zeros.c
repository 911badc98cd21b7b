// Transmission zeros: see zeros.h.
//
// Candidates are the finite eigenvalues of the Rosenbrock pencil
//
//   [A − sI  B]
//   [C       D]
//
// of the scaled channel, by the QZ method. Large models are first cut to a few hundred states with
// their static residual. Each candidate is then polished on the exact H(s) by Newton's method on
// the smallest singular value (u, v its vectors; for one input and output plainly H/H′):
//
//   s ← s − (uᴴ H v) / (uᴴ H′ v)
//
// Zeros of higher order are counted afterwards (zeros_multiple.c).
// Infinite eigenvalues that rounding made finite do not survive: at a genuine zero the rounding
// error of H moves it by little, at those by as much as they are away. Source of the functional:
// Schwetlick and Schreiber, "Nonlinear Rayleigh functionals", Linear Algebra Appl. 436 (2012).
#include "model/zeros.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

#include "base/lapack.h"
#include "model/zeros_finder.h"

static const double pi = 3.14159265358979323846;

// A mode that contributes less than this part of H at its own resonance counts as not seen.
static const double unseen = 1e-9;

// ---- the pencil ---------------------------------------------------------------------------------

// Eigenvalues of the pencil in rad/s into s[n + m]; *found excludes infinite ones. Time is scaled
// by w: H = D + (C/√w) (σI − A/w)⁻¹ (B/√w), s = w σ.
static void fill_pencil(const pb_channel *ch, double w, double *p, double *q) {
  size_t size = ch->n + ch->m;
  double root = 1 / sqrt(w);
  for (size_t k = 0; k < ch->blocks; k++) {
    size_t first = ch->start[k], nb = ch->start[k + 1] - first;
    for (size_t i = 0; i < nb * nb; i++) {
      p[(first + i / nb) * size + first + i % nb] = ch->a[ch->value[k] + i] / w;
    }
  }
  for (size_t j = 0; j < ch->n; j++) {
    q[j * size + j] = 1;
    for (size_t k = 0; k < ch->m; k++) {
      p[(ch->n + k) * size + j] = ch->b[j * ch->m + k] * root;
      p[j * size + ch->n + k] = ch->c[j * ch->m + k] * root;
    }
  }
  for (size_t i = 0; i < ch->m; i++) {
    for (size_t o = 0; o < ch->m; o++) p[(ch->n + i) * size + ch->n + o] = ch->d[i * ch->m + o];
  }
}

static pb_status pencil_zeros(const pb_channel *ch, double w, double complex *s, size_t *found,
                              pb_error *err) {
  size_t size = ch->n + ch->m;
  int n = (int)size, one = 1, lwork = 16 * n + 64, info = 0;
  double *p = calloc(2 * size * size + 3 * size + (size_t)lwork, sizeof *p), none;
  if (!p) return pb_fail_memory(err, "zeros");
  double *q = p + size * size, *re = q + size * size, *im = re + size, *beta = im + size;
  fill_pencil(ch, w, p, q);
  dggev_("N", "N", &n, p, &n, q, &n, re, im, beta, &none, &one, &none, &one, beta + size, &lwork,
         &info);
  *found = 0;
  for (size_t k = 0; info == 0 && k < size; k++) {
    double top = hypot(re[k], im[k]);
    if (im[k] < 0 || fabs(beta[k]) <= 1e-15 * top) continue;
    s[(*found)++] = w * (re[k] / beta[k] + I * (im[k] / beta[k]));
  }
  free(p);
  if (info) return pb_fail(err, PB_ERR_NUMERIC, "zeros", "the QZ method did not converge");
  return PB_OK;
}

// How many zeros lie at a polished one: the singular values that vanish there.
static size_t multiplicity(pb_zero_finder *f, double complex s) {
  double complex step;
  double doubt;
  size_t many = 0;
  if (!pb_zero_step(f, s, &step, &doubt)) return 1;
  for (size_t k = 0; k < f->channel->m; k++) {
    double slope = cabs(pb_zero_project(f, f->dh, k));
    many += f->sigma[k] < 1e-6 * slope * pb_zero_scale(f, s);
  }
  return many ? many : 1;
}

// At the origin H may vanish to second order (accelerations): H′ vanishes too and Newton's method
// has nothing to divide by, so H itself is judged.
static bool zero_at_origin(pb_zero_finder *f, double complex s) {
  double size, reference;
  if (cabs(s) > 1e-4 * f->slowest) return false;
  pb_channel_evaluate(f->channel, 0.5 * I * f->slowest, f->h, NULL, &reference);
  pb_channel_evaluate(f->channel, 0, f->h, NULL, &size);
  return isfinite(size) && pb_zero_decompose(f) && f->sigma[f->channel->m - 1] < 1e-9 * reference;
}

// False: it is listed already.
static bool accept(pb_zero_finder *f, double complex s) {
  size_t alike = 0;
  for (size_t k = 0; k < f->count; k++) {
    alike += cabs(f->zero[k] - s) < 1e-6 * pb_zero_scale(f, s);
  }
  if (alike && s != 0 && alike >= multiplicity(f, s)) return false;
  f->zero[f->count++] = s;
  return true;
}

// Lists what the candidates lead to; those that lead nowhere new are left in the same list.
// Returns how many they are.
static size_t polish_all(pb_zero_finder *f, double complex *candidate, size_t count, double band) {
  size_t lost = 0;
  for (size_t k = 0; k < count; k++) {
    double complex s = candidate[k];
    if (band > 0 && cimag(s) > 1.2 * band) continue;
    if (zero_at_origin(f, s)) {
      accept(f, 0);
      if (cimag(s) > 0) accept(f, 0);
      continue;
    }
    if (!pb_zero_polish(f, &s)) {
      candidate[lost++] = s;
    } else if ((band <= 0 || cimag(s) <= band) && !pb_zero_cancelled(f, s)) {
      if (!accept(f, s)) candidate[lost++] = s;
    }
  }
  return lost;
}

// ---- preparing ----------------------------------------------------------------------------------

static int compare_double(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

static int compare_zero(const void *a, const void *b) {
  double x = cabs(*(const double complex *)a), y = cabs(*(const double complex *)b);
  return (x > y) - (x < y);
}

pb_status pb_channel_drop_unseen(pb_channel *ch, pb_error *err) {
  bool *keep = calloc(ch->blocks + 1, sizeof *keep);
  double complex *h = malloc(ch->m * ch->m * sizeof *h);
  double slowest, middle, size;
  pb_status status = keep && h ? PB_OK : pb_fail_memory(err, "zeros");
  pb_channel_measure(ch, &slowest, &middle);
  for (size_t k = 0; !status && k < ch->blocks; k++) {
    // A hair off the axis: an undamped mode is infinite on it.
    double complex s = (1e-8 + I) * (ch->radius[k] > 0 ? ch->radius[k] : 1e-3 * slowest);
    double largest = 0;
    pb_channel_evaluate(ch, s, h, NULL, &size);
    for (size_t i = 0; i < ch->m * ch->m; i++) largest = fmax(largest, cabs(h[i]));
    keep[k] = pb_channel_block_size(ch, k, s) > unseen * largest;
  }
  if (!status) pb_channel_keep(ch, keep, false);
  free(keep);
  free(h);
  return status;
}

// Cuts to the slowest PB_ZEROS_DIRECT states, but keeps what lies within twice the band.
static pb_status cut(pb_channel *ch, double band, pb_error *err) {
  bool *keep = calloc(ch->blocks + 1, sizeof *keep);
  double *sorted = malloc((ch->blocks + 1) * sizeof *sorted);
  pb_status status = keep && sorted ? PB_OK : pb_fail_memory(err, "zeros");
  if (!status) {
    size_t budget = PB_ZEROS_DIRECT * ch->blocks / ch->n;
    for (size_t k = 0; k < ch->blocks; k++) sorted[k] = ch->radius[k];
    qsort(sorted, ch->blocks, sizeof *sorted, compare_double);
    double border = fmax(2 * band, sorted[budget < ch->blocks ? budget : ch->blocks - 1]);
    for (size_t k = 0; k < ch->blocks; k++) keep[k] = ch->radius[k] < border;
    pb_channel_keep(ch, keep, true);
  }
  free(keep);
  free(sorted);
  return status;
}

// H that is singular wherever one looks has no zeros but only rank.
static pb_status refuse_singular(pb_zero_finder *f, pb_error *err) {
  for (int k = 0; k < 5; k++) {
    double size;
    double complex s = f->middle * cexp(I * (0.3 + 0.25 * k)) * (0.5 + 0.4 * k);
    pb_channel_evaluate(f->channel, s, f->h, NULL, &size);
    if (!pb_zero_decompose(f))
      return pb_fail(err, PB_ERR_NUMERIC, "zeros", "H has no singular values");
    if (f->sigma[f->channel->m - 1] > 1e-11 * size) return PB_OK;
  }
  return pb_fail(err, PB_ERR_SINGULAR, "zeros",
                 "the transfer matrix of these inputs and outputs is singular everywhere");
}

// ---- together -----------------------------------------------------------------------------------

// Sorted, each pair as two conjugates, in memory of its own.
static pb_status hand_over(pb_zero_finder *f, double complex **zeros, size_t *count,
                           pb_error *err) {
  double complex *out = malloc((2 * f->count + 1) * sizeof *out);
  if (!out) return pb_fail_memory(err, "zeros");
  qsort(f->zero, f->count, sizeof *f->zero, compare_zero);
  size_t n = 0;
  for (size_t k = 0; k < f->count; k++) {
    double complex s = f->zero[k];
    out[n++] = s;
    if (cimag(s) != 0) out[n++] = conj(s);
  }
  *zeros = out;
  *count = n;
  return PB_OK;
}

static pb_status find(pb_zero_finder *f, double band, pb_error *err) {
  pb_channel reduced = {0};
  double complex *candidate = NULL;
  size_t count;
  const pb_channel *source = f->channel;
  pb_status status = refuse_singular(f, err);
  if (!status && source->n > PB_ZEROS_DIRECT) {
    status = pb_channel_copy(source, &reduced, err);
    if (!status) status = cut(&reduced, band, err);
    f->reach = 0.1;
    source = &reduced;
  }
  if (!status) {
    candidate = malloc((source->n + source->m) * sizeof *candidate);
    if (!candidate) status = pb_fail_memory(err, "zeros");
  }
  if (!status) status = pencil_zeros(source, f->middle, candidate, &count, err);
  if (!status) {
    count = polish_all(f, candidate, count, band);
    status = pb_zeros_recover(f, candidate, count, band, err);
  }
  free(candidate);
  pb_channel_free(&reduced);
  return status;
}

pb_status pb_model_zeros(const pb_model *model, const size_t *input, const size_t *output,
                         size_t count, double max_hz, double complex **zeros, size_t *zero_count,
                         pb_error *err) {
  pb_channel channel;
  pb_zero_finder f = {0};
  *zeros = NULL;
  *zero_count = 0;
  if (!(isfinite(max_hz) && max_hz >= 0)) {
    return pb_fail(err, PB_ERR_ARGUMENT, "zeros", "the band must be a frequency, or 0 for all");
  }
  pb_status status = pb_channel_open(model, input, output, count, &channel, err);
  if (!status) status = pb_channel_drop_unseen(&channel, err);
  if (!status && channel.n > PB_ZEROS_DIRECT && max_hz == 0) {
    status =
        pb_fail(err, PB_ERR_ARGUMENT, "zeros",
                "%zu states are too many to find all zeros; give a highest frequency", channel.n);
  }
  if (!status && !pb_zero_finder_open(&f, &channel)) status = pb_fail_memory(err, "zeros");
  if (!status) status = find(&f, 2 * pi * max_hz, err);
  if (!status) status = hand_over(&f, zeros, zero_count, err);
  pb_zero_finder_close(&f);
  pb_channel_free(&channel);
  return status;
}
