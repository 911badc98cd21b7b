// Text files line by line, and the numbers in a line: what every reader of outside files uses.
//
//   pb_lines in = {0};
//   pb_lines_open(&in, path, err);  while (pb_lines_next(&in)) …  status = in.status;
//   pb_lines_close(&in);
#ifndef PB_PART_LINES_H
#define PB_PART_LINES_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "base/status.h"

typedef struct pb_lines {
  const char *path;
  pb_error *err;
  FILE *stream;
  size_t bytes;  // size of the file; 0 where it is not known (a pipe)
  char *buffer;
  size_t capacity, begin, end;
  bool ended, again;
  char *text;     // the current line, terminated, without its end of line
  size_t length;  // of text
  size_t number;  // of the current line, from 1
  pb_status status;
} pb_lines;

// Fails with PB_ERR_IO, PB_ERR_MEMORY. path and err must outlive the lines. [init]
pb_status pb_lines_open(pb_lines *in, const char *path, pb_error *err);
void pb_lines_close(pb_lines *in);  // a zeroed one is allowed

// The next line into in->text; false at the end of the file or on a failure (in->status):
// PB_ERR_IO, PB_ERR_MEMORY, PB_ERR_SYNTAX (a NUL byte: not a text; a line above 256 MiB; a last
// line without a newline: a number that was cut would pass for another number). [init]
bool pb_lines_next(pb_lines *in);

// The next line that is not blank.
bool pb_lines_next_filled(pb_lines *in);

// Lets the next pb_lines_next deliver the current line once more.
void pb_lines_back(pb_lines *in);

// Sets in->status and the error to PB_ERR_SYNTAX at "path:line" and returns it. [any]
pb_status pb_lines_fail(pb_lines *in, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

// Numbers at *at, after blanks; *at moves behind the number. False (and *at where it was): none is
// there, it does not fit, or something else than a separator (blank, comma, semicolon, bracket,
// end) follows. Reals may have the exponent letters e, E, d, D. [any]
bool pb_scan_integer(char **at, int64_t *out);
bool pb_scan_real(char **at, double *out);

// The same for Fortran and NASTRAN, which leave the exponent's letter out: 1.5-3, 3.+5.
bool pb_scan_real_bare(char **at, double *out);

// Steps over blanks and at most one of the separators; false: the line ends here.
bool pb_scan_separator(char **at, const char *separators);

// Whether only blanks are left. [any]
bool pb_scan_done(const char *at);

#endif
