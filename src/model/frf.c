// Frequency responses, poles and static gains of a compiled plant, block by block: see model.h.
//
//   H(p) = Σ_blocks C_b (p I − A_b)⁻¹ B_b + D        (sampled: A_d, B_d, and D z⁻¹)
//
// then, for the electronics, entry (o, i) times g_i e^{−s(d_i + d_o)T} or g_i z^{−(d_i + d_o)}.
#include <complex.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "model/block.h"
#include "model/frf_pairs.h"
#include "model/model.h"

static const double two_pi = 6.283185307179586476925286766559;

typedef struct basis {
  const double *a, *b;
} basis;

static basis choose(const pb_model *m, pb_time_base base) {
  return base == PB_CONTINUOUS ? (basis){m->a, m->b} : (basis){m->ad, m->bd};
}

// r = (p I − A)⁻¹ for a 2 × 2 block, column-major.
static void resolvent(const double *a, double complex p, double complex r[4]) {
  double complex d0 = p - a[0], d3 = p - a[3];
  double complex det = d0 * d3 - a[1] * a[2];
  r[0] = d3 / det;
  r[1] = a[1] / det;
  r[2] = a[2] / det;
  r[3] = d0 / det;
}

// h += C_b x, and dh −= C_b (p I − A)⁻¹ x with r the resolvent, for one input column.
static void add_pair(const pb_model *m, size_t start, const double complex r[4], double b0,
                     double b1, double complex *h, double complex *dh, size_t input) {
  double complex x0 = r[0] * b0 + r[2] * b1, x1 = r[1] * b0 + r[3] * b1;
  const double *c0 = m->c + start * m->ny, *c1 = c0 + m->ny;
  for (size_t o = 0; o < m->ny; o++) h[o * m->nu + input] += c0[o] * x0 + c1[o] * x1;
  if (!dh) return;
  double complex y0 = r[0] * x0 + r[2] * x1, y1 = r[1] * x0 + r[3] * x1;
  for (size_t o = 0; o < m->ny; o++) dh[o * m->nu + input] -= c0[o] * y0 + c1[o] * y1;
}

// The same for a block of any size n, all inputs. `work` holds n² + n nu complex numbers. Where the
// point is a pole of the block, the response is infinite.
static void add_block(const pb_model *m, const basis *at, size_t k, double complex p,
                      double complex *h, double complex *dh, double complex *work, int *pivot) {
  size_t start = m->block_start[k], n = m->block_start[k + 1] - start;
  const double *a = at->a + m->block_value[k];
  double complex *matrix = work, *x = work + n * n;
  int size = (int)n, nu = (int)m->nu, info = 0;
  for (size_t i = 0; i < m->nu; i++)
    for (size_t r = 0; r < n; r++) x[r + i * n] = at->b[start + r + i * m->nx];
  for (int order = 0; order < (dh ? 2 : 1); order++) {
    for (size_t i = 0; i < n * n; i++) matrix[i] = (i % (n + 1) == 0 ? p : 0) - a[i];
    zgesv_(&size, &nu, matrix, &size, pivot, x, &size, &info);
    for (size_t i = 0; i < m->nu; i++)
      for (size_t o = 0; o < m->ny; o++) {
        double complex sum = info ? INFINITY : 0;
        for (size_t r = 0; r < n && !info; r++) sum += m->c[o + (start + r) * m->ny] * x[r + i * n];
        if (order == 0)
          h[o * m->nu + i] += sum;
        else
          dh[o * m->nu + i] -= sum;
      }
  }
}

static double complex power(double complex x, uint32_t n) {
  double complex value = 1;
  for (; n; n >>= 1, x *= x)
    if (n & 1) value *= x;
  return value;
}

// h ← g E h, dh ← g (E dh + E' h), E the delay of d samples.
static void add_electronics(const pb_model *m, pb_time_base base, double complex p,
                            double complex *h, double complex *dh) {
  for (size_t i = 0; i < m->nu; i++) {
    pb_electronics in =
        base == PB_APPLIED ? pb_electronics_none() : pb_model_input_electronics(m, i);
    for (size_t o = 0; o < m->ny; o++) {
      size_t k = o * m->nu + i;
      uint32_t d = in.delay + pb_model_output_electronics(m, o).delay;
      if (d > 0) {
        bool continuous = base == PB_CONTINUOUS;
        double complex e = continuous ? cexp(-p * (d / m->sample_rate)) : power(1 / p, d);
        double complex slope = continuous ? -(d / m->sample_rate) : -(double)d / p;
        if (dh) dh[k] = e * (dh[k] + slope * h[k]);
        h[k] *= e;
      }
      h[k] *= in.gain;
      if (dh) dh[k] *= in.gain;
    }
  }
}

// h = D or D z⁻¹.
static void begin(const pb_model *m, bool sampled, double complex p, double complex *h,
                  double complex *dh) {
  double complex through = sampled ? 1 / p : 1;
  for (size_t o = 0; o < m->ny; o++) {
    for (size_t i = 0; i < m->nu; i++) {
      h[o * m->nu + i] = m->d[o + i * m->ny] * through;
      if (dh) dh[o * m->nu + i] = sampled ? -m->d[o + i * m->ny] / (p * p) : 0;
    }
  }
}

// `work` and `pivot` serve the blocks above 2 × 2 and may be NULL without such blocks.
static void finish(const pb_model *m, pb_time_base base, double complex p, double complex *h,
                   double complex *dh, double complex *work, int *pivot) {
  basis at = choose(m, base);
  for (size_t k = m->pairs; k < m->blocks; k++) add_block(m, &at, k, p, h, dh, work, pivot);
  if (m->input_electronics || m->output_electronics) add_electronics(m, base, p, h, dh);
}

static void evaluate(const pb_model *m, pb_time_base base, double complex p, double complex *h,
                     double complex *dh, double complex *work, int *pivot) {
  basis at = choose(m, base);
  begin(m, base != PB_CONTINUOUS, p, h, dh);
  for (size_t k = 0; k < m->pairs; k++) {
    double complex r[4];
    size_t start = m->block_start[k];
    resolvent(at.a + m->block_value[k], p, r);
    for (size_t i = 0; i < m->nu; i++) {
      const double *b = at.b + start + i * m->nx;
      if (b[0] == 0 && b[1] == 0) continue;
      add_pair(m, start, r, b[0], b[1], h, dh, i);
    }
  }
  finish(m, base, p, h, dh, work, pivot);
}

// Scratch of `evaluate` for models with blocks above 2 × 2.
static bool scratch_new(const pb_model *m, double complex **work, int **pivot) {
  *work = NULL;
  *pivot = NULL;
  if (m->pairs == m->blocks) return true;
  *work = malloc((m->widest * m->widest + m->widest * m->nu + 1) * sizeof **work);
  *pivot = malloc((m->widest + 1) * sizeof **pivot);
  return *work && *pivot;
}

void pb_model_evaluate(const pb_model *m, pb_time_base base, double complex point,
                       double complex *h, double complex *dh) {
  double complex *work;
  int *pivot;
  if (scratch_new(m, &work, &pivot)) {
    evaluate(m, base, point, h, dh, work, pivot);
  } else {
    for (size_t i = 0; i < m->ny * m->nu; i++) {
      h[i] = NAN;
      if (dh) dh[i] = NAN;
    }
  }
  free(work);
  free(pivot);
}

// e^{iθ} − 1, exact to the last digits at small θ.
static double complex turn(double theta) {
  double half = sin(0.5 * theta);
  return -2 * half * half + I * sin(theta);
}

static bool all_finite(const double complex *h, size_t count) {
  for (size_t i = 0; i < count; i++)
    if (!isfinite(creal(h[i])) || !isfinite(cimag(h[i]))) return false;
  return true;
}

// Many points at once; at a pole, where one block's infinity would spread to every entry, again by
// itself.
static pb_status respond(const pb_model *m, pb_time_base base, const double *hz, size_t nf,
                         double complex *h, double complex *work, int *pivot, pb_error *err) {
  const basis at = choose(m, base);
  const bool sampled = base != PB_CONTINUOUS;
  const size_t entries = m->ny * m->nu;
  double complex *q = malloc((nf + 1) * sizeof *q);
  if (!q) return pb_fail_memory(err, "");
  for (size_t f = 0; f < nf; f++) {
    const double w = two_pi * hz[f];
    q[f] = sampled ? turn(w / m->sample_rate) : I * w;
  }
  pb_status st = pb_pairs_response(m, at.a, at.b, sampled ? 1 : 0, q, nf, h, err);
  for (size_t f = 0; f < nf && !st; f++) {
    const double complex p = sampled ? 1 + q[f] : q[f];
    if (all_finite(h + f * entries, entries))
      finish(m, base, p, h + f * entries, NULL, work, pivot);
    else
      evaluate(m, base, p, h + f * entries, NULL, work, pivot);
  }
  free(q);
  return st;
}

pb_status pb_model_frf(const pb_model *m, pb_time_base base, const double *hz, size_t nf,
                       double complex *h, pb_error *err) {
  for (size_t f = 0; f < nf; f++)
    if (!isfinite(hz[f]) || hz[f] < 0)
      return pb_fail(err, PB_ERR_ARGUMENT, "frequency", "%g Hz is not a frequency", hz[f]);
  double complex *work;
  int *pivot;
  pb_status st = scratch_new(m, &work, &pivot) ? PB_OK : pb_fail_memory(err, "");
  if (!st) st = respond(m, base, hz, nf, h, work, pivot, err);
  free(work);
  free(pivot);
  return st;
}

pb_status pb_model_poles(const pb_model *m, pb_time_base base, double complex *poles,
                         pb_error *err) {
  const double *values = choose(m, base).a;
  pb_status st = PB_OK;
  for (size_t k = 0; k < m->blocks && !st; k++) {
    size_t start = m->block_start[k], size = m->block_start[k + 1] - start;
    const double *a = values + m->block_value[k];
    st = pb_block_poles(size, a, poles + start, err);
  }
  return st;
}

pb_status pb_model_dc(const pb_model *m, double *gain, pb_error *err) {
  double complex *h = malloc((m->ny * m->nu + 1) * sizeof *h);
  if (!h) return pb_fail_memory(err, "");
  const double zero = 0;
  pb_status st = pb_model_frf(m, PB_CONTINUOUS, &zero, 1, h, err);
  for (size_t i = 0; i < m->ny * m->nu && !st; i++)
    gain[i] = isfinite(creal(h[i])) ? creal(h[i]) : INFINITY;
  free(h);
  return st;
}
