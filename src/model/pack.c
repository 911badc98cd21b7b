// A compiled model as one array of doubles, for the bus: see model.h.
//
// Layout: magic, sample_rate, max_frequency, dof, nx, nu, ny, blocks, values; mode_hz [dof],
// mode_damping [dof]; block sizes [blocks]; a [values]; b; c; d. The discretisation follows from
// it.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "model/build.h"

static const double magic = 1886351985;  // "pb" and a layout version
enum { HEADER = 9, LARGEST = 100000 };

int pb_model_input(const pb_model *m, const char *name) {
  for (size_t i = 0; i < m->nu; i++)
    if (!strcmp(m->input[i].name, name)) return (int)i;
  return -1;
}

int pb_model_output(const pb_model *m, const char *name) {
  for (size_t i = 0; i < m->ny; i++)
    if (!strcmp(m->output[i].name, name)) return (int)i;
  return -1;
}

static void put(double **at, const double *values, size_t count) {
  memcpy(*at, values, count * sizeof **at);
  *at += count;
}

static size_t packed_size(size_t dof, size_t nx, size_t nu, size_t ny, size_t blocks,
                          size_t values) {
  return HEADER + 2 * dof + blocks + values + nx * nu + ny * nx + ny * nu;
}

pb_status pb_model_pack(const pb_model *m, double **data, size_t *count, pb_error *err) {
  *data = NULL;
  *count = 0;
  size_t values = m->block_value[m->blocks];
  size_t size = packed_size(m->modes, m->nx, m->nu, m->ny, m->blocks, values);
  double *at = malloc(size * sizeof *at);
  if (!at) return pb_fail_memory(err, "model");
  *data = at;
  *count = size;
  const double header[HEADER] = {magic,          m->sample_rate,    m->max_frequency,
                                 (double)m->dof, (double)m->nx,     (double)m->nu,
                                 (double)m->ny,  (double)m->blocks, (double)values};
  put(&at, header, HEADER);
  put(&at, m->mode_hz, m->modes);
  put(&at, m->mode_damping, m->modes);
  for (size_t k = 0; k < m->blocks; k++)
    *at++ = (double)(m->block_start[k + 1] - m->block_start[k]);
  put(&at, m->a, values);
  put(&at, m->b, m->nx * m->nu);
  put(&at, m->c, m->ny * m->nx);
  put(&at, m->d, m->ny * m->nu);
  return PB_OK;
}

static bool whole(double x, double low) {
  return x >= low && x <= LARGEST && x == floor(x);
}

// Sizes out of the header: dof, nx, nu, ny, blocks, values; consistent with count.
static bool read_sizes(const double *data, size_t count, size_t size[6]) {
  if (count < HEADER || data[0] != magic) return false;
  if (!(data[1] > 0) || !isfinite(data[1]) || !(data[2] >= 0) || !isfinite(data[2])) return false;
  for (int i = 0; i < 5; i++) {
    if (!whole(data[3 + i], i == 0 || i == 2 || i == 3)) return false;
    size[i] = (size_t)data[3 + i];
  }
  if (!(data[8] >= 0 && data[8] <= 1e10 && data[8] == floor(data[8]))) return false;
  size[5] = (size_t)data[8];
  return count == packed_size(size[0], size[1], size[2], size[3], size[4], size[5]);
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

static pb_status fill(const double *data, pb_model *m, size_t values, pb_error *err) {
  const double *at = data + HEADER;
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
  return pb_model_discretize(m, err);
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
  size_t n[6];
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
