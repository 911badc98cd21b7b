// An element out of other programs' matrices and node lists.
//
// The rows of K and M are told apart by labels (node and direction: NASTRAN, Abaqus, CalculiX), by
// a list of masters (Ansys MLIST: they come first, modes behind them), or by a list of frames (six
// rows each in its order, modes behind). The element has its frames in that order, or in the one
// that is asked for, and its modes last. Values are taken as they are; nothing is made symmetric.
#ifndef PB_PART_IMPORT_H
#define PB_PART_IMPORT_H

#include "part/matrix_file.h"
#include "plant/element.h"

typedef struct pb_import_request {
  const char *k_file, *m_file;  // the same file where it holds both
  const char *node_file;        // NULL: the MAT file's own int_xyz
  const char *master_file;      // NULL: from node_file, where that has such a list
  size_t frames;                // frames to take, in order; 0: all, in the files' order
  const int64_t *frame;         // [frames] their node numbers
  int64_t modal;                // modal coordinates that the matrices must have; −1: not said
  bool half;  // one stored triangle stands for both, though the file does not say so
  double length, force, time;  // units in SI; 1 each: SI
} pb_import_request;

typedef struct pb_import {
  pb_element_data element;
  int64_t *node;        // [frames] numbers of the nodes
  pb_matrix_file k, m;  // what was read: formats, sizes, halves; without entries
  size_t listed;        // nodes in the node list
  const char *rows_by;  // "labels", "the list of masters", "the list of nodes", "--frames"
} pb_import;

// Reads and puts together. Fails with PB_ERR_IO, PB_ERR_SYNTAX (files), PB_ERR_ELEMENT (what does
// not fit: sizes, labels, nodes without coordinates or without six directions, rows that nobody
// explains), PB_ERR_MEMORY. *out is owned by the caller. [init]
pb_status pb_import_read(const pb_import_request *request, pb_import *out, pb_error *err);
void pb_import_clear(pb_import *import);

#endif
