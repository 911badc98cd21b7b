// A compiled model as one array of doubles, for the bus: see model.h.
//
// Layout: magic, sample_rate, max_frequency, dof, nx, nu, ny, blocks, values, whether inputs and
// whether outputs have electronics (0 or 1); mode_hz [dof], mode_damping [dof]; block sizes
// [blocks]; a [values]; b; c; d; then for each input and each output of a list with electronics
// gain, quantisation, noise, low, high, slew, delay, seed. The discretisation follows from it.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "model/build.h"
#include "model/step_kernel.h"

static const double magic = 1886351986;  // "pb" and a layout version
enum { HEADER = 11, SIZES = 8, LARGEST = 100000, ELECTRONICS = 8 };

static void put(double **at, const double *values, size_t count) {
  memcpy(*at, values, count * sizeof **at);
  *at += count;
}

static void put_electronics(double **at, const pb_electronics *list, size_t count) {
  for (size_t i = 0; list && i < count; i++) {
    const pb_electronics *e = &list[i];
    const double values[ELECTRONICS] = {e->gain, e->quantisation,  e->noise,       e->low, e->high,
                                        e->slew, (double)e->delay, (double)e->seed};
    put(at, values, ELECTRONICS);
  }
}

// Of the header's dof, nx, nu, ny, blocks, values, inputs' and outputs' electronics.
static size_t packed_size(const size_t n[SIZES]) {
  size_t nx = n[1], nu = n[2], ny = n[3];
  return HEADER + 2 * n[0] + n[4] + n[5] + nx * nu + ny * nx + ny * nu +
         ELECTRONICS * (n[6] * nu + n[7] * ny);
}

pb_status pb_model_pack(const pb_model *m, double **data, size_t *count, pb_error *err) {
  *data = NULL;
  *count = 0;
  size_t values = m->block_value[m->blocks];
  const size_t n[SIZES] = {m->modes,
                           m->nx,
                           m->nu,
                           m->ny,
                           m->blocks,
                           values,
                           m->input_electronics != NULL,
                           m->output_electronics != NULL};
  size_t size = packed_size(n);
  double *at = malloc(size * sizeof *at);
  if (!at) return pb_fail_memory(err, "model");
  *data = at;
  *count = size;
  const double header[HEADER] = {magic,          m->sample_rate,    m->max_frequency,
                                 (double)m->dof, (double)m->nx,     (double)m->nu,
                                 (double)m->ny,  (double)m->blocks, (double)values,
                                 (double)n[6],   (double)n[7]};
  put(&at, header, HEADER);
  put(&at, m->mode_hz, m->modes);
  put(&at, m->mode_damping, m->modes);
  for (size_t k = 0; k < m->blocks; k++)
    *at++ = (double)(m->block_start[k + 1] - m->block_start[k]);
  put(&at, m->a, values);
  put(&at, m->b, m->nx * m->nu);
  put(&at, m->c, m->ny * m->nx);
  put(&at, m->d, m->ny * m->nu);
  put_electronics(&at, m->input_electronics, m->nu);
  put_electronics(&at, m->output_electronics, m->ny);
  return PB_OK;
}

static bool whole(double x, double low) {
  return x >= low && x <= LARGEST && x == floor(x);
}

// Sizes out of the header, in the order of packed_size; consistent with count.
static bool read_sizes(const double *data, size_t count, size_t size[SIZES]) {
  if (count < HEADER || data[0] != magic) return false;
  if (!(data[1] > 0) || !isfinite(data[1]) || !(data[2] >= 0) || !isfinite(data[2])) return false;
  for (int i = 0; i < 5; i++) {
    if (!whole(data[3 + i], i == 0 || i == 2 || i == 3)) return false;
    size[i] = (size_t)data[3 + i];
  }
  if (!(data[8] >= 0 && data[8] <= 1e10 && data[8] == floor(data[8]))) return false;
  size[5] = (size_t)data[8];
  for (int i = 0; i < 2; i++) {
    if (data[9 + i] != 0 && data[9 + i] != 1) return false;
    size[6 + i] = (size_t)data[9 + i];
  }
  return count == packed_size(size);
}

static bool read_blocks(const double *at, pb_model *m, size_t values) {
  for (size_t k = 0; k < m->blocks; k++) {
    if (!whole(at[k], 1)) return false;
    size_t size = (size_t)at[k];
    m->block_start[k + 1] = m->block_start[k] + size;
    m->block_value[k + 1] = m->block_value[k] + size * size;
    if (m->block_start[k + 1] > m->nx || m->block_value[k + 1] > values) return false;
  }
  return m->block_start[m->blocks] == m->nx && m->block_value[m->blocks] == values;
}

static void take(const double **at, double *out, size_t count) {
  memcpy(out, *at, count * sizeof *out);
  *at += count;
}

// Electronics of `count` signals, the caller's; NULL and a failed status when they are refused.
static pb_status take_electronics(const double **at, size_t count, bool is_input,
                                  pb_electronics **out, pb_error *err) {
  pb_electronics *list = malloc((count + 1) * sizeof *list);
  if (!list) return pb_fail_memory(err, "model");
  for (size_t i = 0; i < count; i++, *at += ELECTRONICS) {
    const double *v = *at;
    bool sound = whole(v[6], 0) && v[7] >= 0 && v[7] <= 0x1p53 && v[7] == floor(v[7]);
    if (sound)
      list[i] = (pb_electronics){.gain = v[0],
                                 .quantisation = v[1],
                                 .noise = v[2],
                                 .low = v[3],
                                 .high = v[4],
                                 .slew = v[5],
                                 .delay = (uint32_t)v[6],
                                 .seed = (uint64_t)v[7]};
    if (sound && pb_electronics_valid(&list[i], is_input)) continue;
    free(list);
    return pb_fail(err, PB_ERR_SYNTAX, "model", "electronics of %s %zu are out of range",
                   is_input ? "input" : "output", i);
  }
  *out = list;
  return PB_OK;
}

static pb_status fill(const double *data, pb_model *m, size_t values, pb_error *err) {
  const double *at = data + HEADER;
  pb_status st = PB_OK;
  m->sample_rate = data[1];
  m->max_frequency = data[2];
  take(&at, m->mode_hz, m->modes);
  take(&at, m->mode_damping, m->modes);
  if (!read_blocks(at, m, values))
    return pb_fail(err, PB_ERR_SYNTAX, "model", "the block sizes do not add up");
  at += m->blocks;
  take(&at, m->a, values);
  take(&at, m->b, m->nx * m->nu);
  take(&at, m->c, m->ny * m->nx);
  take(&at, m->d, m->ny * m->nu);
  if (data[9] != 0) st = take_electronics(&at, m->nu, true, &m->input_electronics, err);
  if (!st && data[10] != 0) st = take_electronics(&at, m->ny, false, &m->output_electronics, err);
  if (!st) st = pb_model_discretize(m, err);
  return st ? st : pb_step_pack_model(m, err);
}

static bool name_signals(pb_signal *signal, size_t count, const char *const *name,
                         const char *const *unit) {
  for (size_t i = 0; i < count; i++) {
    signal[i].name = pb_text_copy(name[i]);
    signal[i].unit = pb_text_copy(unit[i]);
    if (!signal[i].name || !signal[i].unit) return false;
  }
  return true;
}

pb_status pb_model_unpack(const double *data, size_t count, const char *name,
                          const char *const *input_name, const char *const *input_unit,
                          const char *const *output_name, const char *const *output_unit,
                          pb_model **out, pb_error *err) {
  size_t n[SIZES];
  *out = NULL;
  if (!read_sizes(data, count, n))
    return pb_fail(err, PB_ERR_SYNTAX, "model", "%zu numbers that are no packed model", count);
  for (size_t i = 0; i < count; i++)
    if (!isfinite(data[i]))
      return pb_fail(err, PB_ERR_SYNTAX, "model", "entry %zu is not finite", i);
  pb_model *m = pb_model_allocate(n[1], n[2], n[3], n[0], n[4], n[5]);
  pb_status st = PB_OK;
  if (!m) return pb_fail_memory(err, "model");
  m->name = pb_text_copy(name);
  if (!m->name || !name_signals(m->input, m->nu, input_name, input_unit) ||
      !name_signals(m->output, m->ny, output_name, output_unit))
    st = pb_fail_memory(err, "model");
  if (!st) st = fill(data, m, n[5], err);
  if (st) {
    pb_model_free(m);
  } else {
    *out = m;
  }
  return st;
}
