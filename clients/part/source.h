// What import, doctor and truncate read: an element's own file, or other programs' files, with the
// options that say what those cannot.
#ifndef PB_CLIENTS_PART_SOURCE_H
#define PB_CLIENTS_PART_SOURCE_H

#include <argp.h>

#include "part/import.h"

typedef struct source {
  size_t files;
  const char *file[3];
  const char *nodes, *masters, *units;
  int64_t *frame;
  size_t frames;
  int64_t modal;
  bool half;
  double length, force, time;
} source;

// As an argp child with a source* as its input; takes the positional arguments, too.
extern const struct argp source_argp;

// Two different frames "A,B", from 1 on the command line, from 0 here; anything else is a usage
// error.
void source_frame_pair(const char *flag, const char *arg, size_t *a, size_t *b,
                       struct argp_state *state);

void source_begin(source *s);
void source_clear(source *s);

typedef struct loaded {
  pb_import import;  // of an element's own file only `element` is filled
  bool own;          // a MAT file with K, M and int_xyz
} loaded;

// Reads what the command line names, as it is. Fails like pb_import_read and pb_element_data_load.
pb_status source_load(const source *s, loaded *out, pb_error *err);
void source_unload(loaded *l);

// The lines "beam.txt: Ansys *PRINT, …" of provenance, base names only; owned by the caller, NULL:
// out of memory.
char *source_provenance(const source *s, const loaded *l);

#endif
