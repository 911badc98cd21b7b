// Lists of a matrix' rows from outside programs: see matrix_file.h. Ansys MLIST has pages as NLIST
// has (node_file.c), with the header NODE DOF or NODE LABEL.
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "part/listing.h"
#include "part/matrix_build.h"

static bool mlist_header(const char *text) {
  char word[4][12];
  int words = pb_listing_words(text, word, 4);
  return words >= 2 && !strcmp(word[0], "NODE") &&
         (!strcmp(word[1], "DOF") || !strcmp(word[1], "LABEL"));
}

// UX UY UZ ROTX ROTY ROTZ, or 0 … 6; −1: neither.
static int read_direction(char **at) {
  static const char *const name[] = {"UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ"};
  int64_t number;
  if (pb_scan_integer(at, &number)) return number >= 0 && number <= 6 ? (int)number : -1;
  char *p = *at + strspn(*at, " \t");
  size_t length = strcspn(p, " \t,;");
  for (int k = 0; k < 6; k++) {
    if (length != strlen(name[k]) || strncasecmp(p, name[k], length)) continue;
    *at = p + length;
    return k + 1;
  }
  return -1;
}

static pb_status add_row(pb_matrix_build *b, pb_lines *in, int64_t node, int direction) {
  int64_t row;
  size_t before = b->file->rows;
  pb_status st = pb_matrix_build_label(b, (pb_row_label){node, direction}, &row, in->err);
  if (!st && b->file->rows == before)
    st = pb_lines_fail(in, "direction %d of node %jd is listed twice", direction, (intmax_t)node);
  return st;
}

// "76423 UX", in newer releases with a third column that says whether the master is a support.
static pb_status read_mlist(pb_lines *in, pb_matrix_build *b) {
  bool inside = false;
  while (pb_lines_next(in)) {
    if (mlist_header(in->text)) {
      inside = true;
    } else if (inside && pb_listing_row(in)) {
      int64_t node;
      char *at = in->text;
      int direction = pb_scan_integer(&at, &node) && node > 0 ? read_direction(&at) : -1;
      if (direction < 1) return pb_lines_fail(in, "expected a node and one of UX … ROTZ");
      char *rest = at + strspn(at, " \t");
      if (*rest && strncmp(rest, "OFF", 3) && strncmp(rest, "ON", 2))
        return pb_lines_fail(in, "unexpected text behind the direction");
      pb_status st = add_row(b, in, node, direction);
      if (st) return st;
    } else {
      int64_t node;
      char *at = in->text;
      inside = false;
      if (pb_scan_integer(&at, &node) && read_direction(&at) > 0 && pb_scan_done(at))
        return pb_lines_fail(in, "a master without a header NODE DOF above it");
    }
  }
  return in->status;
}

// CalculiX: "node.direction"; otherwise node and direction apart.
static pb_status read_dof_table(pb_lines *in, pb_matrix_build *b) {
  while (pb_lines_next_filled(in)) {
    if (pb_listing_title(in)) continue;
    int64_t node;
    char *at = in->text, *point = strchr(at, '.');
    if (point) *point = ' ';
    bool ok = pb_scan_integer(&at, &node) && node > 0 && pb_scan_separator(&at, ",;");
    int direction = ok ? read_direction(&at) : -1;
    if (direction < 0 || !pb_scan_done(at))
      return pb_lines_fail(in, "expected a node and a direction (1 … 6)");
    pb_status st = add_row(b, in, node, direction);
    if (st) return st;
  }
  return in->status;
}

pb_status pb_dof_file_has_masters(const char *path, bool *out, pb_error *err) {
  pb_lines in;
  *out = false;
  pb_status st = pb_lines_open(&in, path, err);
  while (!st && !*out && pb_lines_next(&in)) *out = mlist_header(in.text);
  if (!st) st = in.status;
  pb_lines_close(&in);
  return st;
}

pb_status pb_dof_file_read(const char *path, pb_dof_file *out, pb_error *err) {
  *out = (pb_dof_file){0};
  pb_matrix_file rows = {0};
  pb_matrix_build build = {.file = &rows};
  bool masters;
  pb_lines in = {0};
  pb_status st = pb_dof_file_has_masters(path, &masters, err);
  if (!st) st = pb_lines_open(&in, path, err);
  if (!st) st = masters ? read_mlist(&in, &build) : read_dof_table(&in, &build);
  if (!st && !rows.rows) st = pb_fail(err, PB_ERR_SYNTAX, path, "lists no rows");
  if (!st) {
    *out = (pb_dof_file){.count = rows.rows, .label = rows.label};
    rows.label = NULL;
  }
  pb_lines_close(&in);
  pb_matrix_build_end(&build);
  pb_matrix_file_clear(&rows);
  return st;
}

void pb_dof_file_clear(pb_dof_file *file) {
  free(file->label);
  *file = (pb_dof_file){0};
}
