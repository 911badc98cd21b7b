// Reading excitations. See host_item.h.
#include <math.h>
#include <stdlib.h>

#include "host_item.h"
#include "request_body.h"
#include "signal/excitation.h"

// Doubles count whole steps up to here.
static const double most_steps = 9007199254740992.0;

static pb_status seed_read(const pb_host_reader *r, uint64_t *seed, pb_error *err) {
  double value = 1;
  const pb_status status = pb_body_integer(r->body, "seed", false, 0, most_steps, &value, err);
  *seed = (uint64_t)value;
  return status;
}

// The band of a table that ends at half the sample rate at most.
static pb_status band_read(const pb_host_reader *r, double *f1, double *f2, pb_error *err) {
  const double nyquist = r->sample_rate / 2;
  pb_status status = pb_host_read_number(r->body, "f1", true, f1, err);
  if (!status) status = pb_host_read_number(r->body, "f2", true, f2, err);
  if (status) return status;
  if (!(*f1 >= 0 && *f1 < nyquist))
    return pb_fail(err, PB_ERR_SCHEMA, "/f1", "expected from 0 to below %g Hz", nyquist);
  if (!(*f2 > *f1 && *f2 <= nyquist))
    return pb_fail(err, PB_ERR_SCHEMA, "/f2", "expected above f1 and at most %g Hz", nyquist);
  return PB_OK;
}

// rows × columns zeros; PB_ERR_SCHEMA, naming the key, when they are none or too many.
static pb_status table_new(pb_host_def *def, double rows, size_t columns, const char *where,
                           pb_error *err) {
  if (!(rows >= 1 && rows * (double)columns <= PB_HOST_VALUES))
    return pb_fail(err, PB_ERR_SCHEMA, where, "%.0f steps of %zu values, expected 1 to %d values",
                   rows, columns, PB_HOST_VALUES);
  def->rows = (size_t)rows;
  def->columns = columns;
  def->table = calloc(def->rows * columns, sizeof *def->table);
  return def->table ? PB_OK : pb_fail_memory(err, "host");
}

static pb_status duration_read(const pb_host_reader *r, size_t columns, bool repeat,
                               pb_error *err) {
  pb_host_def *def = r->def;
  double seconds = 0;
  def->repeat = repeat;
  pb_status status = pb_host_read_positive(r->body, "seconds", true, &seconds, err);
  if (!status) status = pb_body_bool(r->body, "repeat", &def->repeat, err);
  if (!status)
    status = table_new(def, floor(seconds * r->sample_rate + 0.5), columns, "/seconds", err);
  def->info.period_steps = def->rows;
  return status;
}

// The band and the amplitude are checked by now: what is left to refuse is the number of samples.
static pb_status generated(pb_status status, const pb_error *inner, pb_error *err) {
  if (status == PB_ERR_MEMORY) return pb_fail_memory(err, "host");
  return status ? pb_fail(err, PB_ERR_SCHEMA, "/seconds", "%s", inner->message) : PB_OK;
}

pb_status pb_host_read_white(const pb_host_reader *r, pb_error *err) {
  const pb_status status = pb_host_read_positive(r->body, "rms", true, &r->def->amplitude, err);
  return status ? status : seed_read(r, &r->def->seed, err);
}

pb_status pb_host_read_noise(const pb_host_reader *r, pb_error *err) {
  pb_host_def *def = r->def;
  pb_noise_spec spec = {.sample_rate = r->sample_rate};
  pb_error inner = {0};
  pb_status status = pb_host_read_positive(r->body, "rms", true, &spec.rms, err);
  if (!status) status = band_read(r, &spec.f1, &spec.f2, err);
  if (!status) status = seed_read(r, &spec.seed, err);
  if (!status) status = duration_read(r, def->inputs, false, err);
  if (status) return status;
  spec.periodic = def->repeat;
  status = pb_excite_noise(&spec, def->rows, def->inputs, def->table, &inner);
  return generated(status, &inner, err);
}

pb_status pb_host_read_multisine(const pb_host_reader *r, pb_error *err) {
  pb_host_def *def = r->def;
  pb_multisine_spec spec = {.sample_rate = r->sample_rate, .phases = PB_PHASES_RANDOM};
  pb_error inner = {0};
  pb_status status = pb_host_read_positive(r->body, "rms", true, &spec.rms, err);
  if (!status) status = band_read(r, &spec.f1, &spec.f2, err);
  if (!status) status = seed_read(r, &spec.seed, err);
  if (!status) status = duration_read(r, def->inputs, true, err);
  if (status) return status;
  status = pb_excite_multisine(&spec, def->rows, def->inputs, def->table, &inner);
  return generated(status, &inner, err);
}

pb_status pb_host_read_chirp(const pb_host_reader *r, pb_error *err) {
  pb_host_def *def = r->def;
  const double nyquist = r->sample_rate / 2;
  double amplitude = 0, f1 = 0, f2 = 0;
  pb_error inner = {0};
  pb_status status = pb_host_read_positive(r->body, "amplitude", true, &amplitude, err);
  if (!status) status = pb_host_read_positive(r->body, "f1", true, &f1, err);
  if (!status) status = pb_host_read_positive(r->body, "f2", true, &f2, err);
  if (!status && !(f1 <= nyquist))
    status = pb_fail(err, PB_ERR_SCHEMA, "/f1", "expected at most %g Hz", nyquist);
  if (!status && !(f2 <= nyquist && f2 != f1))
    status = pb_fail(err, PB_ERR_SCHEMA, "/f2", "expected at most %g Hz, and not f1", nyquist);
  if (!status) status = duration_read(r, 1, false, err);
  if (status) return status;
  status = pb_excite_chirp(r->sample_rate, f1, f2, amplitude, def->rows, def->table, &inner);
  return generated(status, &inner, err);
}

// frequency × period as high + low: the remainder of the division is exact.
pb_status pb_host_read_sine(const pb_host_reader *r, pb_error *err) {
  pb_host_def *def = r->def;
  double f = 0;
  pb_status status = pb_host_read_number(r->body, "amplitude", true, &def->amplitude, err);
  if (!status) status = pb_host_read_positive(r->body, "frequency", true, &f, err);
  if (!status && !(f <= r->sample_rate / 2))
    status =
        pb_fail(err, PB_ERR_SCHEMA, "/frequency", "expected at most %g Hz", r->sample_rate / 2);
  if (!status) status = pb_host_read_number(r->body, "phase", false, &def->phase, err);
  if (status) return status;
  def->cycles[0] = f / r->sample_rate;
  def->cycles[1] = -fma(def->cycles[0], r->sample_rate, -f) / r->sample_rate;
  return PB_OK;
}

pb_status pb_host_read_step(const pb_host_reader *r, pb_error *err) {
  double at = 0;
  pb_status status = pb_host_read_number(r->body, "amplitude", true, &r->def->amplitude, err);
  if (!status) status = pb_host_read_number(r->body, "at", false, &at, err);
  if (status) return status;
  const double start = floor(at * r->sample_rate + 0.5);
  if (!(at >= 0 && start <= most_steps))
    return pb_fail(err, PB_ERR_SCHEMA, "/at", "expected from 0 to %g s",
                   most_steps / r->sample_rate);
  r->def->start = (uint64_t)start;
  return PB_OK;
}

pb_status pb_host_read_table(const pb_host_reader *r, pb_error *err) {
  pb_host_def *def = r->def;
  const cJSON *values = pb_json_member(r->body, "values");
  if (!cJSON_IsArray(values))
    return pb_fail(err, PB_ERR_SCHEMA, "/values", "expected an array of rows");
  pb_status status = pb_body_bool(r->body, "repeat", &def->repeat, err);
  if (!status) status = table_new(def, cJSON_GetArraySize(values), def->inputs, "/values", err);
  if (status) return status;
  size_t k = 0;
  for (const cJSON *row = values->child; row && !status; row = row->next, k++)
    status =
        pb_host_read_row(row, "values", k, def->columns, def->table + k * def->columns, 1, err);
  def->info.period_steps = def->rows;
  return status;
}
