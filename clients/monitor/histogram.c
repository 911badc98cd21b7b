// Percentiles of a histogram with bins 16 ns · 2^(i/2) … 16 ns · 2^((i+1)/2): see histogram.h.
#include "histogram.h"

#include <math.h>

double pb_histogram_percentile(const plantbus_Histogram *h, double fraction) {
  double total = 0.0, before = 0.0;
  for (int i = 0; i < plantbus_HISTOGRAM_BINS; i++) total += (double)h->bin[i];
  if (total == 0.0) return NAN;
  const double wanted = fraction * total;
  for (int i = 0; i < plantbus_HISTOGRAM_BINS; i++) {
    const double count = (double)h->bin[i];
    if (count == 0.0) continue;
    if (before + count >= wanted) {
      const double inside = wanted > before ? (wanted - before) / count : 0.0;
      const double value = 16e-9 * exp2(0.5 * (i + inside));
      return h->largest > 0.0 ? fmin(value, h->largest) : value;
    }
    before += count;
  }
  return h->largest;
}
