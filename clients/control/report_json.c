// The report of a design as JSON.
#include <math.h>

#include "control_tool.h"
#include "standard_output.h"

static void json_matrix(pb_jsonout *o, const char *key, const double *m, size_t rows, size_t cols) {
  pb_jsonout_array(o, key);
  for (size_t r = 0; r < rows; r++) {
    pb_jsonout_row(o, NULL);
    for (size_t c = 0; c < cols; c++) pb_jsonout_number(o, NULL, m[r + c * rows]);
    pb_jsonout_array_end(o);
  }
  pb_jsonout_array_end(o);
}

static void json_shape(pb_jsonout *o, const control_design *d) {
  const pb_hac_shape *s = &d->shape;
  pb_jsonout_object(o, "hac");
  pb_jsonout_text(o, "frame", d->frame.cartesian ? "cartesian" : "strut");
  pb_jsonout_number(o, "bandwidth_hz", s->bandwidth_hz);
  pb_jsonout_number(o, "lead", s->lead);
  pb_jsonout_number(o, "integrator_hz", s->integrator_hz);
  pb_jsonout_number(o, "low_pass_hz", s->lowpass_hz);
  pb_jsonout_integer(o, "delay", d->hac_delay);
  if (d->frame.cartesian) {
    pb_jsonout_object(o, "jacobian");
    pb_jsonout_text(o, "source", d->frame.source);
    pb_jsonout_number(o, "condition", d->frame.condition);
    pb_jsonout_number(o, "difference", d->frame.difference);
    json_matrix(o, "j", d->frame.j, d->n, d->n);
    pb_jsonout_object_end(o);
  }
  pb_jsonout_object_end(o);
}

static void json_proof(pb_jsonout *o, const control_design *d) {
  pb_jsonout_boolean(o, "stable", d->stable);
  pb_jsonout_integer(o, "closed_loop_states", d->closed_states);
  pb_jsonout_object(o, "worst_pole");
  pb_jsonout_number(o, "modulus", cabs(d->worst.z));
  pb_jsonout_number(o, "hz", d->worst.hz);
  pb_jsonout_number(o, "damping", d->worst.damping);
  pb_jsonout_object_end(o);
  pb_jsonout_number(o, "gain_up", d->gain_up);
  pb_jsonout_number(o, "gain_down", d->gain_down);
}

void control_json_design(pb_jsonout *o, const control_design *d) {
  pb_jsonout_text(o, "plant", d->plant->bench.description->name);
  pb_jsonout_number(o, "sample_rate", d->model->sample_rate);
  pb_jsonout_integer(o, "states", d->model->nx);
  if (d->damped) {
    pb_jsonout_object(o, "iff");
    pb_jsonout_number(o, "gain", d->iff.law.gain);
    pb_jsonout_boolean(o, "best", d->iff.searched);
    pb_jsonout_number(o, "integrator_hz", d->iff.law.integrator_hz);
    pb_jsonout_number(o, "highpass_hz", d->iff.law.highpass_hz);
    pb_jsonout_integer(o, "delay", d->iff_delay);
    pb_jsonout_object_end(o);
  }
  json_shape(o, d);
  json_proof(o, d);
}

static void json_margins(pb_jsonout *o, const pb_margins *m) {
  pb_jsonout_number(o, "crossover_hz", m->crossover_hz);
  pb_jsonout_number(o, "phase_margin_degree", m->phase_degree);
  pb_jsonout_number(o, "phase_margin_hz", m->phase_hz);
  pb_jsonout_number(o, "delay_margin", m->delay);
  pb_jsonout_number(o, "delay_margin_hz", m->delay_hz);
  pb_jsonout_number(o, "gain_up", m->gain_up);
  pb_jsonout_number(o, "gain_up_hz", m->gain_up_hz);
  pb_jsonout_number(o, "gain_down", m->gain_down);
  pb_jsonout_number(o, "gain_down_hz", m->gain_down_hz);
  pb_jsonout_number(o, "modulus", m->modulus);
  pb_jsonout_number(o, "modulus_hz", m->modulus_hz);
}

// Of an unstable loop none: they are null.
static const pb_margins *judged(const control_design *d, const pb_margins *m) {
  static const pb_margins none = {NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN, NAN};
  return d->stable ? m : &none;
}

void control_json_margins(pb_jsonout *o, const control_design *d, const control_judgement *j) {
  pb_jsonout_array(o, "loops");
  for (size_t i = 0; i < d->n; i++) {
    pb_jsonout_object(o, NULL);
    pb_jsonout_text(o, "name", control_loop_name(d, i));
    pb_jsonout_number(o, "gain", d->gain[i]);
    json_margins(o, judged(d, &j->margins[i]));
    pb_jsonout_object_end(o);
  }
  pb_jsonout_array_end(o);
  pb_jsonout_array(o, "loci");
  for (size_t i = 0; i < d->n; i++) {
    pb_jsonout_object(o, NULL);
    json_margins(o, judged(d, &j->mimo.margins[i]));
    pb_jsonout_object_end(o);
  }
  pb_jsonout_array_end(o);
  pb_jsonout_object(o, "sensitivity");
  pb_jsonout_number(o, "peak", d->stable ? j->mimo.s_peak : NAN);
  pb_jsonout_number(o, "peak_hz", d->stable ? j->mimo.s_peak_hz : NAN);
  pb_jsonout_number(o, "below_3db_hz", d->stable ? j->mimo.s_low_hz : NAN);
  pb_jsonout_number(o, "complementary_peak", d->stable ? j->mimo.t_peak : NAN);
  pb_jsonout_number(o, "complementary_peak_hz", d->stable ? j->mimo.t_peak_hz : NAN);
  pb_jsonout_object_end(o);
}

static void json_modes(pb_jsonout *o, const control_design *d) {
  pb_jsonout_object(o, "modes");
  for (int stage = STAGE_UNDAMPED; d->damped && stage <= STAGE_IFF; stage++) {
    pb_jsonout_array(o, control_stage_key[stage]);
    for (size_t k = 0; k < d->iff.modes; k++) {
      const iff_mode *m = &d->iff.mode[k];
      pb_jsonout_pole(o, NULL, stage == STAGE_IFF ? &m->closed_predicted : &m->open_exact);
    }
    pb_jsonout_array_end(o);
  }
  pb_jsonout_array(o, control_stage_key[STAGE_HAC]);
  for (size_t k = 0; k < d->modes.count; k++) pb_jsonout_pole(o, NULL, &d->modes.item[k]);
  pb_jsonout_array_end(o);
  pb_jsonout_object_end(o);
}

static void json_transmission(pb_jsonout *o, const control_design *d, const control_judgement *j) {
  size_t nd = d->disturbances, nm = d->motions;
  pb_jsonout_array(o, "transmission");
  for (size_t p = 0; p < nd && p < nm; p++) {
    pb_jsonout_object(o, NULL);
    pb_jsonout_text(o, "from", d->model->input[d->disturbance[p]].name);
    pb_jsonout_text(o, "to", d->model->output[d->motion[p]].name);
    for (int s = 0; s < STAGES; s++) {
      if (s == STAGE_IFF && !d->damped) continue;
      const double complex *h = j->transmission[s] + p * nd + p;
      double peak = 0;
      for (size_t f = 0; f < j->nf; f++) peak = fmax(peak, cabs(h[f * nm * nd]));
      pb_jsonout_object(o, control_stage_key[s]);
      pb_jsonout_number(o, "low", cabs(*h));
      pb_jsonout_number(o, "peak", peak);
      pb_jsonout_object_end(o);
    }
    pb_jsonout_object_end(o);
  }
  pb_jsonout_array_end(o);
}

pb_status control_print_json(const control_design *d, const control_judgement *j, pb_error *err) {
  pb_jsonout o;
  pb_jsonout_begin(&o, stdout);
  pb_jsonout_object(&o, NULL);
  control_json_design(&o, d);
  control_json_margins(&o, d, j);
  json_modes(&o, d);
  json_transmission(&o, d, j);
  pb_jsonout_object_end(&o);
  pb_jsonout_end(&o);
  return pb_stdout_flush(err);
}
