// Matrices as Abaqus writes them:
//
//   *MATRIX OUTPUT, FORMAT=MATRIX INPUT or LABELS   node, direction, node, direction, value
//   *MATRIX OUTPUT, FORMAT=COORDINATE               row, column, value
//   *SUBSTRUCTURE MATRIX OUTPUT,                    *USER ELEMENT, NODES= n, LINEAR
//     OUTPUT FILE=USER DEFINED (CalculiX, too)      ** ELEMENT NODES
//                                                   ** 101, 102, …
//                                                   directions of the first node
//                                                   place of a node, directions from there on
//                                                   *MATRIX,TYPE=STIFFNESS
//                                                   lower triangle row by row (UNSYMM: all of it,
//                                                   column by column)
//
// A symmetric matrix of the first form is stored by one triangle. Source: Abaqus Analysis User's
// Guide, "Generating matrices", "Defining substructures"; Keywords, *USER ELEMENT, *MATRIX.
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "part/matrix_build.h"

// ---- entries line by line -----------------------------------------------------------------------

static bool scan_place(char **at, pb_row_label *label) {
  int64_t direction;
  bool ok = pb_scan_integer(at, &label->node) && pb_scan_separator(at, ",") &&
            pb_scan_integer(at, &direction) && pb_scan_separator(at, ",");
  if (!ok || direction < 0 || direction > 6) return false;
  label->direction = (int)direction;
  return true;
}

static pb_status read_labelled(pb_lines *in, pb_matrix_build *b) {
  pb_row_label from = {0}, to = {0};
  int64_t row, col;
  double value;
  char *at = in->text;
  if (!scan_place(&at, &from) || !scan_place(&at, &to) || !pb_scan_real(&at, &value) ||
      !pb_scan_done(at))
    return pb_lines_fail(in, "expected node, direction, node, direction, value");
  pb_status st = pb_matrix_build_label(b, from, &row, in->err);
  if (!st) st = pb_matrix_build_label(b, to, &col, in->err);
  if (!st) st = pb_matrix_build_add(b, row, col, value, in->err);
  return st;
}

static pb_status read_place(pb_lines *in, pb_matrix_build *b) {
  int64_t row, col;
  double value;
  char *at = in->text;
  bool ok = pb_scan_integer(&at, &row) && pb_scan_separator(&at, ",") &&
            pb_scan_integer(&at, &col) && pb_scan_separator(&at, ",") && pb_scan_real(&at, &value);
  if (!ok || !pb_scan_done(at)) return pb_lines_fail(in, "expected row, column, value");
  if (row < 1 || col < 1 || row > UINT32_MAX || col > UINT32_MAX)
    return pb_lines_fail(in, "(%jd, %jd) is no place in a matrix", (intmax_t)row, (intmax_t)col);
  int64_t last = row > col ? row : col;
  if ((size_t)last > b->file->rows) b->file->rows = b->file->cols = (size_t)last;
  return pb_matrix_build_add(b, row - 1, col - 1, value, in->err);
}

static size_t count_fields(const char *text) {
  char *at = (char *)text;
  size_t count = 0;
  double value;
  while (pb_scan_real(&at, &value)) {
    count++;
    pb_scan_separator(&at, ",");
  }
  return count;
}

static pb_status read_entries(pb_lines *in, pb_matrix_build *b) {
  bool labelled = false, known = false;
  while (pb_lines_next_filled(in)) {
    if (in->text[0] == '*' && in->text[1] == '*') continue;
    if (!known) labelled = count_fields(in->text) == 5;
    known = true;
    pb_status st = labelled ? read_labelled(in, b) : read_place(in, b);
    if (st) return st;
  }
  pb_status st = in->status;
  if (!st && labelled) st = pb_matrix_build_sort(b, in->err);
  if (!st) st = pb_matrix_build_judge_half(b, in->err);
  return st;
}

// ---- user elements ------------------------------------------------------------------------------

typedef struct user_element {
  size_t nodes, listed;
  int64_t *node;  // [nodes] from the comment lines
  bool unsymmetric;
} user_element;

static bool keyword(const char *text, const char *word) {
  return !strncasecmp(text, word, strlen(word));
}

// NODES= n
static pb_status read_head(pb_lines *in, user_element *e) {
  char *at = strcasestr(in->text, "NODES");
  int64_t nodes = 0;
  if (e->nodes) return pb_lines_fail(in, "a second element: the file must hold one");
  if (at) at += 5 + strspn(at + 5, " \t=");
  if (!at || !pb_scan_integer(&at, &nodes) || nodes < 1 || nodes > 1000000)
    return pb_lines_fail(in, "expected *USER ELEMENT with NODES=");
  e->unsymmetric = strcasestr(in->text, "UNSYMM") != NULL;
  e->nodes = (size_t)nodes;
  e->node = calloc(e->nodes, sizeof *e->node);
  return e->node ? PB_OK : pb_fail_memory(in->err, in->path);
}

static pb_status read_node_numbers(pb_lines *in, user_element *e) {
  char *at = in->text + 2;
  int64_t node;
  while (pb_scan_integer(&at, &node)) {
    if (e->listed == e->nodes || node < 1)
      return pb_lines_fail(in, "more than the %zu nodes of NODES=, or not a node", e->nodes);
    e->node[e->listed++] = node;
    pb_scan_separator(&at, ",");
  }
  return pb_scan_done(at) ? PB_OK : pb_lines_fail(in, "expected node numbers");
}

// Rows for the nodes `from` … `to` − 1 with these directions.
static pb_status add_rows(pb_lines *in, pb_matrix_build *b, const user_element *e, size_t from,
                          size_t to, const int *direction, int directions) {
  for (size_t n = from; n < to; n++) {
    for (int d = 0; d < directions; d++) {
      int64_t row;
      size_t before = b->file->rows;
      pb_row_label label = {e->node[n], direction[d]};
      pb_status st = pb_matrix_build_label(b, label, &row, in->err);
      if (!st && b->file->rows == before)
        st = pb_lines_fail(in, "direction %d of node %jd is there twice", label.direction,
                           (intmax_t)label.node);
      if (st) return st;
    }
  }
  return PB_OK;
}

// Lines "directions" and "place, directions", up to *MATRIX.
static pb_status read_directions(pb_lines *in, pb_matrix_build *b, const user_element *e) {
  size_t from = 0;
  int direction[8], directions = 0;
  if (e->listed != e->nodes)
    return pb_lines_fail(in, "%zu of %zu node numbers are listed", e->listed, e->nodes);
  while (pb_lines_next_filled(in) && in->text[0] != '*') {
    int64_t place = 1, d;
    char *at = in->text;
    bool ok = !directions || (pb_scan_integer(&at, &place) && pb_scan_separator(&at, ","));
    if (!ok || place < 1 || (directions && (size_t)place < from + 2) || (size_t)place > e->nodes)
      return pb_lines_fail(in, "expected the place of a node and its directions");
    pb_status st = PB_OK;
    if (directions) st = add_rows(in, b, e, from, (size_t)place - 1, direction, directions);
    from = (size_t)place - 1;
    for (directions = 0; directions < 8 && pb_scan_integer(&at, &d); directions++) {
      direction[directions] = (int)d;
      if (d < 0 || d > 6) return pb_lines_fail(in, "direction %jd is none of 1 … 6", (intmax_t)d);
      pb_scan_separator(&at, ",");
    }
    if (!directions || !pb_scan_done(at)) return pb_lines_fail(in, "expected directions");
    if (st) return st;
  }
  if (in->status) return in->status;
  if (!directions) return pb_lines_fail(in, "the element's directions are missing");
  pb_lines_back(in);
  return add_rows(in, b, e, from, e->nodes, direction, directions);
}

// Numbers one after another; place k of the lower triangle by rows or of the whole by columns.
static pb_status read_values(pb_lines *in, pb_matrix_build *b, const user_element *e) {
  int64_t n = (int64_t)b->file->rows, row = 0, col = 0;
  while (pb_lines_next_filled(in) && in->text[0] != '*') {
    char *at = in->text;
    double value;
    while (pb_scan_real(&at, &value)) {
      if (row == n || col == n)
        return pb_lines_fail(in, "more numbers than %jd rows need", (intmax_t)n);
      pb_status st = pb_matrix_build_add(b, row, col, value, in->err);
      if (st) return st;
      bool next = e->unsymmetric ? ++row == n : ++col > row;
      if (next && e->unsymmetric) row = 0, col++;
      if (next && !e->unsymmetric) col = 0, row++;
      pb_scan_separator(&at, ",");
    }
    if (!pb_scan_done(at)) return pb_lines_fail(in, "expected a number at '%.20s'", at);
  }
  if (in->status) return in->status;
  bool complete = e->unsymmetric ? col == n : row == n;
  if (!complete)
    return pb_lines_fail(in, "the matrix ends at row %jd, column %jd of %jd", (intmax_t)row + 1,
                         (intmax_t)col + 1, (intmax_t)n);
  if (in->text[0] == '*') pb_lines_back(in);
  return PB_OK;
}

static pb_status read_matrix(pb_lines *in, pb_matrix_build *b, const user_element *e) {
  char type[40] = "";
  const char *at = strcasestr(in->text, "TYPE");
  if (!at || sscanf(at + 4, " = %39[^,]", type) != 1)
    return pb_lines_fail(in, "expected *MATRIX, TYPE=STIFFNESS or MASS");
  if (!b->file->rows) return pb_lines_fail(in, "the element's nodes and directions are missing");
  pb_status st = pb_matrix_build_section(b, in, type);
  return st ? st : read_values(in, b, e);
}

static pb_status read_user_element(pb_lines *in, pb_matrix_build *b, user_element *e) {
  bool numbers = false;
  pb_status st = PB_OK;
  while (!st && pb_lines_next_filled(in)) {
    if (keyword(in->text, "*USER ELEMENT")) {
      st = read_head(in, e);
    } else if (keyword(in->text, "** ELEMENT NODES")) {
      numbers = e->nodes > 0;
    } else if (in->text[0] == '*' && in->text[1] == '*') {
      if (numbers && e->listed < e->nodes) st = read_node_numbers(in, e);
    } else if (keyword(in->text, "*MATRIX")) {
      st = read_matrix(in, b, e);
    } else if (e->nodes && !b->file->rows && in->text[0] != '*') {
      pb_lines_back(in);
      st = read_directions(in, b, e);
    } else {
      st = pb_lines_fail(in, "not a line of a *USER ELEMENT: '%.30s'", in->text);
    }
  }
  return st ? st : in->status;
}

// Whether the first line that is no comment is a keyword; that line comes again.
static bool starts_with_keyword(pb_lines *in) {
  while (pb_lines_next_filled(in)) {
    if (in->text[0] == '*' && in->text[1] == '*') continue;
    pb_lines_back(in);
    return in->text[0] == '*';
  }
  return false;
}

pb_status pb_read_abaqus(pb_lines *in, const char *name, pb_matrix_build *b) {
  user_element e = {0};
  b->file->format = PB_FORMAT_ABAQUS_MTX;
  if (!starts_with_keyword(in)) return in->status ? in->status : read_entries(in, b);
  pb_status st = read_user_element(in, b, &e);
  if (!st) st = pb_matrix_build_choose(b, in->path, name, NULL, in->err);
  if (!st) b->file->cols = b->file->rows;
  b->file->half = !e.unsymmetric;
  free(e.node);
  return st;
}
