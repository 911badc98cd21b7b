// Reading the "electronics" of signals.
#include <math.h>

#include "plant/loader.h"

static const pb_field input_fields[] = {
    {"gain", offsetof(pb_electronics, gain), PB_ANY, false, 1},
    {"quantisation", offsetof(pb_electronics, quantisation), PB_NON_NEGATIVE, false, 0},
    {"noise", offsetof(pb_electronics, noise), PB_NON_NEGATIVE, false, 0},
    {"slew", offsetof(pb_electronics, slew), PB_POSITIVE, false, 0},
};

static const pb_field output_fields[] = {
    {"quantisation", offsetof(pb_electronics, quantisation), PB_NON_NEGATIVE, false, 0},
    {"noise", offsetof(pb_electronics, noise), PB_NON_NEGATIVE, false, 0},
};

static pb_status read_whole(const pb_reader *r, const char *key, size_t high, size_t *out) {
  char where[256];
  const cJSON *value = pb_reader_find(r, key, where);
  *out = 0;
  return value ? pb_json_index(value, where, 0, high, out, r->err) : PB_OK;
}

static pb_status read_saturation(const pb_reader *r, pb_electronics *out) {
  char where[256];
  double range[2];
  const cJSON *value = pb_reader_find(r, "saturation", where);
  pb_status st = value ? pb_json_numbers(value, where, 2, range, r->err) : PB_OK;
  if (st || !value) return st;
  if (!(range[0] < range[1] && range[0] <= 0 && range[1] >= 0))
    return pb_fail(r->err, PB_ERR_SCHEMA, where,
                   "expected [low, high] with low < high and 0 between them, not [%g, %g]",
                   range[0], range[1]);
  out->low = range[0];
  out->high = range[1];
  return PB_OK;
}

static pb_status check_gain(const pb_reader *r, const pb_electronics *e) {
  char where[256];
  if (e->gain != 0) return PB_OK;
  pb_reader_find(r, "gain", where);
  return pb_fail(r->err, PB_ERR_SCHEMA, where, "an input of gain 0 does nothing");
}

pb_status pb_loader_electronics(const cJSON *object, const char *pointer, bool is_input,
                                pb_electronics *out, pb_error *err) {
  static const char *const of_input[] = {"delay", "seed", "saturation", NULL};
  static const char *const of_output[] = {"delay", "seed", NULL};
  const pb_field *fields = is_input ? input_fields : output_fields;
  size_t count = is_input ? sizeof input_fields / sizeof *input_fields
                          : sizeof output_fields / sizeof *output_fields;
  pb_reader r;
  size_t delay = 0, seed = 0;
  *out = pb_electronics_none();
  pb_status st = pb_reader_open(object, pointer, NULL, &r, err);
  if (!st) st = pb_reader_known(&r, is_input ? of_input : of_output, fields, count);
  if (!st) st = pb_reader_fields(&r, fields, count, out, false);
  if (!st) st = read_whole(&r, "delay", PB_MAX_DELAY, &delay);
  if (!st) st = read_whole(&r, "seed", (size_t)1 << 53, &seed);
  if (!st && is_input) st = read_saturation(&r, out);
  if (!st && is_input) st = check_gain(&r, out);
  out->delay = (uint32_t)delay;
  out->seed = seed;
  return st;
}
