// Reading identify.csv: columns "frequency [Hz]", and "real OUTPUT from INPUT [unit]", "imag …",
// "variance …" of each channel, found by their names.
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "frf_read.h"
#include "options.h"

pb_status frf_read(const char *path, const frf_names *names, pb_apa_data *out, pb_error *err) {
  const char *dot = strrchr(path, '.');
  if (dot && !strcmp(dot, ".csv")) return frf_read_csv(path, names, out, err);
  if (dot && !strcmp(dot, ".mat")) return frf_read_mat(path, names, out, err);
  return pb_fail(err, PB_ERR_ARGUMENT, path, "expected a .csv or .mat file of plantbus-identify");
}

// Cuts the next cell off a line in place; quotes (RFC 4180) are taken off. NULL at the end.
static char *next_cell(char **rest) {
  char *start = *rest, *to;
  if (!start) return NULL;
  if (*start != '"') {
    char *comma = strchr(start, ',');
    if (comma) *comma = 0;
    *rest = comma ? comma + 1 : NULL;
    return start;
  }
  to = start;
  char *from = start + 1;
  for (; *from && !(from[0] == '"' && from[1] != '"'); from++) {
    if (from[0] == '"') from++;
    *to++ = *from;
  }
  if (*from == '"') from++;
  *rest = *from == ',' ? from + 1 : NULL;
  *to = 0;
  return start;
}

// Cuts the next line off; NULL at the end of the text.
static char *next_line(char **rest) {
  char *line = *rest;
  if (!line || !*line) return NULL;
  char *end = strchr(line, '\n');
  *rest = end ? end + 1 : NULL;
  if (!end) end = line + strlen(line);
  if (end > line && end[-1] == '\r') end--;
  *end = 0;
  return line;
}

enum { REAL, IMAG, VARIANCE, PARTS };

typedef struct columns {
  size_t count;      // in the header
  size_t frequency;  // from 1 on; 0: missing
  size_t part[PB_APA_OUTPUTS][PARTS];
} columns;

// Whether a header cell is `what` without its unit.
static bool is_column(const char *cell, const char *what) {
  const size_t length = strlen(what);
  return !strncmp(cell, what, length) && (cell[length] == 0 || !strncmp(cell + length, " [", 2));
}

static void match_column(const char *cell, const frf_names *names, size_t index, columns *c) {
  static const char *const part[PARTS] = {"real", "imag", "variance"};
  char wanted[300];
  if (is_column(cell, "frequency")) c->frequency = index;
  for (int k = 0; k < PB_APA_OUTPUTS; k++)
    for (int p = 0; p < PARTS; p++) {
      snprintf(wanted, sizeof wanted, "%s %s from %s", part[p], names->output[k], names->input);
      if (is_column(cell, wanted)) c->part[k][p] = index;
    }
}

static pb_status read_header(const char *path, char *line, const frf_names *names, columns *c,
                             pb_error *err) {
  *c = (columns){0};
  for (char *cell; (cell = next_cell(&line));) match_column(cell, names, ++c->count, c);
  if (!c->frequency)
    return pb_fail(err, PB_ERR_SYNTAX, path, "line 1: no column \"frequency [Hz]\"");
  for (int k = 0; k < PB_APA_OUTPUTS; k++)
    if (!c->part[k][REAL] || !c->part[k][IMAG])
      return pb_fail(err, PB_ERR_REFERENCE, path,
                     "line 1: no columns \"real %s from %s\" and \"imag …\"", names->output[k],
                     names->input);
  return PB_OK;
}

static bool parse_cell(const char *text, double *out) {
  if (!strcmp(text, "inf")) {  // the variance of a line that was not excited
    *out = INFINITY;
    return true;
  }
  return pb_parse_double(text, out);
}

static pb_status read_row(const char *path, size_t number, char *line, const columns *c,
                          double *value, pb_error *err) {
  char where[320];
  size_t count = 0;
  snprintf(where, sizeof where, "%.280s:%zu", path, number);
  for (char *cell; (cell = next_cell(&line)); count++) {
    if (count == c->count) break;
    const bool needed = count + 1 == c->frequency || count + 1 == c->part[0][REAL] ||
                        count + 1 == c->part[0][IMAG] || count + 1 == c->part[1][REAL] ||
                        count + 1 == c->part[1][IMAG];
    if (!parse_cell(cell, &value[count])) value[count] = NAN;
    if (needed && !isfinite(value[count]))
      return pb_fail(err, PB_ERR_SYNTAX, where, "column %zu: '%s' is not a number", count + 1,
                     cell);
  }
  if (count != c->count || line)
    return pb_fail(err, PB_ERR_SYNTAX, where, "expected %zu columns", c->count);
  return PB_OK;
}

static void put_row(const columns *c, const double *value, size_t f, pb_frf *frf) {
  frf->frequency_hz[f] = value[c->frequency - 1];
  for (size_t k = 0; k < PB_APA_OUTPUTS; k++) {
    const size_t at = f * PB_APA_OUTPUTS + k, variance = c->part[k][VARIANCE];
    frf->h[at] = value[c->part[k][REAL] - 1] + I * value[c->part[k][IMAG] - 1];
    frf->variance[at] = variance && !isnan(value[variance - 1]) ? value[variance - 1] : 0;
    frf->coherence[at] = 1;
  }
}

static pb_status read_rows(const char *path, char *rest, const columns *c, size_t rows, pb_frf *frf,
                           pb_error *err) {
  double *value = malloc(c->count * sizeof *value);
  pb_status st = value ? PB_OK : pb_fail_memory(err, path);
  for (size_t f = 0; f < rows && !st; f++) {
    st = read_row(path, f + 2, next_line(&rest), c, value, err);
    if (st) break;
    put_row(c, value, f, frf);
    if (!(frf->frequency_hz[f] > (f ? frf->frequency_hz[f - 1] : 0)))
      st = pb_fail(err, PB_ERR_SYNTAX, path, "line %zu: frequencies are > 0 and ascend", f + 2);
  }
  free(value);
  return st;
}

pb_status frf_read_csv(const char *path, const frf_names *names, pb_apa_data *out, pb_error *err) {
  char *text = NULL;
  size_t length, rows = 0;
  columns c = {0};
  *out = (pb_apa_data){0};
  pb_status st = pb_text_read(path, &text, &length, err);
  if (st) return st;
  char *rest = text, *header = next_line(&rest);
  for (const char *at = rest; at && *at; rows++) {
    at = strchr(at, '\n');
    if (at) at++;
  }
  st = header ? read_header(path, header, names, &c, err)
              : pb_fail(err, PB_ERR_SYNTAX, path, "is empty");
  if (!st && rows == 0) st = pb_fail(err, PB_ERR_SYNTAX, path, "has a header only");
  if (!st) st = pb_frf_new(rows, PB_APA_OUTPUTS, 1, &out->frf, err);
  if (!st) st = read_rows(path, rest, &c, rows, &out->frf, err);
  free(text);
  if (st) pb_apa_data_clear(out);
  return st;
}
