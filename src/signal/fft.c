// Mixed-radix Stockham transform, and Bluestein's for the lengths it does not cover: see fft.h.
#include "signal/fft.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "signal/small_solve.h"

enum { MAX_RADIX = 7 };

// Fills factor[] with radices 4, 2, 3, 5, 7 whose product is n; returns their number, 0 if n has
// others.
static size_t factorise(size_t n, size_t *factor) {
  static const size_t radix[] = {4, 2, 3, 5, 7};
  size_t count = 0;
  for (size_t i = 0; i < sizeof radix / sizeof *radix; i++) {
    while (n % radix[i] == 0) {
      factor[count++] = radix[i];
      n /= radix[i];
    }
  }
  return n == 1 ? count : 0;
}

static size_t convolution_length(size_t n) {
  size_t m = 1;
  while (m < 2 * n - 1) m *= 2;
  return m;
}

static void fill_roots(pb_fft *fft) {
  for (size_t k = 0; k < fft->n; k++) {
    double angle = -2 * M_PI * (double)k / (double)fft->n;
    fft->root[k] = CMPLX(cos(angle), sin(angle));
  }
}

static void fill_bluestein(pb_fft *fft) {
  size_t n = fft->n, m = fft->inner->n;
  for (size_t k = 0; k < n; k++) {
    // k² mod 2n keeps the angle small, hence exact to the last bit.
    double angle = -M_PI * (double)(k * k % (2 * n)) / (double)n;
    fft->chirp[k] = CMPLX(cos(angle), sin(angle));
  }
  for (size_t k = 0; k < m; k++) fft->product[k] = 0;
  for (size_t k = 0; k < n; k++) {
    fft->product[k] = conj(fft->chirp[k]);
    if (k > 0) fft->product[m - k] = conj(fft->chirp[k]);
  }
  pb_fft_forward(fft->inner, fft->product, fft->kernel);
  for (size_t k = 0; k < m; k++) fft->kernel[k] /= (double)m;
}

static pb_status init_bluestein(pb_fft *fft, pb_error *err) {
  size_t m = convolution_length(fft->n);
  fft->inner = calloc(1, sizeof *fft->inner);
  fft->chirp = malloc(fft->n * sizeof *fft->chirp);
  fft->kernel = malloc(m * sizeof *fft->kernel);
  fft->product = malloc(m * sizeof *fft->product);
  fft->work = malloc(m * sizeof *fft->work);
  if (!fft->inner || !fft->chirp || !fft->kernel || !fft->product || !fft->work) {
    return pb_fail_memory(err, "fft");
  }
  pb_status status = pb_fft_init(m, fft->inner, err);
  if (status == PB_OK) fill_bluestein(fft);
  return status;
}

static pb_status init_stockham(pb_fft *fft, pb_error *err) {
  fft->root = malloc(fft->n * sizeof *fft->root);
  fft->work = malloc(fft->n * sizeof *fft->work);
  if (!fft->root || !fft->work) return pb_fail_memory(err, "fft");
  fill_roots(fft);
  return PB_OK;
}

pb_status pb_fft_init(size_t n, pb_fft *fft, pb_error *err) {
  *fft = (pb_fft){.n = n};
  if (n < 1 || n > PB_FFT_MAX_LENGTH) {
    fft->n = 0;
    return pb_fail(err, PB_ERR_ARGUMENT, "fft", "length %zu is not within 1 … %zu", n,
                   PB_FFT_MAX_LENGTH);
  }
  fft->factors = factorise(n, fft->factor);
  bool direct = n == 1 || fft->factors > 0;
  pb_status status = direct ? init_stockham(fft, err) : init_bluestein(fft, err);
  if (status != PB_OK) pb_fft_clear(fft);
  return status;
}

void pb_fft_clear(pb_fft *fft) {
  if (!fft) return;
  if (fft->inner) pb_fft_clear(fft->inner);
  free(fft->inner);
  free(fft->root);
  free(fft->work);
  free(fft->chirp);
  free(fft->kernel);
  free(fft->product);
  *fft = (pb_fft){0};
}

static inline void butterfly_4(const double complex *t, double complex *y) {
  double complex a = t[0] + t[2], b = t[0] - t[2], c = t[1] + t[3], d = t[1] - t[3];
  double complex minus_i_d = CMPLX(cimag(d), -creal(d));
  y[0] = a + c;
  y[1] = b + minus_i_d;
  y[2] = a - c;
  y[3] = b - minus_i_d;
}

// y[j] = Σ_r t[r] e^{−2πi rj/p}, the roots taken every `stride` from the table of all roots.
static inline void butterfly_any(const pb_fft *fft, size_t p, const double complex *t,
                                 double complex *y) {
  size_t stride = fft->n / p;
  for (size_t j = 0; j < p; j++) {
    double complex sum = t[0];
    for (size_t r = 1; r < p; r++) sum += pb_product(t[r], fft->root[(r * j % p) * stride]);
    y[j] = sum;
  }
}

// One decimation-in-frequency pass: s sequences of length m·p become s·p sequences of length m.
static void pass(const pb_fft *fft, size_t p, size_t m, size_t s, const double complex *x,
                 double complex *y) {
  double complex t[MAX_RADIX], z[MAX_RADIX];
  for (size_t q = 0; q < m; q++) {
    for (size_t k = 0; k < s; k++) {
      for (size_t r = 0; r < p; r++) t[r] = x[k + s * (q + m * r)];
      if (p == 4) {
        butterfly_4(t, z);
      } else if (p == 2) {
        z[0] = t[0] + t[1];
        z[1] = t[0] - t[1];
      } else {
        butterfly_any(fft, p, t, z);
      }
      y[k + s * p * q] = z[0];
      for (size_t j = 1; j < p; j++) {
        y[k + s * (p * q + j)] = pb_product(z[j], fft->root[s * q * j]);
      }
    }
  }
}

static void stockham(pb_fft *fft, const double complex *in, double complex *out) {
  if (out != in) memcpy(out, in, fft->n * sizeof *out);
  double complex *x = out, *y = fft->work;
  size_t m = fft->n, s = 1;
  for (size_t i = 0; i < fft->factors; i++) {
    size_t p = fft->factor[i];
    m /= p;
    pass(fft, p, m, s, x, y);
    s *= p;
    double complex *swap = x;
    x = y;
    y = swap;
  }
  if (x != out) memcpy(out, x, fft->n * sizeof *out);
}

static void bluestein(pb_fft *fft, const double complex *in, double complex *out) {
  size_t n = fft->n, m = fft->inner->n;
  double complex *a = fft->work;
  for (size_t k = 0; k < n; k++) a[k] = pb_product(in[k], fft->chirp[k]);
  for (size_t k = n; k < m; k++) a[k] = 0;
  pb_fft_forward(fft->inner, a, a);
  // Inverse through the forward transform of the conjugate; the kernel carries the factor 1/m.
  for (size_t k = 0; k < m; k++) fft->product[k] = conj(pb_product(a[k], fft->kernel[k]));
  pb_fft_forward(fft->inner, fft->product, fft->product);
  for (size_t k = 0; k < n; k++) out[k] = pb_product(conj(fft->product[k]), fft->chirp[k]);
}

void pb_fft_forward(pb_fft *fft, const double complex *in, double complex *out) {
  if (fft->inner) {
    bluestein(fft, in, out);
  } else {
    stockham(fft, in, out);
  }
}

void pb_fft_inverse(pb_fft *fft, const double complex *in, double complex *out) {
  for (size_t k = 0; k < fft->n; k++) out[k] = conj(in[k]);
  pb_fft_forward(fft, out, out);
  for (size_t k = 0; k < fft->n; k++) out[k] = conj(out[k]) / (double)fft->n;
}
