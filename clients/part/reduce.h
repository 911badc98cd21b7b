// plantbus-part reduce: what its files share.
#ifndef PB_CLIENTS_PART_REDUCE_H
#define PB_CLIENTS_PART_REDUCE_H

#include <stdbool.h>

#include "element_out.h"
#include "part/reduce.h"
#include "plant/element.h"

// Units of the files: the factors that make SI of them.
typedef struct reduce_units {
  const char *name;                // as on the command line
  double length, stiffness, mass;  // m, N/m, kg per unit of the files
} reduce_units;

typedef struct reduce_options {
  const char *stiffness, *mass, *nodes, *dofs;  // files; dofs may be NULL
  const char *frames, *sets;                    // files; may be NULL
  size_t inline_frames;
  const char **inline_frame;  // [inline_frames] NAME={…}
  const char *name;           // of the part; NULL: from the stiffness file
  const reduce_units *units;
  pb_reduce_options reduce;
  const char *out;
  pb_element_format format;
  bool json;
} reduce_options;

// Where one phase began and ended.
typedef struct reduce_usage {
  double seconds;
  double resident, peak;  // bytes at its end: in memory, most so far
} reduce_usage;

typedef struct reduce_run {
  pb_fem fem;
  const char *row_source;  // where the rows' nodes and directions come from
  pb_reduction *element;
  pb_element *free_element;  // its free frequencies, centre of mass
  reduce_usage read, usage[PB_REDUCE_PHASES];
} reduce_run;

// Reads matrices, nodes and frames into run->fem. Fails as the readers do, and with PB_ERR_SCHEMA
// where the files do not fit each other.
pb_status reduce_read(const reduce_options *options, reduce_run *run, pb_error *err);

// Tables or JSON on standard output.
pb_status reduce_report(const reduce_run *run, const reduce_options *options, pb_error *err);

// Present memory of the process (0 where it cannot be told).
void reduce_measure(reduce_usage *usage);

#endif
