// Matrices in NASTRAN's bulk data (punch files): DMIG entries in small fields (8 columns), large
// fields (16 columns, marked with *) or free fields (commas).
//
//   DMIG  NAME 0  IFO TIN TOUT POLAR   NCOL      a matrix; IFO 6: symmetric, 1: square, 9:
//   rectangular DMIG  NAME GJ CJ       G1 C1 A1 B1           column (GJ, CJ), row (G1, C1), value
//   A1 …
//   +     G2   C2 A2 B2    G3 C3 A3 B3           … and more rows of the same column
//
// In large fields the first line ends behind CJ and each continuation holds one row. Component 0 is
// a scalar point, which carries a mode. Source: NX and MSC Nastran Quick Reference Guide, DMIG.
#include <ctype.h>
#include <string.h>
#include <strings.h>

#include "part/matrix_build.h"

enum { FIELDS = 10, WIDTH = 48 };

typedef struct card {
  char field[FIELDS][WIDTH];
  int fields;
  bool large;
} card;

// false: it does not fit; half a number would be another number.
static bool take_field(card *c, const char *from, size_t length) {
  while (length && *from == ' ') from++, length--;
  while (length && from[length - 1] == ' ') length--;
  if (length > WIDTH - 1) return false;
  memcpy(c->field[c->fields], from, length);
  c->field[c->fields++][length] = 0;
  return true;
}

// Ten fields, of which the last is a mark of continuation.
static bool split_free(card *c, const char *text) {
  while (c->fields < FIELDS) {
    size_t length = strcspn(text, ",");
    if (!take_field(c, text, length)) return false;
    if (!text[length]) return true;
    text += length + 1;
  }
  return pb_scan_done(text);
}

// A small field card has ten fields of 8 columns, a large one six, of which the middle four are 16.
static bool split_card(const char *text, card *c) {
  *c = (card){0};
  size_t length = strlen(text), first = length < 8 ? length : 8;
  if (strchr(text, '\t')) return false;
  if (strchr(text, ',')) return split_free(c, text) && !strchr(c->field[0], '*');
  take_field(c, text, first);
  c->large = strchr(c->field[0], '*') != NULL;
  size_t width = c->large ? 16 : 8;
  for (size_t at = 8; at < length && at < 72; at += width)
    take_field(c, text + at, length - at < width ? length - at : width);
  return true;
}

static bool field_integer(const char *text, int64_t blank, int64_t *out) {
  char *at = (char *)text;
  if (!*text) {
    *out = blank;
    return blank >= 0;
  }
  return pb_scan_integer(&at, out) && !*at;
}

typedef struct punch {
  pb_lines *in;
  pb_matrix_build *b;
  bool keeping;  // entries of the present matrix are taken: it is square
  char name[WIDTH];
  int64_t announced, columns;  // NCOL, and those seen
  bool in_column, other;       // other: within another bulk entry, continuations belong to it
  int64_t column;              // row index of the present column
} punch;

// Bulk entries that stand beside matrices in punch files.
static bool is_known_other(const char *name) {
  static const char *const known[] = {"BEGIN",   "ENDDATA", "GRID",   "SPOINT", "SEBULK",
                                      "SECONCT", "EXTRN",   "ASET",   "QSET",   "SEUSET",
                                      "SESET",   "CSUPER",  "CORD",   "PARAM",  "TITLE",
                                      "SUBTI",   "LABEL",   "PLOTEL", NULL};
  for (int k = 0; known[k]; k++)
    if (!strncasecmp(name, known[k], strlen(known[k]))) return true;
  return false;
}

static pb_status end_matrix(punch *p) {
  if (p->keeping && p->columns < p->announced)
    return pb_lines_fail(p->in, "matrix %s ends after %jd of the %jd columns that it announces",
                         p->name, (intmax_t)p->columns, (intmax_t)p->announced);
  return PB_OK;
}

static pb_status read_header(punch *p, const card *c) {
  int64_t form, type, polar;
  pb_status st = end_matrix(p);
  if (st) return st;
  if (!field_integer(c->field[3], -1, &form) || !field_integer(c->field[4], -1, &type) ||
      !field_integer(c->field[6], 0, &polar) || !field_integer(c->field[8], 0, &p->announced))
    return pb_lines_fail(p->in, "expected DMIG, NAME, 0, IFO, TIN, TOUT, POLAR, blank, NCOL");
  if (type == 3 || type == 4 || polar)
    return pb_lines_fail(p->in, "matrix %s is complex", c->field[1]);
  if (type != 1 && type != 2) return pb_lines_fail(p->in, "TIN %jd is not known", (intmax_t)type);
  if (form != 1 && form != 2 && form != 6 && form != 9)
    return pb_lines_fail(p->in, "IFO %jd is not known", (intmax_t)form);
  snprintf(p->name, sizeof p->name, "%s", c->field[1]);
  p->keeping = form == 1 || form == 6;
  p->columns = 0;
  p->in_column = false;
  if (!p->keeping) return PB_OK;
  st = pb_matrix_build_section(p->b, p->in, p->name);
  if (!st) p->b->section[p->b->sections - 1].full = form == 1;
  return st;
}

static pb_status take_label(punch *p, const char *node, const char *component, int64_t *row) {
  int64_t number, direction;
  if (!field_integer(node, -1, &number) || number < 1 || !field_integer(component, 0, &direction) ||
      direction < 0 || direction > 6)
    return pb_lines_fail(p->in, "expected a point and a component 0 … 6, not '%s' and '%s'", node,
                         component);
  return pb_matrix_build_label(p->b, (pb_row_label){number, (int)direction}, row, p->in->err);
}

static pb_status read_entry(punch *p, const char *node, const char *component, const char *value) {
  double number;
  char text[WIDTH + 1], *at = text;
  size_t n = 0;
  for (; *value && n < WIDTH; value++)  // "5.000388 D+5": blanks within a number
    if (*value != ' ') text[n++] = *value;
  text[n] = 0;
  if (!pb_scan_real_bare(&at, &number) || *at)
    return pb_lines_fail(p->in, "expected a real number, not '%s'", text);
  if (!p->keeping) return PB_OK;
  int64_t row;
  pb_status st = take_label(p, node, component, &row);
  return st ? st : pb_matrix_build_add(p->b, row, p->column, number, p->in->err);
}

// Up to two rows in the four-field groups that begin at field `at`.
static pb_status read_rows(punch *p, const card *c, int at) {
  int last = c->large ? 4 : 8;
  for (; at + 2 <= last; at += 4) {
    if (!c->field[at][0] && !c->field[at + 2][0]) continue;
    pb_status st = read_entry(p, c->field[at], c->field[at + 1], c->field[at + 2]);
    if (st) return st;
  }
  return PB_OK;
}

static pb_status read_column(punch *p, const card *c) {
  if (strcasecmp(c->field[1], p->name))
    return pb_lines_fail(p->in, "a column of matrix '%s' without its header", c->field[1]);
  p->in_column = true;
  p->columns++;
  pb_status st = PB_OK;
  if (p->keeping) st = take_label(p, c->field[2], c->field[3], &p->column);
  if (!st && !c->large) st = read_rows(p, c, 5);
  return st;
}

static pb_status read_card(punch *p) {
  card c;
  if (!split_card(p->in->text, &c))
    return pb_lines_fail(
        p->in, "tabs, large fields apart by commas, or fields that are too long or too many");
  bool continuation = !c.field[0][0] || c.field[0][0] == '+' || c.field[0][0] == '*';
  if (continuation && p->other) return PB_OK;
  if (continuation)
    return p->in_column ? read_rows(p, &c, 1)
                        : pb_lines_fail(p->in, "a continuation without a column before it");
  char *star = strchr(c.field[0], '*');
  if (star) *star = 0;
  p->other = strcasecmp(c.field[0], "DMIG") != 0;
  if (p->other) {
    p->in_column = false;
    return is_known_other(c.field[0]) ? PB_OK
                                      : pb_lines_fail(p->in, "unknown entry '%s'", c.field[0]);
  }
  return !strcmp(c.field[2], "0") ? read_header(p, &c) : read_column(p, &c);
}

pb_status pb_read_dmig(pb_lines *in, const char *name, pb_matrix_build *b) {
  punch p = {.in = in, .b = b};
  pb_matrix_section chosen = {0};
  b->file->format = PB_FORMAT_NASTRAN_DMIG;
  while (pb_lines_next_filled(in)) {
    pb_status st = in->text[0] == '$' ? PB_OK : read_card(&p);
    if (st) return st;
  }
  pb_status st = in->status;
  if (!st) st = end_matrix(&p);
  if (!st) st = pb_matrix_build_choose(b, in->path, name, &chosen, in->err);
  if (!st) st = pb_matrix_build_sort(b, in->err);
  if (!st && !chosen.full) st = pb_matrix_build_judge_half(b, in->err);
  return st;
}
