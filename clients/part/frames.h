// Interface frames of a full model from JSON ("plantbus.frames/1"), and back: docs/parts-reduce.md
// describes the keys.
#ifndef PB_CLIENTS_PART_FRAMES_H
#define PB_CLIENTS_PART_FRAMES_H

#include "part/fem.h"

// Adds the frames of a file to fem, whose nodes, rows and M are there already; length: metres in
// the file's unit of length. Fails with PB_ERR_IO, PB_ERR_SYNTAX, PB_ERR_SCHEMA, PB_ERR_REFERENCE
// (an unknown node or set), PB_ERR_ARGUMENT (no node in a selection), PB_ERR_MEMORY; the error
// names file and JSON pointer.
pb_status pb_frames_read(const char *path, double length, pb_fem *fem, pb_error *err);

// Adds one frame given as NAME={…}, an object as in the file. sets: deck that holds node sets, or
// NULL.
pb_status pb_frames_add(const char *text, const char *sets, double length, pb_fem *fem,
                        pb_error *err);

// All frames of fem as such a file, with the moments of averaged ones: reading it gives the same
// frames. Fails with PB_ERR_IO, PB_ERR_MEMORY.
pb_status pb_frames_write(const pb_fem *fem, const char *path, pb_error *err);

#endif
