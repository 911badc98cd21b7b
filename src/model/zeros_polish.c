// Newton's method on the smallest singular value of H: see zeros_finder.h.
#include <math.h>
#include <stdlib.h>

#include "base/lapack.h"
#include "model/zeros_finder.h"

// ---- memory -------------------------------------------------------------------------------------

void pb_channel_measure(const pb_channel *ch, double *slowest, double *middle) {
  double sum = 0;
  size_t count = 0;
  *slowest = INFINITY;
  for (size_t k = 0; k < ch->blocks; k++) {
    if (!(ch->radius[k] > 0)) continue;
    *slowest = fmin(*slowest, ch->radius[k]);
    sum += log(ch->radius[k]);
    count++;
  }
  *middle = count ? exp(sum / (double)count) : 1;
  if (!count) *slowest = 1;
}

bool pb_zero_finder_open(pb_zero_finder *f, const pb_channel *channel) {
  size_t m = channel->m, work = 16 * m + 64 + m * m;
  *f = (pb_zero_finder){.channel = channel, .reach = 1e-2};
  f->h = calloc(4 * m * m + work, sizeof *f->h);
  f->sigma = calloc(m + 5 * m, sizeof *f->sigma);
  f->zero = calloc(2 * (channel->n + m) + 2, sizeof *f->zero);
  if (!f->h || !f->sigma || !f->zero) return false;
  f->dh = f->h + m * m;
  f->u = f->dh + m * m;
  f->vh = f->u + m * m;
  f->work = f->vh + m * m;
  f->rwork = f->sigma + m;
  pb_channel_measure(channel, &f->slowest, &f->middle);
  return true;
}

void pb_zero_finder_close(pb_zero_finder *f) {
  free(f->h);
  free(f->sigma);
  free(f->zero);
}

// ---- Newton's method ----------------------------------------------------------------------------

// Singular values of h (destroyed) and the vectors of all of them.
bool pb_zero_decompose(pb_zero_finder *f) {
  int m = (int)f->channel->m, lwork = 16 * m + 64, info = 0;
  if (m == 1) {  // uᴴ h v = h: the plain Newton method
    f->sigma[0] = cabs(f->h[0]);
    f->u[0] = f->vh[0] = 1;
    return true;
  }
  double complex *copy = f->work + lwork;
  for (int k = 0; k < m * m; k++) copy[k] = f->h[k];
  zgesvd_("A", "A", &m, &m, copy, &m, f->sigma, f->u, &m, f->vh, &m, f->work, &lwork, f->rwork,
          &info);
  return info == 0;
}

// u_kᴴ M v_k
double complex pb_zero_project(const pb_zero_finder *f, const double complex *matrix, size_t k) {
  size_t m = f->channel->m;
  double complex sum = 0;
  for (size_t i = 0; i < m; i++) {
    for (size_t o = 0; o < m; o++) {
      sum += conj(f->u[k * m + o]) * matrix[i * m + o] * conj(f->vh[i * m + k]);
    }
  }
  return sum;
}

// H, H′ and the decomposition at s; returns the Newton step of the smallest singular value and, in
// *doubt, how far the rounding error of H may move the zero. false: nothing to divide by.
bool pb_zero_step(pb_zero_finder *f, double complex s, double complex *step, double *doubt) {
  double size;
  size_t last = f->channel->m - 1;
  pb_channel_evaluate(f->channel, s, f->h, f->dh, &size);
  if (!isfinite(size) || !pb_zero_decompose(f)) return false;
  double complex slope = pb_zero_project(f, f->dh, last);
  if (slope == 0) return false;
  *step = pb_zero_project(f, f->h, last) / slope;
  *doubt = 1e-11 * size / cabs(slope);
  return isfinite(cabs(*step));
}

double pb_zero_scale(const pb_zero_finder *f, double complex s) {
  return fmax(cabs(s), f->slowest);
}

// Moves *s onto the zero next to it; false: there is none.
bool pb_zero_polish(pb_zero_finder *f, double complex *s) {
  double complex start = *s, at = start, step = 0;
  double doubt = 0, last = INFINITY;
  for (int turn = 0; turn < 60; turn++) {
    if (!pb_zero_step(f, at, &step, &doubt)) return false;
    double length = cabs(step), scale = pb_zero_scale(f, at);
    // The last digits of H are noise: no better once a small step does not shrink any more.
    if (length <= 1e-15 * scale || (length < 1e-8 * scale && length > 0.5 * last)) break;
    at -= step;
    if (cimag(start) == 0) at = creal(at);
    if (cabs(at - start) > f->reach * pb_zero_scale(f, start)) return false;
    last = length;
  }
  *s = at;  // also of one that does not settle: a zero of higher order draws it near
  return cabs(step) < 1e-7 * pb_zero_scale(f, at) && doubt < 1e-3 * pb_zero_scale(f, at);
}

// Two modes of one frequency are one to a single channel: between their poles, a rounding error
// apart, H passes through 0, but a hair beside that it is not what its slope there says.
bool pb_zero_cancelled(pb_zero_finder *f, double complex s) {
  double complex step, slope;
  double doubt, hair = 1e-7 * pb_zero_scale(f, s);
  size_t last = f->channel->m - 1;
  if (!pb_zero_step(f, s, &step, &doubt)) return false;
  slope = pb_zero_project(f, f->dh, last);
  if (!pb_zero_step(f, s + hair, &step, &doubt)) return false;
  return f->sigma[last] < 0.1 * cabs(slope) * hair;
}
