// CSV files: see csv.h.
#include "csv.h"

#include <string.h>

pb_status pb_csv_open(const char *path, pb_csv *csv, pb_error *err) {
  *csv = (pb_csv){0};
  return pb_outfile_open(path, &csv->file, err);
}

// Quotes as RFC 4180 asks: around commas, quotes and line ends, quotes doubled.
static void put_text(FILE *stream, const char *text) {
  if (!strpbrk(text, ",\"\r\n")) {
    fputs(text, stream);
    return;
  }
  fputc('"', stream);
  for (; *text; text++) {
    if (*text == '"') fputc('"', stream);
    fputc(*text, stream);
  }
  fputc('"', stream);
}

void pb_csv_column(pb_csv *csv, const char *name, const char *unit) {
  char head[256];
  bool has_unit = unit && unit[0];
  snprintf(head, sizeof head, has_unit ? "%s [%s]" : "%s", name, unit);
  if (csv->columns++) fputc(',', csv->file.stream);
  put_text(csv->file.stream, head);
}

static void begin_cell(pb_csv *csv) {
  fputc(csv->cells % csv->columns ? ',' : '\n', csv->file.stream);
  csv->cells++;
}

void pb_csv_number(pb_csv *csv, double value) {
  begin_cell(csv);
  fprintf(csv->file.stream, "%.17g", value);
}

void pb_csv_text(pb_csv *csv, const char *text) {
  begin_cell(csv);
  put_text(csv->file.stream, text);
}

pb_status pb_csv_close(pb_csv *csv, pb_error *err) {
  pb_status status = PB_OK;
  fputc('\n', csv->file.stream);
  if (!csv->columns || csv->cells % csv->columns) {
    status = pb_fail(err, PB_ERR_STATE, csv->file.path, "the last row is not complete");
    pb_outfile_discard(&csv->file);
  } else {
    status = pb_outfile_close(&csv->file, err);
  }
  *csv = (pb_csv){0};
  return status;
}

void pb_csv_discard(pb_csv *csv) {
  pb_outfile_discard(&csv->file);
  *csv = (pb_csv){0};
}
