// Aligned text tables: a header with units, numbers with a given number of significant digits.
//
// Cells are filled row by row. A failed allocation is remembered and reported by pb_table_print, so
// that building a table needs no checks in between. Zero-initialise a pb_table; free it at the end.
#ifndef PB_CLIENTS_TABLE_H
#define PB_CLIENTS_TABLE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "base/status.h"

enum { PB_TABLE_COLUMNS = 32 };

typedef struct pb_table {
  size_t columns;
  int digits[PB_TABLE_COLUMNS];  // significant digits of a number column; 0: a text column
  char *head[PB_TABLE_COLUMNS];  // "name" or "name [unit]"
  size_t cells, capacity;
  char **cell;  // [cells] row by row
  bool failed;  // an allocation failed, or there are too many columns
} pb_table;

// Columns first: right-aligned numbers (digits > 0) or left-aligned text (pb_table_text_column).
// unit may be NULL or empty.
void pb_table_number_column(pb_table *table, const char *name, const char *unit, int digits);
void pb_table_text_column(pb_table *table, const char *name);

// The next cell. A number that is not finite shows as "–"; text may be NULL (an empty cell).
void pb_table_number(pb_table *table, double value);
void pb_table_count(pb_table *table, size_t value);  // all digits, also in a number column
void pb_table_text(pb_table *table, const char *text);

// Prints header, rule and rows, each line indented by `indent` blanks. Widths count characters, not
// bytes (UTF-8). Fails with PB_ERR_MEMORY, PB_ERR_ARGUMENT (too many columns, an unfinished row).
pb_status pb_table_print(const pb_table *table, FILE *stream, int indent, pb_error *err);

void pb_table_free(pb_table *table);

#endif
