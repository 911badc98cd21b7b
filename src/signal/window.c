// Cosine-sum windows and detrending: see window.h.
#include "signal/window.h"

#include <math.h>
#include <string.h>

typedef struct cosine_sum {
  const char *name;
  double a[5];  // w = Σ_j a_j cos(2π j k/n)
} cosine_sum;

static const cosine_sum windows[] = {
    [PB_WINDOW_RECTANGULAR] = {"rectangular", {1}},
    [PB_WINDOW_HANN] = {"hann", {0.5, -0.5}},
    [PB_WINDOW_HAMMING] = {"hamming", {0.54, -0.46}},
    [PB_WINDOW_BLACKMAN] = {"blackman", {0.42, -0.5, 0.08}},
    [PB_WINDOW_FLAT_TOP] = {"flattop",
                            {0.21557895, -0.41663158, 0.277263158, -0.083578947, 0.006947368}},
};

void pb_window_fill(pb_window window, size_t n, double *w) {
  const double *a = windows[window].a;
  for (size_t k = 0; k < n; k++) {
    double angle = 2 * M_PI * (double)k / (double)n;
    w[k] = 0;
    for (int j = 0; j < 5; j++) w[k] += a[j] * cos(j * angle);
  }
}

bool pb_window_parse(const char *name, pb_window *window) {
  for (size_t i = 0; i < sizeof windows / sizeof *windows; i++) {
    if (strcmp(name, windows[i].name) == 0) {
      *window = (pb_window)i;
      return true;
    }
  }
  return false;
}

void pb_detrend_apply(pb_detrend detrend, double *x, size_t n) {
  if (detrend == PB_DETREND_NONE || n == 0) return;
  double mean = 0, slope = 0, moment = 0, middle = 0.5 * (double)(n - 1);
  for (size_t k = 0; k < n; k++) mean += x[k];
  mean /= (double)n;
  if (detrend == PB_DETREND_LINEAR) {
    for (size_t k = 0; k < n; k++) {
      double t = (double)k - middle;
      slope += t * x[k];
      moment += t * t;
    }
    slope = moment > 0 ? slope / moment : 0;
  }
  for (size_t k = 0; k < n; k++) x[k] -= mean + slope * ((double)k - middle);
}
