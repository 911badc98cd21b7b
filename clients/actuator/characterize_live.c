// plantbus-actuator characterize --live: what an identification of a running bench says of its
// actuator.
//
// Stiffness: one over y/F at 0 Hz; on a bench without a force input M ω² of the first pole, which
// holds where the load M is much heavier than the actuator.
#include <math.h>

#include "characterize.h"

static const double two_pi = 6.283185307179586476925286766559;

pb_status characterize_live(const characterize_options *o, characterize_result *r, pb_error *err) {
  live_result live;
  pb_apa_landmarks l;
  pb_status st = live_identify(&o->subject.live, true, &live, err);
  if (st) return st;
  st = pb_apa_landmarks_of_data(&live.data, &l, err);
  if (!st) {
    const bool force = !isnan(live.compliance);
    r->stiffness = force ? 1 / live.compliance : o->load * pow(two_pi * l.pole_hz, 2);
    snprintf(r->name, sizeof r->name, "%.80s, measured at revision %u", live.plant, live.revision);
    characterize_add(r, "stiffness",
                     force ? "axial stiffness, from y/F at 0 Hz"
                           : "axial stiffness, M ω² of the load",
                     "N/µm", 1e-6, r->stiffness);
    characterize_add(r, "loaded_resonance", "first resonance, loaded", "Hz", 1, l.pole_hz);
    characterize_add(r, "damping", "its damping", "%", 100, l.pole_damping);
    characterize_add(r, "zero", "first zero of V_a → V_s", "Hz", 1, l.zero_hz);
    characterize_add(r, "zero_damping", "its damping", "%", 100, l.zero_damping);
    characterize_add(r, "voltage_gain", "y/V_a at 0 Hz", "µm/V", 1e6, l.gain_y);
    characterize_add(r, "sensor_gain", "V_s/V_a at 0 Hz", "V/V", 1, l.gain_vs);
  }
  live_result_clear(&live);
  return st;
}
