// Items of a host: their definitions, and how these are read (internal to host*.c).
#ifndef PB_HOST_ITEM_H
#define PB_HOST_ITEM_H

#include <stdatomic.h>

#include "control/lti.h"
#include "host.h"
#include "stepper.h"

typedef enum pb_host_kind {
  PB_HOST_IFF,
  PB_HOST_LTI,
  PB_HOST_WHITE,
  PB_HOST_NOISE,
  PB_HOST_MULTISINE,
  PB_HOST_CHIRP,
  PB_HOST_SINE,
  PB_HOST_STEP,
  PB_HOST_TABLE,
} pb_host_kind;

// What an item is: never changes once it is read, shared by the sets that hold it.
typedef struct pb_host_def {
  atomic_uint holders;
  pb_host_kind kind;
  pb_host_item_info info;  // its texts belong to the definition
  char *text;              // {"kind", "client_name", "body"}
  size_t inputs, outputs;  // driven and read
  char **name;             // [inputs + outputs]

  // Controllers: parts side by side, each from its own outputs to its own inputs.
  size_t parts;
  pb_lti *part;  // [parts] discrete

  // Tables; columns is 1 (the same on each input) or inputs.
  size_t rows, columns;
  double *table;  // [rows][columns]
  bool repeat;

  double amplitude;         // sine and step; the rms of white
  double cycles[2], phase;  // sine: frequency × period as a sum of two doubles; rad
  uint64_t start;           // step: the first with the amplitude
  uint64_t seed;            // white
} pb_host_def;

// An item of a set: its definition, bound to the signals of a model.
typedef struct pb_host_item {
  pb_host_def *def;
  uint32_t input[PB_STEPPER_INPUTS], output[PB_STEPPER_OUTPUTS];
  size_t offset, bytes;  // its state in the set's memory
  atomic_bool done;
} pb_host_item;

// Reads a request into a definition with one holder and binds it. Fails as pb_host_add.
pb_status pb_host_def_read(const cJSON *body, const char *request, const pb_model *model,
                           const char *client_name, pb_host_item *out, pb_error *err);
void pb_host_def_release(pb_host_def *def);

// Octets of an item's state, a multiple of 8.
size_t pb_host_def_bytes(const pb_host_def *def);

// What reads the keys of one type.
typedef struct pb_host_reader {
  const cJSON *body;
  double sample_rate;
  pb_host_def *def;
} pb_host_reader;

pb_status pb_host_read_iff(const pb_host_reader *r, pb_error *err);
pb_status pb_host_read_lti(const pb_host_reader *r, pb_error *err);
pb_status pb_host_read_white(const pb_host_reader *r, pb_error *err);
pb_status pb_host_read_noise(const pb_host_reader *r, pb_error *err);
pb_status pb_host_read_multisine(const pb_host_reader *r, pb_error *err);
pb_status pb_host_read_chirp(const pb_host_reader *r, pb_error *err);
pb_status pb_host_read_sine(const pb_host_reader *r, pb_error *err);
pb_status pb_host_read_step(const pb_host_reader *r, pb_error *err);
pb_status pb_host_read_table(const pb_host_reader *r, pb_error *err);

// A finite number into *out, which keeps its value when the key is absent unless that is required.
pb_status pb_host_read_number(const cJSON *body, const char *key, bool required, double *out,
                              pb_error *err);
pb_status pb_host_read_positive(const cJSON *body, const char *key, bool required, double *out,
                                pb_error *err);

// Row `index` of the array under key: `columns` finite numbers into out with a stride.
pb_status pb_host_read_row(const cJSON *row, const char *key, size_t index, size_t columns,
                           double *out, size_t stride, pb_error *err);

#endif
