// Compiled models as dense systems: see lti_ops.h.
//
// Signal electronics add a chain of states a delayed signal: of an input the commands, of an output
// what the plant did, the newest first.
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "control/lti_ops.h"

static bool has_direct_term(const pb_model *model) {
  for (size_t k = 0; k < model->ny * model->nu; k++) {
    if (model->d[k] != 0) return true;
  }
  return false;
}

// From applied inputs to what the plant does.
static pb_status plain_model(const pb_model *model, bool sampled, pb_lti *out, pb_error *err) {
  bool hold = sampled && has_direct_term(model);
  size_t nx = model->nx, nu = model->nu, ny = model->ny, n = nx + (hold ? nu : 0);
  pb_status status = pb_lti_new(n, nu, ny, sampled ? 1 / model->sample_rate : 0, out, err);
  if (status != PB_OK) return status;
  const double *a = sampled ? model->ad : model->a, *b = sampled ? model->bd : model->b;
  for (size_t k = 0; k < model->blocks; k++) {
    size_t start = model->block_start[k], size = model->block_start[k + 1] - start;
    const double *block = a + model->block_value[k];
    for (size_t c = 0; c < size; c++) {
      for (size_t r = 0; r < size; r++) out->a[start + r + (start + c) * n] = block[r + c * size];
    }
  }
  for (size_t i = 0; i < nu; i++) {
    for (size_t k = 0; k < nx; k++) out->b[k + i * n] = b[k + i * nx];
    if (hold) out->b[nx + i + i * n] = 1;
  }
  memcpy(out->c, model->c, ny * nx * sizeof *out->c);
  double *direct = hold ? out->c + ny * nx : out->d;
  memcpy(direct, model->d, ny * nu * sizeof *direct);
  return PB_OK;
}

// The electronics of one channel as far as they are linear.
typedef struct chain {
  double gain;
  size_t delay;  // samples
  size_t start;  // first state of the chain, when delay > 0
} chain;

// Adds a row of g (its parts on states and inputs, `stride` apart) to a row of the system in which
// the inputs of g come through their chains.
static void add_row(const pb_lti *g, const chain *input, const double *from_x, const double *from_u,
                    size_t stride, double *to_x, double *to_u, size_t to_stride) {
  for (size_t j = 0; j < g->nx; j++) to_x[j * to_stride] += from_x[j * stride];
  for (size_t i = 0; i < g->nu; i++) {
    double value = input[i].gain * from_u[i * stride];
    if (input[i].delay > 0)
      to_x[(input[i].start + input[i].delay - 1) * to_stride] += value;
    else
      to_u[i * to_stride] += value;
  }
}

static void fill_chained(const pb_lti *g, const chain *input, const chain *output, pb_lti *out) {
  size_t n = out->nx;
  for (size_t r = 0; r < g->nx; r++)
    add_row(g, input, g->a + r, g->b + r, g->nx, out->a + r, out->b + r, n);
  for (size_t i = 0; i < g->nu; i++) {
    for (size_t k = 0; k < input[i].delay; k++) {
      size_t row = input[i].start + k;
      *(k ? &out->a[row + (row - 1) * n] : &out->b[row + i * n]) = 1;
    }
  }
  for (size_t o = 0; o < g->ny; o++) {
    size_t d = output[o].delay, s = output[o].start;
    double *to_x = d ? out->a + s : out->c + o, *to_u = d ? out->b + s : out->d + o;
    add_row(g, input, g->c + o, g->d + o, g->ny, to_x, to_u, d ? n : g->ny);
    for (size_t k = 1; k < d; k++) out->a[s + k + (s + k - 1) * n] = 1;
    if (d) out->c[o + (s + d - 1) * g->ny] = 1;
  }
}

static void fill_chain(const pb_electronics *e, chain *c, size_t *states) {
  *c = (chain){.gain = e->gain, .delay = e->delay, .start = *states};
  *states += c->delay;
}

// Chains of the chosen channels [nu + ny]; returns how many states there are with them.
static size_t list_chains(const pb_model *m, pb_time_base base, const pb_lti_channels *ch,
                          size_t states, chain *list) {
  for (size_t i = 0; i < ch->nu; i++) {
    bool applied = base == PB_APPLIED;
    size_t index = ch->input ? ch->input[i] : i;
    pb_electronics e = applied ? pb_electronics_none() : pb_model_input_electronics(m, index);
    fill_chain(&e, &list[i], &states);
  }
  for (size_t o = 0; o < ch->ny; o++) {
    pb_electronics e = pb_model_output_electronics(m, ch->output ? ch->output[o] : o);
    fill_chain(&e, &list[ch->nu + o], &states);
  }
  return states;
}

static pb_status add_chains(const pb_model *m, pb_time_base base, const pb_lti_channels *ch,
                            pb_lti *g, pb_error *err) {
  pb_lti out = {0};
  chain *list = malloc((g->nu + g->ny + 1) * sizeof *list);
  if (!list) return pb_fail_memory(err, "model");
  size_t states = list_chains(m, base, ch, g->nx, list);
  pb_status status = PB_OK;
  if (base == PB_CONTINUOUS && states > g->nx) {
    status = pb_fail(err, PB_ERR_ARGUMENT, "model",
                     "a signal is delayed by its electronics: there is no continuous state space");
  }
  if (status == PB_OK) status = pb_lti_new(states, g->nu, g->ny, g->dt, &out, err);
  if (status == PB_OK) {
    fill_chained(g, list, list + g->nu, &out);
    pb_lti_free(g);
    *g = out;
  }
  free(list);
  return status;
}

pb_status pb_lti_from_channels(const pb_model *model, pb_time_base base, const pb_lti_channels *ch,
                               pb_lti *out, pb_error *err) {
  pb_lti whole = {0};
  *out = (pb_lti){0};
  pb_status status = plain_model(model, base != PB_CONTINUOUS, &whole, err);
  if (status == PB_OK) {
    status = pb_lti_select(&whole, ch->input, ch->nu, ch->output, ch->ny, out, err);
  }
  pb_lti_free(&whole);
  if (status == PB_OK && (model->input_electronics || model->output_electronics)) {
    status = add_chains(model, base, ch, out, err);
  }
  if (status != PB_OK) pb_lti_free(out);
  return status;
}

pb_status pb_lti_from_model(const pb_model *model, pb_time_base base, pb_lti *out, pb_error *err) {
  pb_status status = plain_model(model, base != PB_CONTINUOUS, out, err);
  const pb_lti_channels all = {.nu = model->nu, .ny = model->ny};
  if (status == PB_OK && (model->input_electronics || model->output_electronics)) {
    status = add_chains(model, base, &all, out, err);
  }
  if (status != PB_OK) pb_lti_free(out);
  return status;
}
