// Matrices, rows, nodes and frames of an outside program into one full model.
//
// What a row of K is, is told by the matrix file itself (CalculiX with its .dof, DMIG, Abaqus) or
// by a list of rows; failing both, K must have three rows for each node of the node list.
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "frames.h"
#include "part/matrix_file.h"
#include "reduce.h"

// A matrix with the labels of its rows, sorted for look-up.
typedef struct labelled {
  const pb_row_label *label;  // [count] by row
  size_t count;
  size_t *order;  // [count] rows by node, then direction
} labelled;

static int compare_labels(const pb_row_label *a, const pb_row_label *b) {
  if (a->node != b->node) return a->node < b->node ? -1 : 1;
  return (a->direction > b->direction) - (a->direction < b->direction);
}

static int by_label(const void *a, const void *b, void *context) {
  const pb_row_label *label = context;
  return compare_labels(label + *(const size_t *)a, label + *(const size_t *)b);
}

static pb_status sort_labels(const char *path, const pb_row_label *label, size_t count,
                             labelled *out, pb_error *err) {
  *out = (labelled){label, count, malloc((count + 1) * sizeof(size_t))};
  if (!out->order) return pb_fail_memory(err, path);
  for (size_t i = 0; i < count; i++) out->order[i] = i;
  qsort_r(out->order, count, sizeof *out->order, by_label, (void *)(uintptr_t)label);
  for (size_t i = 1; i < count; i++) {
    const pb_row_label *a = label + out->order[i - 1], *b = label + out->order[i];
    if (!compare_labels(a, b))
      return pb_fail(err, PB_ERR_SCHEMA, path,
                     "rows %zu and %zu are both direction %d of node %" PRId64,
                     out->order[i - 1] + 1, out->order[i] + 1, b->direction, b->node);
  }
  return PB_OK;
}

// ---- rows of M in those of K --------------------------------------------------------------------

// Where M has the same rows in another order, its entries take K's.
static pb_status match_rows(const char *k_path, const pb_matrix_file *k, const char *m_path,
                            pb_matrix_file *m, pb_error *err) {
  if (k->rows != m->rows)
    return pb_fail(err, PB_ERR_SCHEMA, m_path, "has %zu rows, %s has %zu", m->rows, k_path,
                   k->rows);
  if (!k->label || !m->label) return PB_OK;
  labelled a = {0}, b = {0};
  int64_t *row_of = malloc((k->rows + 1) * sizeof *row_of);
  pb_status st = row_of ? PB_OK : pb_fail_memory(err, m_path);
  if (!st) st = sort_labels(k_path, k->label, k->rows, &a, err);
  if (!st) st = sort_labels(m_path, m->label, m->rows, &b, err);
  for (size_t i = 0; !st && i < k->rows; i++) {
    const pb_row_label *x = k->label + a.order[i], *y = m->label + b.order[i];
    row_of[b.order[i]] = (int64_t)a.order[i];
    if (compare_labels(x, y))
      st = pb_fail(err, PB_ERR_SCHEMA, m_path,
                   "has a row for direction %d of node %" PRId64
                   " where %s has direction %d of node %" PRId64,
                   y->direction, y->node, k_path, x->direction, x->node);
  }
  if (!st) pb_matrix_file_reorder(m, row_of);
  free(a.order);
  free(b.order);
  free(row_of);
  return st;
}

// ---- rows to nodes ------------------------------------------------------------------------------

static pb_status place_rows(const char *path, const pb_row_label *label, size_t rows,
                            const pb_node_file *nodes, const char *node_path, int64_t *dof,
                            pb_error *err) {
  for (size_t i = 0; i < 3 * nodes->count; i++) dof[i] = -1;
  for (size_t r = 0; r < rows; r++) {
    size_t node = pb_node_index(nodes->number, nodes->count, label[r].node);
    if (node == SIZE_MAX)
      return pb_fail(err, PB_ERR_SCHEMA, path,
                     "row %zu belongs to node %" PRId64 ", which %s lacks", r + 1, label[r].node,
                     node_path);
    if (label[r].direction < 1 || label[r].direction > 3)
      return pb_fail(err, PB_ERR_SCHEMA, path,
                     "row %zu is direction %d of node %" PRId64
                     ": only the three translations of solid elements are reduced",
                     r + 1, label[r].direction, label[r].node);
    int64_t *to = dof + 3 * node + label[r].direction - 1;
    if (*to >= 0)
      return pb_fail(err, PB_ERR_SCHEMA, path,
                     "rows %" PRId64 " and %zu are both direction %d of node %" PRId64, *to + 1,
                     r + 1, label[r].direction, label[r].node);
    *to = (int64_t)r;
  }
  return PB_OK;
}

static pb_status find_rows(const reduce_options *o, const pb_matrix_file *k,
                           const pb_node_file *nodes, reduce_run *run, pb_error *err) {
  pb_dof_file list = {0};
  int64_t *dof = malloc((3 * nodes->count + 1) * sizeof *dof);
  pb_status st = dof ? PB_OK : pb_fail_memory(err, o->nodes);
  run->fem.dof = dof;
  if (!st && o->dofs) {
    run->row_source = o->dofs;
    st = pb_dof_file_read(o->dofs, &list, err);
    if (!st && list.count != k->rows)
      st = pb_fail(err, PB_ERR_SCHEMA, o->dofs, "tells of %zu rows, %s has %zu", list.count,
                   o->stiffness, k->rows);
    if (!st) st = place_rows(o->dofs, list.label, k->rows, nodes, o->nodes, dof, err);
  } else if (!st && k->label) {
    run->row_source = "the stiffness file";
    st = place_rows(o->stiffness, k->label, k->rows, nodes, o->nodes, dof, err);
  } else if (!st && k->rows == 3 * nodes->count) {
    run->row_source = "three rows for each node, in the order of their numbers";
    for (size_t i = 0; i < k->rows; i++) dof[i] = (int64_t)i;
  } else if (!st) {
    st = pb_fail(err, PB_ERR_SCHEMA, o->stiffness,
                 "%zu rows do not fit the %zu nodes of %s (three each): give the node and "
                 "direction of each row with --dofs",
                 k->rows, nodes->count, o->nodes);
  }
  pb_dof_file_clear(&list);
  return st;
}

// ---- all of it ----------------------------------------------------------------------------------

static pb_status read_matrices(const reduce_options *o, pb_matrix_file *k, pb_fem *fem,
                               pb_error *err) {
  pb_matrix_file m = {0};
  pb_status st = pb_matrix_file_read(o->stiffness, "K", k, err);
  // Every row has its diagonal: a damaged size is found before memory is taken for it.
  if (!st && k->rows > k->count)
    st = pb_fail(err, PB_ERR_SCHEMA, o->stiffness,
                 "has %zu rows, but %zu entries: there are rows without any stiffness", k->rows,
                 k->count);
  if (!st) st = pb_matrix_file_read(o->mass, "M", &m, err);
  if (!st) st = match_rows(o->stiffness, k, o->mass, &m, err);
  if (!st) st = pb_matrix_file_symmetric(k, o->stiffness, &fem->k, err);
  // The entries are not needed any more; their labels are.
  free(k->row);
  free(k->col);
  free(k->value);
  k->row = k->col = NULL;
  k->value = NULL;
  if (!st) st = pb_matrix_file_symmetric(&m, o->mass, &fem->m, err);
  pb_matrix_file_clear(&m);
  return st;
}

static void convert_units(const reduce_units *units, pb_fem *fem) {
  for (int64_t i = 0; i < fem->k.start[fem->k.n]; i++) fem->k.value[i] *= units->stiffness;
  for (int64_t i = 0; i < fem->m.start[fem->m.n]; i++) fem->m.value[i] *= units->mass;
  for (size_t i = 0; i < 3 * fem->nodes; i++) fem->xyz[i] *= units->length;
}

// The name of the stiffness file without directory and ending.
static char *default_name(const char *path) {
  pb_text text = {0};
  const char *slash = strrchr(path, '/'), *base = slash ? slash + 1 : path;
  const char *dot = strrchr(base, '.');
  pb_text_append_n(&text, base, dot && dot > base ? (size_t)(dot - base) : strlen(base));
  return text.text;
}

static pb_status read_frames(const reduce_options *o, pb_fem *fem, pb_error *err) {
  pb_status st = o->frames ? pb_frames_read(o->frames, o->units->length, fem, err) : PB_OK;
  for (size_t i = 0; !st && i < o->inline_frames; i++)
    st = pb_frames_add(o->inline_frame[i], o->sets, o->units->length, fem, err);
  return st;
}

pb_status reduce_read(const reduce_options *o, reduce_run *run, pb_error *err) {
  pb_matrix_file k = {0};
  pb_node_file nodes = {0};
  pb_fem *fem = &run->fem;
  fem->name = o->name ? pb_text_copy(o->name) : default_name(o->stiffness);
  pb_status st =
      fem->name ? pb_node_file_read(o->nodes, &nodes, err) : pb_fail_memory(err, o->stiffness);
  if (!st) st = read_matrices(o, &k, fem, err);
  if (!st) st = find_rows(o, &k, &nodes, run, err);
  if (!st) {
    fem->nodes = nodes.count;
    fem->number = nodes.number;
    fem->xyz = nodes.xyz;
    nodes = (pb_node_file){0};
    convert_units(o->units, fem);
    st = read_frames(o, fem, err);
  }
  pb_matrix_file_clear(&k);
  pb_node_file_clear(&nodes);
  return st;
}
