// What the published model says exactly about the channels of an experiment: modes, zeros, how long
// transients last, and which outputs belong to which actuators.
#ifndef PB_IDENTIFY_ROOTS_H
#define PB_IDENTIFY_ROOTS_H

#include "control/poles.h"
#include "jsonout.h"
#include "model/model.h"

// Oscillatory poles (damping < 1) with f1 ≤ |s|/2π ≤ f2, upper half plane, of the sampled model;
// their s is that of the continuous one. *out is the caller's. [init]
pb_status pb_exact_modes(const pb_model *model, double f1, double f2, pb_pole_list *out,
                         pb_error *err);

// A zero of the continuous plant's channel, and the one of the sampled response that belongs to it
// (hz NaN: none; model/sampled_roots.h).
typedef struct pb_exact_zero {
  pb_pole sampled, continuous;
  bool sign_differs;  // of the damping: sampling makes it, not the plant
} pb_exact_zero;

// Zeros with f1 ≤ |s|/2π ≤ f2 of the channel. Zeros that cancel a pole (a mode the channel does not
// see) are left out. *zero [*count] is the caller's. [init]
pb_status pb_exact_zeros(const pb_model *model, size_t output, size_t input, double f1, double f2,
                         pb_exact_zero **zero, size_t *count, pb_error *err);

// Seconds until every pole from f1/4 Hz on has fallen to `level`, at most `longest`. Poles given as
// z.
double pb_settling_time(const pb_pole_list *poles, double sample_rate, double f1, double level,
                        double longest);

// Seconds at the start of an experiment that are not used: until what lies above the band has died
// down where the decay of the band is `removable` afterwards, else until the band has too; and the
// delay of the electronics. [init]
pb_status pb_settle_seconds(const pb_model *model, double f1, double f2, bool removable,
                            double *seconds, pb_error *err);

// All poles of the model, for pb_settling_time. [init]
pb_status pb_all_poles(const pb_model *model, pb_pole_list *out, pb_error *err);

// The force-sensor output that belongs to an actuator's input by name: Va… with Vs…, f… with fm…,
// the rest of the name equal. −1: none. [any]
int pb_sensor_of(const pb_model *model, size_t input);

// Writes {"hz", "damping"} under a key; what is not known is null.
void pb_jsonout_pole(pb_jsonout *j, const char *key, const pb_pole *p);

#endif
