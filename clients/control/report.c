// The report of a design: tables.
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "control_tool.h"
#include "table.h"

static bool shown(const control_design *d, int stage) {
  return stage != STAGE_IFF || d->damped;
}

static void print_shape(const control_design *d) {
  const pb_hac_shape *s = &d->shape;
  printf("HAC, %s frame, %zu loop%s: K = k", d->frame.cartesian ? "Cartesian" : "strut", d->n,
         d->n == 1 ? "" : "s");
  if (s->integrator_hz > 0) printf(" · (s + 2π·%g)/s", s->integrator_hz);
  if (s->lead > 1) {
    double root = sqrt(s->lead);
    printf(" · %.4g (s + 2π·%.4g)/(s + 2π·%.4g)", root, s->bandwidth_hz / root,
           s->bandwidth_hz * root);
  }
  if (s->lowpass_hz > 0) printf(" · 2π·%g/(s + 2π·%g)", s->lowpass_hz, s->lowpass_hz);
  printf(", crossover asked for: %g Hz, delay %u\n", s->bandwidth_hz, d->hac_delay);
}

void control_print_design(const control_design *d) {
  const pb_bench *b = &d->plant->bench;
  printf("%s, %g Hz, %zu states", b->description->name, d->model->sample_rate, d->model->nx);
  if (b->session) {
    printf(", revision %u, %s\n", b->description->revision, b->realtime ? "real time" : "lockstep");
  } else {
    printf("\n");
  }
  if (d->damped) {
    const pb_iff *iff = &d->iff.law;
    printf("IFF, %zu loop%s: K = %.6g/(s + 2π·%g) · s/(s + 2π·%g)%s, delay %u\n", d->n,
           d->n == 1 ? "" : "s", iff->gain, iff->integrator_hz, iff->highpass_hz,
           d->iff.searched ? " (best gain)" : "", d->iff_delay);
  }
  print_shape(d);
  const control_frame *f = &d->frame;
  if (f->cartesian) {
    printf("J from %s, condition number %.4g", f->source, f->condition);
    if (!isnan(f->difference)) printf(", geometry and static gains agree to %.2g", f->difference);
    printf("\n");
  }
}

static void margin_columns(pb_table *t) {
  pb_table_number_column(t, "crossover", "Hz", 5);
  pb_table_number_column(t, "phase margin", "°", 4);
  pb_table_number_column(t, "at", "Hz", 5);
  pb_table_number_column(t, "delay margin", "ms", 4);
  pb_table_number_column(t, "at", "Hz", 5);
  pb_table_number_column(t, "gain up", "×", 4);
  pb_table_number_column(t, "at", "Hz", 5);
  pb_table_number_column(t, "gain down", "×", 4);
  pb_table_number_column(t, "modulus", NULL, 4);
  pb_table_number_column(t, "at", "Hz", 5);
  pb_table_number_column(t, "max |S|", NULL, 4);
}

static void margin_cells(pb_table *t, const pb_margins *m) {
  pb_table_number(t, m->crossover_hz);
  pb_table_number(t, m->phase_degree);
  pb_table_number(t, m->phase_hz);
  pb_table_number(t, 1e3 * m->delay);
  pb_table_number(t, m->delay_hz);
  pb_table_number(t, m->gain_up);
  pb_table_number(t, m->gain_up_hz);
  pb_table_number(t, m->gain_down > 0 ? m->gain_down : NAN);
  pb_table_number(t, m->modulus);
  pb_table_number(t, m->modulus_hz);
  pb_table_number(t, 1 / m->modulus);
}

static pb_status print_loops(const control_design *d, const control_judgement *j, pb_error *err) {
  pb_table t = {0};
  pb_table_text_column(&t, "loop");
  pb_table_number_column(&t, "k", NULL, 5);
  margin_columns(&t);
  for (size_t i = 0; i < d->n; i++) {
    pb_table_text(&t, control_loop_name(d, i));
    pb_table_number(&t, d->gain[i]);
    margin_cells(&t, &j->margins[i]);
  }
  printf("\nEach loop, the others open:\n");
  pb_status status = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  return status;
}

static pb_status print_loci(const control_design *d, const control_judgement *j, pb_error *err) {
  pb_table t = {0};
  pb_table_text_column(&t, "locus");
  margin_columns(&t);
  for (size_t i = 0; i < d->n; i++) {
    char name[32];
    snprintf(name, sizeof name, "λ%zu", i + 1);
    pb_table_text(&t, name);
    margin_cells(&t, &j->mimo.margins[i]);
  }
  printf("\nCharacteristic loci of all loops together:\n");
  pb_status status = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  return status;
}

static void print_mimo(const control_judgement *j) {
  const pb_mimo *m = &j->mimo;
  printf("\nSensitivity at the metrology: largest σ(S) %.4g at %.5g Hz", m->s_peak, m->s_peak_hz);
  if (m->s_low_hz > 0) printf(", below −3 dB up to %.4g Hz", m->s_low_hz);
  printf("; largest σ(T) %.4g at %.5g Hz\n", m->t_peak, m->t_peak_hz);
}

// The delay that all loops stand together, in samples too: a controller that answers so much later
// makes them unstable.
static void print_delay(const control_design *d, const control_judgement *j) {
  const pb_margins *least = d->n == 1 ? &j->margins[0] : &j->mimo.margins[0];
  for (size_t i = 1; i < d->n; i++)
    if (j->mimo.margins[i].delay < least->delay) least = &j->mimo.margins[i];
  if (isinf(least->delay)) return;
  printf("Delay margin, all loops: %.4g ms, %.3g samples, by the crossing at %.5g Hz\n",
         1e3 * least->delay, least->delay * d->model->sample_rate, least->delay_hz);
}

static void print_limits(const control_design *d, const control_judgement *j,
                         const control_limit *limit) {
  for (size_t i = 0; i < d->n; i++) {
    const control_limit *l = &limit[i];
    if (!l->missed) continue;
    fprintf(
        stderr,
        "%s: warning: loop %s crosses at %.4g Hz, not at the %g Hz asked for, where %.3g dB are "
        "missing: the mode at %.5g Hz (damping %.3g %%) takes them, its peak touches 1 at %.5g "
        "Hz. Damp it (IFF gain), or ask for less bandwidth or a lower --lowpass\n",
        program_invocation_short_name, control_loop_name(d, i), j->margins[i].crossover_hz,
        d->shape.bandwidth_hz, l->short_db, l->mode.hz, 100 * l->mode.damping, l->hz);
  }
}

pb_status control_print_margins(const control_design *d, const control_judgement *j,
                                pb_error *err) {
  control_limit *limit;
  if (!d->stable) {
    printf("\nMargins are distances from instability: an unstable loop has none\n");
    return PB_OK;
  }
  pb_status status = control_limits_find(d, j, &limit, err);
  if (status == PB_OK) status = print_loops(d, j, err);
  if (status == PB_OK && d->n > 1) status = print_loci(d, j, err);
  if (status == PB_OK) print_delay(d, j);
  if (status == PB_OK) print_mimo(j);
  if (status == PB_OK) print_limits(d, j, limit);
  free(limit);
  return status;
}

static void print_proof(const control_design *d) {
  char pole[96];
  pb_pole_format(d->worst, d->model->sample_rate, pole, sizeof pole);
  printf("%s: of the sampled closed loop's poles (%zu states) the largest has |z| = %.9f (%s)\n",
         d->stable ? "Stable" : "UNSTABLE", d->closed_states, cabs(d->worst.z), pole);
  if (!d->stable || isnan(d->gain_up)) return;
  printf("By these poles HAC's gain, all loops together, may be multiplied by %.4g … ",
         d->gain_down);
  printf(isinf(d->gain_up) ? "100 and more\n" : "%.4g\n", d->gain_up);
}

static pb_status print_modes(const control_design *d, pb_error *err) {
  pb_table t = {0};
  pb_table_text_column(&t, "mode");
  pb_table_number_column(&t, "frequency", "Hz", 6);
  pb_table_number_column(&t, "damping", "%", 4);
  for (int stage = STAGE_UNDAMPED; d->damped && stage <= STAGE_IFF; stage++) {
    for (size_t k = 0; k < d->iff.modes; k++) {
      const iff_mode *m = &d->iff.mode[k];
      const pb_pole *p = stage == STAGE_IFF ? &m->closed_predicted : &m->open_exact;
      pb_table_text(&t, control_stage_name[stage]);
      pb_table_number(&t, p->hz);
      pb_table_number(&t, 100 * p->damping);
    }
  }
  for (size_t k = 0; k < d->modes.count; k++) {
    pb_table_text(&t, control_stage_name[STAGE_HAC]);
    pb_table_number(&t, d->modes.item[k].hz);
    pb_table_number(&t, 100 * d->modes.item[k].damping);
  }
  printf("\nModes of the band:\n");
  pb_status status = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  return status;
}

// Disturbance k → motion k, or the first of either where they do not pair.
static pb_status print_transmission(const control_design *d, const control_judgement *j,
                                    pb_error *err) {
  size_t pairs = d->motions < d->disturbances ? d->motions : d->disturbances;
  pb_table t = {0};
  pb_table_text_column(&t, "from → to");
  pb_table_text_column(&t, "unit");
  for (int what = 0; what < 2; what++) {
    for (int s = 0; s < STAGES; s++) {
      char head[64];
      snprintf(head, sizeof head, "%s %s", control_stage_name[s], what ? "peak" : "low");
      if (shown(d, s)) pb_table_number_column(&t, head, NULL, 4);
    }
  }
  for (size_t p = 0; p < pairs; p++) {
    char name[200], unit[80];
    snprintf(name, sizeof name, "%s → %s", d->model->input[d->disturbance[p]].name,
             d->model->output[d->motion[p]].name);
    pb_channel_unit(d->model, d->motion[p], d->disturbance[p], unit, sizeof unit);
    pb_table_text(&t, name);
    pb_table_text(&t, unit);
    for (int what = 0; what < 2; what++) {
      for (int s = 0; s < STAGES; s++) {
        const double complex *h = j->transmission[s] + p * d->disturbances + p;
        double value = cabs(*h);
        for (size_t f = 0; what && f < j->nf; f++)
          value = fmax(value, cabs(h[f * d->motions * d->disturbances]));
        if (shown(d, s)) pb_table_number(&t, value);
      }
    }
  }
  printf("\nDisturbance to motion, at %.3g Hz (low) and its largest over all frequencies (peak):\n",
         j->hz[0]);
  pb_status status = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  return status;
}

pb_status control_print(const control_design *d, const control_judgement *j, pb_error *err) {
  control_print_design(d);
  pb_status status = control_print_margins(d, j, err);
  if (status == PB_OK) print_proof(d);
  if (status == PB_OK) status = print_modes(d, err);
  if (status == PB_OK) status = print_transmission(d, j, err);
  return status;
}
