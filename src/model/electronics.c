// Signal electronics of a stepped plant: see electronics.h. Nothing in the step allocates or fails.
//
// Memory at the end of a pb_state, each signal's pieces one after the other:
//
//   inputs, if any has electronics:    line, generator of noise
//   outputs, if any has electronics:   measured [ny], then line, generator, the step's noise
//
// A line is a ring of delay + 1 values and the index of the newest; generator and noise are there
// where the noise is not 0.
#include "model/electronics.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "model/model.h"
#include "model/step_internal.h"
#include "signal/random.h"

// Streams of the generators: apart from those of excitations that may have the same seed.
static const uint64_t first_stream = 0x656c656374726f6eu;

typedef struct line {
  uint64_t newest;
  double value[];  // [delay + 1]
} line;

typedef struct source {
  pb_random random;
  double unit;  // the number drawn last, of variance 1
} source;

enum { SOURCE = sizeof(source) / sizeof(double) };
_Static_assert(sizeof(source) % sizeof(double) == 0, "the state is made of doubles");
_Static_assert(sizeof(uint64_t) == sizeof(double), "the state is made of doubles");

pb_electronics pb_electronics_none(void) {
  return (pb_electronics){.gain = 1};
}

bool pb_electronics_valid(const pb_electronics *e, bool is_input) {
  bool common = isfinite(e->quantisation) && e->quantisation >= 0 && isfinite(e->noise) &&
                e->noise >= 0 && e->delay <= PB_MAX_DELAY && e->seed <= (uint64_t)1 << 53;
  if (!is_input) return common && e->gain == 1 && e->low == 0 && e->high == 0 && e->slew == 0;
  bool range = isfinite(e->low) && isfinite(e->high) && e->low <= 0 && e->high >= 0;
  return common && range && isfinite(e->gain) && e->gain != 0 && isfinite(e->slew) && e->slew >= 0;
}

pb_electronics pb_model_input_electronics(const pb_model *m, size_t input) {
  return m->input_electronics ? m->input_electronics[input] : pb_electronics_none();
}

pb_electronics pb_model_output_electronics(const pb_model *m, size_t output) {
  return m->output_electronics ? m->output_electronics[output] : pb_electronics_none();
}

static size_t longest_delay(const pb_electronics *list, size_t count) {
  size_t longest = 0;
  for (size_t i = 0; list && i < count; i++)
    if (list[i].delay > longest) longest = list[i].delay;
  return longest;
}

size_t pb_model_delay(const pb_model *m) {
  return longest_delay(m->input_electronics, m->nu) + longest_delay(m->output_electronics, m->ny);
}

static pb_electronics *copy_list(const pb_electronics *list, size_t count) {
  pb_electronics *copy = malloc((count + 1) * sizeof *copy);
  if (copy) memcpy(copy, list, count * sizeof *copy);
  return copy;
}

pb_status pb_electronics_attach(pb_model *m, const pb_electronics *input,
                                const pb_electronics *output, pb_error *err) {
  pb_electronics *in = input ? copy_list(input, m->nu) : NULL;
  pb_electronics *out = output ? copy_list(output, m->ny) : NULL;
  if ((input && !in) || (output && !out)) {
    free(in);
    free(out);
    return pb_fail_memory(err, "electronics");
  }
  m->input_electronics = in;
  m->output_electronics = out;
  return PB_OK;
}

// ---- the memory of one signal -------------------------------------------------------------------

static size_t signal_size(const pb_electronics *e) {
  return 1 + (e->delay + 1) + (e->noise > 0 ? SOURCE : 0);
}

static size_t list_size(const pb_electronics *list, size_t count) {
  size_t size = 0;
  for (size_t i = 0; list && i < count; i++) size += signal_size(&list[i]);
  return size;
}

size_t pb_electronics_size(const pb_model *m) {
  size_t measured = m->output_electronics ? m->ny : 0;
  return list_size(m->input_electronics, m->nu) + measured +
         list_size(m->output_electronics, m->ny);
}

static double *inputs_at(const pb_model *m, const pb_state *s) {
  return (double *)s->data + pb_state_plain(m);
}

static double *measured_at(const pb_model *m, const pb_state *s) {
  return inputs_at(m, s) + list_size(m->input_electronics, m->nu);
}

static line *line_at(double *at) {
  return (line *)(void *)at;
}

static source *source_at(const pb_electronics *e, double *at) {
  return e->noise > 0 ? (source *)(void *)(at + 1 + e->delay + 1) : NULL;
}

// Takes in the newest value; returns the one of `delay` samples ago.
static double line_push(line *l, uint32_t delay, double value) {
  l->newest = l->newest < delay ? l->newest + 1 : 0;
  l->value[l->newest] = value;
  return l->value[l->newest < delay ? l->newest + 1 : 0];
}

// The value of `age` ≤ delay samples ago.
static double line_value(const line *l, uint32_t delay, uint32_t age) {
  return l->value[l->newest >= age ? l->newest - age : l->newest + delay + 1 - age];
}

static double source_draw(source *s) {
  if (!s) return 0;
  s->unit = pb_random_gaussian(&s->random);
  return s->unit;
}

static void signal_reset(const pb_electronics *e, uint64_t stream, double *at) {
  source *noise = source_at(e, at);
  memset(at, 0, signal_size(e) * sizeof *at);
  if (noise) pb_random_seed(&noise->random, e->seed, first_stream + stream);
}

static uint64_t stream_of(size_t index, bool is_input) {
  return 2 * (uint64_t)index + !is_input;
}

static double quantised(double value, double step) {
  return step > 0 ? round(value / step) * step : value;
}

// ---- inputs -------------------------------------------------------------------------------------

static double clipped(const pb_electronics *e, double value) {
  if (!(e->low < e->high)) return value;
  return value < e->low ? e->low : value > e->high ? e->high : value;
}

double pb_electronics_steady(const pb_electronics *e, double command) {
  return clipped(e, e->gain * quantised(command, e->quantisation));
}

// One input; *cut tells whether slew or range changed it.
static double apply(const pb_electronics *e, double *at, double command, double last, double period,
                    bool *cut) {
  source *noise = source_at(e, at);
  double wanted = e->gain * line_push(line_at(at), e->delay, quantised(command, e->quantisation));
  if (noise) wanted += e->noise * source_draw(noise);
  double value = wanted;
  if (e->slew > 0) {
    double most = e->slew * period;
    if (value > last + most) value = last + most;
    if (value < last - most) value = last - most;
  }
  value = clipped(e, value);
  *cut = value != wanted && !isnan(wanted);
  return value;
}

void pb_electronics_apply(const pb_model *m, pb_state *s, const double *command) {
  double *at = inputs_at(m, s), *held = s->data + m->nx, period = 1 / m->sample_rate;
  s->saturated = 0;
  for (size_t i = 0; i < m->nu; i++) {
    const pb_electronics *e = &m->input_electronics[i];
    bool cut;
    held[i] = apply(e, at, command[i], held[i], period, &cut);
    if (cut && i < 64) s->saturated |= (uint64_t)1 << i;
    at += signal_size(e);
  }
}

// ---- outputs ------------------------------------------------------------------------------------

static double measured_value(const pb_electronics *e, double delayed, const source *noise) {
  double value = noise ? delayed + e->noise * noise->unit : delayed;
  return quantised(value, e->quantisation);
}

void pb_electronics_sample(const pb_model *m, pb_state *s) {
  double *y = measured_at(m, s), *at = y + m->ny;
  pb_step_motion(m, s, y);
  for (size_t o = 0; o < m->ny; o++) {
    const pb_electronics *e = &m->output_electronics[o];
    source *noise = source_at(e, at);
    double delayed = line_push(line_at(at), e->delay, y[o]);
    source_draw(noise);
    y[o] = measured_value(e, delayed, noise);
    at += signal_size(e);
  }
}

void pb_state_measure(const pb_model *m, pb_state *s) {
  if (!m->output_electronics) return;
  double *y = measured_at(m, s), *at = y + m->ny;
  pb_step_motion(m, s, y);
  for (size_t o = 0; o < m->ny; o++) {
    const pb_electronics *e = &m->output_electronics[o];
    line *l = line_at(at);
    l->value[l->newest] = y[o];
    y[o] = measured_value(e, line_value(l, e->delay, e->delay), source_at(e, at));
    at += signal_size(e);
  }
}

const double *pb_electronics_measured(const pb_model *m, const pb_state *s) {
  return measured_at(m, s);
}

void pb_electronics_reset(const pb_model *m, pb_state *s) {
  double *at = inputs_at(m, s);
  for (size_t i = 0; m->input_electronics && i < m->nu; i++) {
    signal_reset(&m->input_electronics[i], stream_of(i, true), at);
    at += signal_size(&m->input_electronics[i]);
  }
  if (!m->output_electronics) return;
  at = measured_at(m, s) + m->ny;
  for (size_t o = 0; o < m->ny; o++) {
    signal_reset(&m->output_electronics[o], stream_of(o, false), at);
    at += signal_size(&m->output_electronics[o]);
  }
  pb_electronics_sample(m, s);
}

// ---- a change of model --------------------------------------------------------------------------

// Where signal `index` of a list has its memory, `at` being that of the first.
static double *signal_at(const pb_electronics *list, size_t index, double *at) {
  return at + list_size(list, index);
}

// `old` is NULL for a signal without electronics: its only value is `now`.
static void carry_signal(const pb_electronics *from, double *old, double now,
                         const pb_electronics *to, double *at) {
  const source *noise = old ? source_at(from, old) : NULL;
  source *next = source_at(to, at);
  line *l = line_at(at);
  uint32_t longest = old ? from->delay : 0;
  for (uint32_t age = 0; age <= to->delay; age++) {
    uint32_t there = age < longest ? age : longest;
    l->value[to->delay - age] = old ? line_value(line_at(old), longest, there) : now;
  }
  l->newest = to->delay;
  if (noise && next) *next = *noise;
}

static void carry_inputs(const pb_model *from, const pb_state *a, const int *input_from,
                         const pb_model *to, pb_state *b) {
  double *first = inputs_at(from, a), *at = inputs_at(to, b);
  b->saturated = 0;
  for (size_t i = 0; i < to->nu; i++) {
    bool known = input_from[i] >= 0;
    size_t k = known ? (size_t)input_from[i] : 0;
    double held = known ? a->data[from->nx + k] : 0;
    b->data[to->nx + i] = held;
    if (known && k < 64 && i < 64 && a->saturated >> k & 1) b->saturated |= (uint64_t)1 << i;
    if (!to->input_electronics) continue;
    const pb_electronics *e = &to->input_electronics[i], *list = from->input_electronics;
    signal_reset(e, stream_of(i, true), at);
    if (known)
      carry_signal(list ? &list[k] : NULL, list ? signal_at(list, k, first) : NULL, held, e, at);
    at += signal_size(e);
  }
}

static void carry_outputs(const pb_model *from, const pb_state *a, const int *output_from,
                          const pb_model *to, pb_state *b) {
  if (!to->output_electronics) return;
  double *first = measured_at(from, a), *y = measured_at(to, b), *at = y + to->ny;
  if (from->output_electronics) first += from->ny;
  for (size_t o = 0; o < to->ny; o++) {
    bool known = output_from[o] >= 0;
    size_t k = known ? (size_t)output_from[o] : 0;
    const pb_electronics *e = &to->output_electronics[o], *list = from->output_electronics;
    signal_reset(e, stream_of(o, false), at);
    source_draw(source_at(e, at));
    if (known && list)
      carry_signal(&list[k], signal_at(list, k, first), 0, e, at);
    else if (known)
      carry_signal(NULL, NULL, pb_step_motion_of(from, a, k), e, at);
    const line *l = line_at(at);
    y[o] = measured_value(e, line_value(l, e->delay, e->delay), source_at(e, at));
    at += signal_size(e);
  }
}

void pb_electronics_carry(const pb_model *from, const pb_state *a, const int *input_from,
                          const int *output_from, const pb_model *to, pb_state *b) {
  carry_inputs(from, a, input_from, to, b);
  carry_outputs(from, a, output_from, to, b);
}
