// Percentiles of the bus' histograms of times.
#ifndef PB_CLIENTS_MONITOR_HISTOGRAM_H
#define PB_CLIENTS_MONITOR_HISTOGRAM_H

#include "plantbus.h"

// The time in s below which this fraction (0 to 1) of the counted times lies; inside a bin, whose
// limits are a factor √2 apart, interpolated on a logarithmic scale, and never above the largest.
// NAN when nothing was counted. [any]
double pb_histogram_percentile(const plantbus_Histogram *histogram, double fraction);

#endif
