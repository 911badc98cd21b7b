// CSV files: see csv.h.
#include "csv.h"

#include <errno.h>
#include <string.h>

pb_status pb_csv_open(const char *path, pb_csv *csv, pb_error *err) {
  pb_csv made = {0};
  *csv = made;
  pb_status status = pb_outfile_create(path, &made.file, err);
  if (status) return status;
  made.stream = fopen(made.file.temp, "w");
  if (!made.stream) {
    status = pb_fail(err, PB_ERR_IO, path, "cannot be written: %s", strerror(errno));
    pb_outfile_discard(&made.file);
    return status;
  }
  *csv = made;
  return PB_OK;
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
  if (csv->columns++) fputc(',', csv->stream);
  put_text(csv->stream, head);
}

static void begin_cell(pb_csv *csv) {
  fputc(csv->cells % csv->columns ? ',' : '\n', csv->stream);
  csv->cells++;
}

void pb_csv_number(pb_csv *csv, double value) {
  begin_cell(csv);
  fprintf(csv->stream, "%.17g", value);
}

void pb_csv_text(pb_csv *csv, const char *text) {
  begin_cell(csv);
  put_text(csv->stream, text);
}

pb_status pb_csv_close(pb_csv *csv, pb_error *err) {
  fputc('\n', csv->stream);
  bool whole = csv->columns && csv->cells % csv->columns == 0;
  bool bad = ferror(csv->stream) != 0;
  bool written = fclose(csv->stream) == 0 && !bad;
  csv->stream = NULL;
  pb_status status = PB_OK;
  if (!whole) {
    status = pb_fail(err, PB_ERR_STATE, csv->file.path, "the last row is not complete");
  } else if (!written) {
    status = pb_fail(err, PB_ERR_IO, csv->file.path, "cannot be written: %s", strerror(errno));
  }
  if (status) {
    pb_outfile_discard(&csv->file);
  } else {
    status = pb_outfile_commit(&csv->file, err);
  }
  *csv = (pb_csv){0};
  return status;
}

void pb_csv_discard(pb_csv *csv) {
  if (csv->stream) fclose(csv->stream);
  pb_outfile_discard(&csv->file);
  *csv = (pb_csv){0};
}
