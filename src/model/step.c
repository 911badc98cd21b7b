// Stepping a compiled plant: see model.h. Nothing here allocates, locks or fails.
#include <stdlib.h>
#include <string.h>

#include "model/model.h"
#include "model/step_internal.h"
#include "model/step_kernel.h"

static bool has_electronics(const pb_model *m) {
  return m->input_electronics || m->output_electronics;
}

size_t pb_state_plain(const pb_model *m) {
  return m->nx + m->nu + (m->pairs < m->blocks ? m->widest : 0);
}

size_t pb_state_bytes(const pb_model *m) {
  size_t electronics = has_electronics(m) ? pb_electronics_size(m) : 0;
  return sizeof(pb_state) + (pb_state_plain(m) + electronics) * sizeof(double);
}

pb_state *pb_state_new(const pb_model *m) {
  pb_state *s = calloc(1, pb_state_bytes(m));
  if (s) pb_state_reset(m, s);
  return s;
}

void pb_state_reset(const pb_model *m, pb_state *s) {
  memset(s, 0, pb_state_bytes(m));
  s->nx = m->nx;
  s->nu = m->nu;
  if (has_electronics(m)) pb_electronics_reset(m, s);
}

void pb_step_motion(const pb_model *m, const pb_state *s, double *y) {
  if (m->step) {
    m->step->kernel->output(m->step, s->data, y);
    return;
  }
  const double *x = s->data, *u = s->data + m->nx;
  size_t ny = m->ny;
  for (size_t o = 0; o < ny; o++) y[o] = 0;
  for (size_t j = 0; j < m->nx; j++) {
    const double *c = m->c + j * ny;
    for (size_t o = 0; o < ny; o++) y[o] += c[o] * x[j];
  }
  for (size_t i = 0; i < m->nu; i++) {
    const double *d = m->d + i * ny;
    for (size_t o = 0; o < ny; o++) y[o] += d[o] * u[i];
  }
}

double pb_step_motion_of(const pb_model *m, const pb_state *s, size_t o) {
  const double *x = s->data, *u = s->data + m->nx;
  double y = 0;
  for (size_t j = 0; j < m->nx; j++) y += m->c[o + j * m->ny] * x[j];
  for (size_t i = 0; i < m->nu; i++) y += m->d[o + i * m->ny] * u[i];
  return y;
}

void pb_step_output(const pb_model *m, const pb_state *s, double *y) {
  if (m->output_electronics)
    memcpy(y, pb_electronics_measured(m, s), m->ny * sizeof *y);
  else
    pb_step_motion(m, s, y);
}

// x ← A_d x over the 2 × 2 blocks.
static void advance_pairs(const double *ad, double *x, size_t pairs) {
  for (size_t k = 0; k < pairs; k++, ad += 4, x += 2) {
    double x0 = x[0], x1 = x[1];
    x[0] = ad[0] * x0 + ad[2] * x1;
    x[1] = ad[1] * x0 + ad[3] * x1;
  }
}

// x ← A_d x for a block of another size.
static void advance_block(const double *ad, size_t n, double *x, double *scratch) {
  memcpy(scratch, x, n * sizeof *x);
  for (size_t i = 0; i < n; i++) x[i] = 0;
  for (size_t j = 0; j < n; j++)
    for (size_t i = 0; i < n; i++) x[i] += ad[i + j * n] * scratch[j];
}

// x[from …] += B_d u.
static void add_inputs(const pb_model *m, const double *u, size_t from, double *x) {
  for (size_t i = 0; i < m->nu; i++) {
    const double *b = m->bd + i * m->nx;
    for (size_t j = from; j < m->nx; j++) x[j] += b[j] * u[i];
  }
}

static void advance(const pb_model *m, double *x, const double *u, double *scratch) {
  const size_t paired = 2 * m->pairs;
  if (m->step)
    m->step->kernel->advance(m->step, x, u);
  else
    advance_pairs(m->ad, x, m->pairs);
  for (size_t k = m->pairs; k < m->blocks; k++) {
    size_t start = m->block_start[k];
    advance_block(m->ad + m->block_value[k], m->block_start[k + 1] - start, x + start, scratch);
  }
  add_inputs(m, u, m->step ? paired : 0, x);
}

void pb_step_state(const pb_model *m, double *x, const double *u, double *scratch) {
  advance(m, x, u, scratch);
}

void pb_step_advance(const pb_model *m, pb_state *s, const double *command) {
  double *x = s->data, *held = s->data + m->nx;
  const double *u = command;
  if (m->input_electronics) {
    pb_electronics_apply(m, s, command);
    u = held;
  }
  advance(m, x, u, held + m->nu);
  for (size_t i = 0; i < m->nu; i++) held[i] = u[i];
  s->step++;
  if (m->output_electronics) pb_electronics_sample(m, s);
}
