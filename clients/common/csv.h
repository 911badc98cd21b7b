// CSV files (RFC 4180): one header row with units, then rows of numbers with 17 significant digits,
// so that a reader gets the very doubles back. Non-finite numbers are written nan, inf, -inf.
//
//   pb_csv csv = {0};
//   pb_csv_open(path, &csv, err)  →  pb_csv_column(…) for each  →  pb_csv_number(…) row by row
//   →  pb_csv_close(&csv, err)    (pb_csv_discard on another failure)
#ifndef PB_CLIENTS_CSV_H
#define PB_CLIENTS_CSV_H

#include <stddef.h>
#include <stdio.h>

#include "base/status.h"
#include "outfile.h"

typedef struct pb_csv {
  pb_outfile file;
  size_t columns, cells;
} pb_csv;

pb_status pb_csv_open(const char *path, pb_csv *csv, pb_error *err);

// Header cell "name [unit]" (unit may be NULL); all columns come before the first number.
void pb_csv_column(pb_csv *csv, const char *name, const char *unit);

// The next cell of the row; rows break by themselves.
void pb_csv_number(pb_csv *csv, double value);
void pb_csv_text(pb_csv *csv, const char *text);

// Completes the file under its name. Fails with PB_ERR_IO (disk full …), PB_ERR_STATE (an
// unfinished row); nothing is left behind then. *csv is emptied either way.
pb_status pb_csv_close(pb_csv *csv, pb_error *err);
void pb_csv_discard(pb_csv *csv);

#endif
