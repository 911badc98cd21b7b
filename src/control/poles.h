// Poles (and zeros) of sampled systems in the engineer's terms: s = ln(z)·f_s.
#ifndef PB_CONTROL_POLES_H
#define PB_CONTROL_POLES_H

#include <complex.h>
#include <stddef.h>

typedef struct pb_pole {
  double complex z;
  double hz;       // |s| / 2π
  double damping;  // −Re s / |s|; negative: unstable
} pb_pole;

// Zero-initialise; free with pb_pole_list_clear.
typedef struct pb_pole_list {
  size_t count;
  size_t lost;  // starting values of an iteration that led to no pole; 0 from direct methods
  pb_pole *item;
} pb_pole_list;

// [any]
pb_pole pb_pole_from_z(double complex z, double sample_rate);

// s = ln(z)·f_s in rad/s. [any]
double complex pb_pole_s(double complex z, double sample_rate);

// "15.9 Hz with damping -0.3 %"; where that says little (a real pole, or one so far from the circle
// that |s|/2π is beyond half the sample rate): "z = -1.93". [any]
void pb_pole_format(pb_pole pole, double sample_rate, char *text, size_t size);

// The frequency at which it oscillates, |Im s| / 2π; NaN for one that does not (|damping| ≥ 1).
// [any]
double pb_pole_damped_hz(pb_pole pole);

// Ascending frequency. [any]
void pb_pole_sort(pb_pole *pole, size_t count);

void pb_pole_list_clear(pb_pole_list *list);

#endif
