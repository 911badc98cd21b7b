// Aligned text tables: see table.h.
#include "table.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void add_column(pb_table *table, const char *name, const char *unit, int digits) {
  if (table->columns == PB_TABLE_COLUMNS || table->cells) {
    table->failed = true;
    return;
  }
  char *head = NULL;
  bool has_unit = unit && unit[0];
  if (asprintf(&head, has_unit ? "%s [%s]" : "%s", name, unit) < 0) {
    table->failed = true;
    return;
  }
  table->head[table->columns] = head;
  table->digits[table->columns++] = digits;
}

void pb_table_number_column(pb_table *table, const char *name, const char *unit, int digits) {
  add_column(table, name, unit, digits > 0 ? digits : 1);
}

void pb_table_text_column(pb_table *table, const char *name) {
  add_column(table, name, NULL, 0);
}

static void add_cell(pb_table *table, char *text) {
  if (table->cells == table->capacity) {
    size_t capacity = table->capacity ? 2 * table->capacity : 64;
    char **grown = realloc(table->cell, capacity * sizeof *grown);
    if (grown) {
      table->cell = grown;
      table->capacity = capacity;
    }
  }
  if (!text || table->cells == table->capacity || !table->columns) {
    table->failed = true;
    free(text);
    return;
  }
  table->cell[table->cells++] = text;
}

// Significant digits, trailing zeros kept ("1.000"), an exponent only far away from one.
static char *format_number(double value, int digits) {
  char *text = NULL;
  int length;
  double size = fabs(value);
  if (!isfinite(value)) {
    length = asprintf(&text, "–");
  } else if (value == 0) {
    length = asprintf(&text, "0");
  } else if (size < 1e-3 || size >= 1e7) {
    length = asprintf(&text, "%.*e", digits - 1, value);
  } else {
    int decimals = digits - 1 - (int)floor(log10(size));
    length = asprintf(&text, "%.*f", decimals > 0 ? decimals : 0, value);
  }
  return length < 0 ? NULL : text;
}

void pb_table_number(pb_table *table, double value) {
  int digits = table->columns ? table->digits[table->cells % table->columns] : 0;
  add_cell(table, format_number(value, digits > 0 ? digits : 6));
}

void pb_table_count(pb_table *table, size_t value) {
  char text[24];
  snprintf(text, sizeof text, "%zu", value);
  pb_table_text(table, text);
}

void pb_table_text(pb_table *table, const char *text) {
  add_cell(table, strdup(text ? text : ""));
}

// Characters of UTF-8: every byte but the continuation bytes.
static int width_of(const char *text) {
  int width = 0;
  for (; *text; text++) width += (*text & 0xC0) != 0x80;
  return width;
}

static void print_blanks(FILE *stream, int count) {
  if (count > 0) fprintf(stream, "%*s", count, "");
}

static void print_cell(FILE *stream, const char *text, int width, bool right, bool last) {
  int pad = width - width_of(text);
  if (right) print_blanks(stream, pad);
  fputs(text, stream);
  if (!right && !last) print_blanks(stream, pad);
  fputs(last ? "\n" : "  ", stream);
}

static void print_row(const pb_table *table, char *const *text, const int *width, FILE *stream,
                      int indent) {
  print_blanks(stream, indent);
  for (size_t j = 0; j < table->columns; j++) {
    print_cell(stream, text[j], width[j], table->digits[j] > 0, j + 1 == table->columns);
  }
}

static void print_rule(const pb_table *table, const int *width, FILE *stream, int indent) {
  print_blanks(stream, indent);
  for (size_t j = 0; j < table->columns; j++) {
    for (int i = 0; i < width[j]; i++) fputs("─", stream);
    fputs(j + 1 == table->columns ? "\n" : "  ", stream);
  }
}

pb_status pb_table_print(const pb_table *table, FILE *stream, int indent, pb_error *err) {
  if (table->failed) return pb_fail_memory(err, "table");
  size_t columns = table->columns;
  if (!columns || table->cells % columns) {
    return pb_fail(err, PB_ERR_ARGUMENT, "table", "the last row is not complete");
  }
  int width[PB_TABLE_COLUMNS];
  for (size_t j = 0; j < columns; j++) {
    width[j] = width_of(table->head[j]);
    for (size_t i = j; i < table->cells; i += columns) {
      int w = width_of(table->cell[i]);
      if (w > width[j]) width[j] = w;
    }
  }
  print_row(table, table->head, width, stream, indent);
  print_rule(table, width, stream, indent);
  for (size_t i = 0; i < table->cells; i += columns) {
    print_row(table, &table->cell[i], width, stream, indent);
  }
  return PB_OK;
}

void pb_table_free(pb_table *table) {
  for (size_t j = 0; j < table->columns; j++) free(table->head[j]);
  for (size_t i = 0; i < table->cells; i++) free(table->cell[i]);
  free(table->cell);
  *table = (pb_table){0};
}
