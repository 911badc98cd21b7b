// Chosen inputs and outputs: see tool.h.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tool.h"

// Indices of the named signals, of all, or of the first one. A name the plant does not have is a
// mistake on the command line.
static int choose(const char *kind, const pb_name_list *wanted, const pb_signal *signal,
                  size_t count, bool single, size_t *index, size_t *chosen) {
  *chosen = wanted->count ? wanted->count : single && count ? 1 : count;
  for (size_t k = 0; k < *chosen; k++) {
    index[k] = k;
    if (!wanted->count) continue;
    char where[16];
    pb_error err;
    snprintf(where, sizeof where, "--%s", kind);
    if (pb_signal_find(signal, count, kind, wanted->name[k], where, &index[k], &err)) {
      pb_print_error(stderr, &err);
      return PB_EXIT_USAGE;
    }
  }
  return PB_EXIT_DONE;
}

static bool allocate(const tool *t, const pb_model *model, channels *ch) {
  size_t inputs = model->nu + t->inputs.count + 1, outputs = model->ny + t->outputs.count + 1;
  *ch = (channels){0};
  ch->input = calloc(inputs, sizeof *ch->input);
  ch->output = calloc(outputs, sizeof *ch->output);
  ch->input_name = calloc(inputs, sizeof *ch->input_name);
  ch->output_name = calloc(outputs, sizeof *ch->output_name);
  ch->input_unit = calloc(inputs, sizeof *ch->input_unit);
  ch->output_unit = calloc(outputs, sizeof *ch->output_unit);
  return ch->input && ch->output && ch->input_name && ch->output_name && ch->input_unit &&
         ch->output_unit;
}

int channels_choose(const tool *t, const pb_model *model, bool single, channels *out) {
  channels ch;
  int code = PB_EXIT_DONE;
  if (!allocate(t, model, &ch)) {
    pb_error err;
    pb_fail_memory(&err, t->file);
    pb_print_error(stderr, &err);
    code = PB_EXIT_FAILED;
  }
  if (!code) {
    code = choose("input", &t->inputs, model->input, model->nu, single, ch.input, &ch.inputs);
  }
  if (!code) {
    code = choose("output", &t->outputs, model->output, model->ny, single, ch.output, &ch.outputs);
  }
  if (code) {
    channels_free(&ch);
    return code;
  }
  for (size_t k = 0; k < ch.inputs; k++) {
    ch.input_name[k] = model->input[ch.input[k]].name;
    ch.input_unit[k] = model->input[ch.input[k]].unit;
  }
  for (size_t k = 0; k < ch.outputs; k++) {
    ch.output_name[k] = model->output[ch.output[k]].name;
    ch.output_unit[k] = model->output[ch.output[k]].unit;
  }
  *out = ch;
  return PB_EXIT_DONE;
}

void channels_free(channels *ch) {
  free(ch->input);
  free(ch->output);
  free(ch->input_name);
  free(ch->output_name);
  free(ch->input_unit);
  free(ch->output_unit);
  *ch = (channels){0};
}

void channels_unit(const channels *ch, size_t output, size_t input, char *text, size_t size) {
  const char *unit = ch->output_unit[output];
  snprintf(text, size, strchr(unit, '/') ? "(%s)/%s" : "%s/%s", unit, ch->input_unit[input]);
}
