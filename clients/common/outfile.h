// Result files that appear whole or not at all: written beside their target, then renamed.
//
//   pb_outfile_open(path, &file, err)  →  fprintf(file.stream, …)  →  pb_outfile_close(&file, err)
//
// or, where another library writes the file, pb_outfile_create, then pb_outfile_commit. A path that
// names something else than a regular file (/dev/stdout, a pipe) is written directly.
#ifndef PB_CLIENTS_OUTFILE_H
#define PB_CLIENTS_OUTFILE_H

#include <stdbool.h>
#include <stdio.h>

#include "base/status.h"

typedef struct pb_outfile {
  char *path;  // the target
  char *temp;  // what is written to; equal text to path when written directly
  bool direct;
  FILE *stream;  // of pb_outfile_open; NULL: none
} pb_outfile;

// Creates the temporary file next to path. Fails with PB_ERR_IO (path, reason), PB_ERR_MEMORY.
pb_status pb_outfile_create(const char *path, pb_outfile *out, pb_error *err);

// The same with a stream to write to.
pb_status pb_outfile_open(const char *path, pb_outfile *out, pb_error *err);

// Closes the stream and gives the file its name. Fails with PB_ERR_IO when anything could not be
// written; nothing is left behind then. *out is emptied either way.
pb_status pb_outfile_close(pb_outfile *out, pb_error *err);

// Whether path can be created, before long work whose result it is to hold; NULL is a path that
// nobody asked for. Leaves nothing behind. Fails like pb_outfile_create.
pb_status pb_outfile_probe(const char *path, pb_error *err);

// Gives the file its name. Call with all streams on it closed. Fails with PB_ERR_IO; the temporary
// file is then gone. *out is emptied either way.
pb_status pb_outfile_commit(pb_outfile *out, pb_error *err);

// Closes the stream, removes the temporary file; harmless on an empty *out.
void pb_outfile_discard(pb_outfile *out);

#endif
