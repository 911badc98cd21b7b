// plantbus-model: what its commands share.
#ifndef PB_CLIENTS_MODEL_TOOL_H
#define PB_CLIENTS_MODEL_TOOL_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "jsonout.h"
#include "model/model.h"
#include "options.h"

typedef enum format {
  FORMAT_NONE,  // no -o
  FORMAT_JSON = 1,
  FORMAT_CSV = 2,
  FORMAT_MAT = 4,
  FORMAT_PNG = 8,
} format;

// The command line. Lists are owned by main.
typedef struct tool {
  const char *file;   // the plant file
  bool json;          // JSON on standard output in place of tables
  const char *out;    // result file, or NULL
  format out_format;  // by its extension
  pb_name_list inputs, outputs;
  double *frequencies;  // Hz [frequency_count]; NULL: from, to, points
  size_t frequency_count;
  double from, to;       // Hz; 0: default
  uint64_t points;       // 0: default
  double max_frequency;  // Hz; 0: none given
  bool linear, sampled, decibel;
  uint64_t steps;  // 0: default
  double *at;      // [at_count] step numbers; NULL: 1 … steps
  size_t at_count;
  double amplitude;
} tool;

// A command: does its work on the loaded model and returns the exit code; errors are printed.
typedef int command_function(const tool *t, const pb_model *model);

int command_info(const tool *t, const pb_model *model);
int command_modes(const tool *t, const pb_model *model);
int command_poles(const tool *t, const pb_model *model);
int command_zeros(const tool *t, const pb_model *model);
int command_frf(const tool *t, const pb_model *model);
int command_step(const tool *t, const pb_model *model);
int command_export(const tool *t, const pb_model *model);

// Loads by itself, to look at what a model no longer holds.
int command_check(const tool *t);

// Prints the error and returns PB_EXIT_FAILED; PB_EXIT_DONE for PB_OK.
int tool_end(pb_status status, const pb_error *err);

// ---- chosen inputs and outputs (channels.c) -----------------------------------------------------

typedef struct channels {
  size_t inputs, outputs;
  size_t *input, *output;                  // indices in the model's lists
  const char **input_name, **output_name;  // [inputs], [outputs]; the model's
  const char **input_unit, **output_unit;
} channels;

// Which of the model's signals --input and --output name; all when none is named, or only the first
// with `single`. Returns PB_EXIT_DONE, or an exit code with the message printed.
int channels_choose(const tool *t, const pb_model *model, bool single, channels *out);
void channels_free(channels *ch);

// "m/V", "(m/s^2)/N"; in text of the given size.
void channels_unit(const channels *ch, size_t output, size_t input, char *text, size_t size);

// ---- signal electronics (electronics.c) ---------------------------------------------------------

enum { PB_ELECTRONICS_SIGNALS = 64 };  // of one list: a plant file has no more

bool electronics_any(const pb_model *model);  // whether any signal has some

// Both print nothing for a model without: a table of the signals whose electronics change
// something; the member "electronics" with the lists "inputs" and "outputs".
pb_status electronics_print(const pb_model *model, pb_error *err);
void electronics_json(pb_jsonout *json, const pb_model *model);

// Hands over each property of all inputs, then of all outputs, under the names of the exports
// ("input_gain", …, "output_delay", …); nothing for a model without.
typedef void electronics_function(void *context, const char *name, const double *value,
                                  size_t count);
void electronics_each(const pb_model *model, electronics_function *take, void *context);

// ---- results (emit.c) ---------------------------------------------------------------------------

// A column of numbers: its JSON key and MATLAB name, heading, unit, digits in a table.
typedef struct column {
  const char *key, *name, *unit;
  int digits;
  const double *value;
} column;

typedef struct columns {
  size_t count, rows;
  const column *column;
  const channels *channels;  // named in JSON and MAT files; or NULL
} columns;

// Writes columns wherever the command line asks: table or JSON on standard output, a file by -o
// (CSV, MAT, JSON; PNG is the caller's). Returns the exit code.
int emit_columns(const tool *t, const columns *data);

// Runs `write` for standard output (--json) and for a JSON file (-o x.json), as asked.
typedef void json_function(pb_jsonout *json, const void *context);
int emit_json(const tool *t, json_function *write, const void *context);

// True when a table is wanted on standard output: no --json and no -o.
bool wants_table(const tool *t);

// Says on standard error that the file of -o was written. Returns status's exit code.
int emit_done(const tool *t, pb_status status, const pb_error *err);

// "inputs" and "outputs" as JSON arrays of names.
void emit_channels_json(pb_jsonout *json, const channels *ch);

#endif
