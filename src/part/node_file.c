// Lists of nodes from outside programs: see matrix_file.h.
//
// Ansys writes pages: a banner of some lines, then a header, then rows until a blank line.
//   NODE  X  Y  Z  [THXY  THYZ  THZX]       NLIST, with or without angles
// A file may hold the list of masters, too, in front of it or behind.
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "part/listing.h"
#include "part/matrix_build.h"

// ---- what a line is -----------------------------------------------------------------------------

// Numbers that a row of the list holds behind the node: 3 or 6; 0: this is no such header.
static int nlist_header(const char *text) {
  char word[8][12];
  int words = pb_listing_words(text, word, 8);
  bool is = words >= 4 && !strcmp(word[0], "NODE") && !strcmp(word[1], "X") &&
            !strcmp(word[2], "Y") && !strcmp(word[3], "Z");
  return is && (words == 4 || words == 7) ? words - 1 : 0;
}

static bool is_node_keyword(const char *text) {
  if (strncasecmp(text, "*NODE", 5)) return false;
  text += 5;
  while (*text == ' ' || *text == '\t') text++;
  return !*text || *text == ',';
}

typedef enum list_kind { LIST_TABLE, LIST_NLIST, LIST_KEYWORD, LIST_MARKET } list_kind;

// Judges the whole file, since a list may begin behind others; LIST_TABLE: plain numbers.
static pb_status judge_list(const char *path, list_kind *out, pb_error *err) {
  pb_lines in;
  *out = LIST_TABLE;
  pb_status st = pb_lines_open(&in, path, err);
  while (!st && *out == LIST_TABLE && pb_lines_next(&in)) {
    if (in.number == 1 && !strncasecmp(in.text, "%%MatrixMarket", 14)) *out = LIST_MARKET;
    if (nlist_header(in.text)) *out = LIST_NLIST;
    if (is_node_keyword(in.text)) *out = LIST_KEYWORD;
  }
  if (!st) st = in.status;
  pb_lines_close(&in);
  return st;
}

// ---- nodes --------------------------------------------------------------------------------------

typedef struct node_row {
  int64_t number;
  double xyz[3];
} node_row;

typedef struct node_list {
  size_t count, capacity;
  node_row *row;
} node_list;

static pb_status add_node(node_list *list, int64_t number, const double *xyz, pb_error *err) {
  if (list->count == list->capacity) {
    size_t capacity = list->capacity ? 2 * list->capacity : 256;
    node_row *row = realloc(list->row, capacity * sizeof *row);
    if (!row) return pb_fail_memory(err, "nodes");
    list->row = row;
    list->capacity = capacity;
  }
  list->row[list->count++] = (node_row){number, {xyz[0], xyz[1], xyz[2]}};
  return PB_OK;
}

// A node number and `numbers` reals, of which the first three are the coordinates.
static pb_status read_node(pb_lines *in, int numbers, const char *separators, node_list *list) {
  int64_t number;
  double value[6];
  char *at = in->text;
  bool ok = pb_scan_integer(&at, &number) && number > 0;
  for (int k = 0; ok && k < numbers; k++) {
    if (separators[0]) ok = pb_scan_separator(&at, separators);
    ok = ok && pb_scan_real(&at, &value[k]);
  }
  if (ok && separators[0]) pb_scan_separator(&at, separators);
  if (!ok || !pb_scan_done(at))
    return pb_lines_fail(in, "expected a node number and %d real numbers", numbers);
  return add_node(list, number, value, in->err);
}

// A node number and coordinates alone on a line, as no line of a banner is.
static bool looks_like_node(const char *text) {
  char *at = (char *)text;
  int64_t number;
  double value;
  int values = 0;
  if (!pb_scan_integer(&at, &number)) return false;
  while (pb_scan_real(&at, &value)) values++;
  return values >= 3 && pb_scan_done(at);
}

static pb_status read_nlist(pb_lines *in, node_list *list) {
  int numbers = 0;  // > 0: within a page's rows
  while (pb_lines_next(in)) {
    int header = nlist_header(in->text);
    if (header) {
      numbers = header;
    } else if (numbers && pb_listing_row(in)) {
      pb_status st = read_node(in, numbers, "", list);
      if (st) return st;
    } else {
      numbers = 0;
      if (looks_like_node(in->text))
        return pb_lines_fail(in, "a row of nodes without a header NODE X Y Z above it");
    }
  }
  return in->status;
}

static pb_status read_keyword_nodes(pb_lines *in, node_list *list) {
  bool inside = false;
  while (pb_lines_next_filled(in)) {
    if (in->text[0] == '*') {
      if (in->text[1] != '*') inside = is_node_keyword(in->text);
    } else if (inside) {
      pb_status st = read_node(in, 3, ",", list);
      if (st) return st;
    }
  }
  return in->status;
}

static pb_status read_node_table(pb_lines *in, node_list *list) {
  while (pb_lines_next_filled(in)) {
    if (pb_listing_title(in)) continue;
    bool separated = strpbrk(in->text, ",;");
    pb_status st = read_node(in, 3, separated ? ",;" : "", list);
    if (st) return st;
  }
  return in->status;
}

// An n × 3 array of a Matrix Market or MAT file: nodes 1 … n.
static pb_status take_array(const char *path, const pb_matrix_file *f, node_list *list,
                            pb_error *err) {
  if (f->cols != 3 || f->rows > 100000000 || f->half)
    return pb_fail(err, PB_ERR_SYNTAX, path, "is %s%zu × %zu, expected n × 3 coordinates",
                   f->half ? "symmetric, " : "", f->rows, f->cols);
  static const double origin[3];
  pb_status st = PB_OK;
  for (size_t i = 0; !st && i < f->rows; i++) st = add_node(list, (int64_t)i + 1, origin, err);
  for (size_t k = 0; !st && k < f->count; k++) list->row[f->row[k]].xyz[f->col[k]] = f->value[k];
  return st;
}

static pb_status read_array_nodes(const char *path, node_list *list, pb_error *err) {
  pb_matrix_file f;
  pb_status st = pb_matrix_file_read(path, "int_xyz", &f, err);
  if (!st) st = take_array(path, &f, list, err);
  pb_matrix_file_clear(&f);
  return st;
}

static int node_order(const void *a, const void *b) {
  int64_t x = ((const node_row *)a)->number, y = ((const node_row *)b)->number;
  return (x > y) - (x < y);
}

static pb_status take_nodes(const char *path, node_list *list, pb_node_file *out, pb_error *err) {
  if (!list->count) return pb_fail(err, PB_ERR_SYNTAX, path, "lists no nodes");
  qsort(list->row, list->count, sizeof *list->row, node_order);
  for (size_t i = 1; i < list->count; i++)
    if (list->row[i].number == list->row[i - 1].number)
      return pb_fail(err, PB_ERR_SYNTAX, path, "lists node %jd twice",
                     (intmax_t)list->row[i].number);
  out->number = malloc(list->count * sizeof *out->number);
  out->xyz = malloc(3 * list->count * sizeof *out->xyz);
  if (!out->number || !out->xyz) {
    pb_node_file_clear(out);
    return pb_fail_memory(err, path);
  }
  out->count = list->count;
  for (size_t i = 0; i < list->count; i++) {
    out->number[i] = list->row[i].number;
    memcpy(out->xyz + 3 * i, list->row[i].xyz, sizeof list->row[i].xyz);
  }
  return PB_OK;
}

static pb_status read_text_nodes(const char *path, list_kind kind, node_list *list, pb_error *err) {
  pb_lines in;
  pb_status st = pb_lines_open(&in, path, err);
  if (!st && kind == LIST_NLIST) st = read_nlist(&in, list);
  if (!st && kind == LIST_KEYWORD) st = read_keyword_nodes(&in, list);
  if (!st && kind == LIST_TABLE) st = read_node_table(&in, list);
  pb_lines_close(&in);
  return st;
}

pb_status pb_node_file_read(const char *path, pb_node_file *out, pb_error *err) {
  *out = (pb_node_file){0};
  node_list list = {0};
  pb_matrix_format format;
  list_kind kind = LIST_MARKET;
  pb_status st = pb_matrix_file_detect(path, &format, err);
  if (!st && format != PB_FORMAT_MAT5) st = judge_list(path, &kind, err);
  if (!st)
    st = kind == LIST_MARKET ? read_array_nodes(path, &list, err)
                             : read_text_nodes(path, kind, &list, err);
  if (!st) st = take_nodes(path, &list, out, err);
  free(list.row);
  return st;
}

size_t pb_node_index(const int64_t *number, size_t count, int64_t wanted) {
  size_t low = 0, high = count;
  while (low < high) {
    size_t middle = (low + high) / 2;
    if (number[middle] < wanted)
      low = middle + 1;
    else
      high = middle;
  }
  return low < count && number[low] == wanted ? low : SIZE_MAX;
}

void pb_node_file_clear(pb_node_file *file) {
  free(file->number);
  free(file->xyz);
  *file = (pb_node_file){0};
}
