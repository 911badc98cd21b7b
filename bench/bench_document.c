// Writes the measurements of ./bench.sh as one document: bench_document NOTES OUT JSON…
//
// NOTES is a Markdown file that follows the measurements as it is; OUT appears whole or not at all.
#include <cjson/cJSON.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "base/json.h"
#include "base/text.h"
#include "bench.h"
#include "outfile.h"
#include "toolout.h"

static cJSON *load(const char *path) {
  char *text = NULL;
  size_t length = 0;
  cJSON *json = NULL;
  pb_error err = {0};
  bench_check(pb_text_read(path, &text, &length, &err), &err);
  bench_check(pb_json_parse(text, length, &json, &err), &err);
  free(text);
  return json;
}

static void put_machine(FILE *out, const cJSON *json) {
  const time_t now = time(NULL);
  char date[32];
  struct tm day;
  strftime(date, sizeof date, "%Y-%m-%d", gmtime_r(&now, &day));
  const cJSON *m = pb_json_member(json, "machine");
  fprintf(out, "Measured on %s: %s, %.0f cores (%s; %s), %.1f GiB, %s, %s", date,
          bench_json_text(m, "cpu"), bench_json_number(m, "cores"), bench_json_text(m, "features"),
          bench_json_text(m, "caches"), bench_json_number(m, "memory_bytes") / (1 << 30),
          bench_json_text(m, "kernel"), bench_json_text(m, "compiler"));
  if (bench_json_text(m, "blas")[0]) fprintf(out, ", %s", bench_json_text(m, "blas"));
  fprintf(out, ".%s\n\n",
          cJSON_IsTrue(pb_json_member(json, "quick")) ? " Quick: short measurements." : "");
}

// With the column's digits, without an exponent below a million.
static void put_number(FILE *out, const cJSON *value, int digits) {
  if (!cJSON_IsNumber(value)) {
    fputs(" – |", out);
    return;
  }
  const double x = value->valuedouble;
  const int before = x == 0 ? 1 : (int)floor(log10(fabs(x))) + 1;
  if (before > 6)
    fprintf(out, " %.*e |", digits - 1, x);
  else
    fprintf(out, " %.*f |", before >= digits ? 0 : digits - before < 9 ? digits - before : 9, x);
}

// Counts such as states are told without a fraction.
static void put_cell(FILE *out, const cJSON *value, const cJSON *column) {
  const bool whole = cJSON_IsNumber(value) && value->valuedouble == floor(value->valuedouble) &&
                     fabs(value->valuedouble) < 1e15;
  if (whole)
    fprintf(out, " %.0f |", value->valuedouble);
  else
    put_number(out, value, (int)bench_json_number(column, "digits"));
}

static void put_table(FILE *out, const cJSON *table) {
  const cJSON *columns = pb_json_member(table, "columns"), *column, *row;
  fprintf(out, "%s:\n\n| %s |", bench_json_text(table, "title"), bench_json_text(table, "case"));
  cJSON_ArrayForEach(column, columns) {
    const char *unit = bench_json_text(column, "unit");
    fprintf(out, " %s%s%s%s |", bench_json_text(column, "name"), unit[0] ? " [" : "", unit,
            unit[0] ? "]" : "");
  }
  fputs("\n|---|", out);
  cJSON_ArrayForEach(column, columns) fputs("---:|", out);
  fputc('\n', out);
  cJSON_ArrayForEach(row, pb_json_member(table, "rows")) {
    const cJSON *values = pb_json_member(row, "values"), *value = values ? values->child : NULL;
    fprintf(out, "| %s |", bench_json_text(row, "case"));
    for (column = columns->child; column && value; column = column->next, value = value->next)
      put_cell(out, value, column);
    fputc('\n', out);
  }
  fputc('\n', out);
}

static void put_goal(FILE *out, const char *program, const cJSON *goal) {
  const char *unit = bench_json_text(goal, "unit");
  const bool met = cJSON_IsTrue(pb_json_member(goal, "met"));
  fprintf(out, "| %s | %s | %.3g %s | %s %.3g | %s%s |\n", program, bench_json_text(goal, "what"),
          bench_json_number(goal, "measured"), unit, bench_json_text(goal, "relation"),
          bench_json_number(goal, "goal"), met ? "met" : "**missed**",
          cJSON_IsTrue(pb_json_member(goal, "judged")) ? "" : " (told only)");
}

static void put_summary(FILE *out, cJSON *const *json, int count) {
  const cJSON *goal;
  fputs("## Goals\n\n| program | what | measured | wanted | |\n|---|---|---:|---:|---|\n", out);
  for (int k = 0; k < count; k++)
    cJSON_ArrayForEach(goal, pb_json_member(json[k], "goals"))
        put_goal(out, bench_json_text(json[k], "bench"), goal);
  fputc('\n', out);
}

static void put_program(FILE *out, const cJSON *json) {
  const cJSON *item;
  const char *name = bench_json_text(json, "bench");
  fprintf(out, "## %s\n\n`bench_%s`, %.0f s.\n\n", bench_json_text(json, "question"), name,
          bench_json_number(json, "seconds"));
  cJSON_ArrayForEach(item, pb_json_member(json, "tables")) put_table(out, item);
  if (cJSON_GetArraySize(pb_json_member(json, "growth"))) {
    cJSON_ArrayForEach(item, pb_json_member(json, "growth"))
        fprintf(out, "- Growth of *%s* with %s: exponent %.2f\n", bench_json_text(item, "name"),
                bench_json_text(item, "x"), bench_json_number(item, "exponent"));
    fprintf(out, "\n![growth](images/performance-%s.png)\n\n", name);
  }
  cJSON_ArrayForEach(item, pb_json_member(json, "notes")) fprintf(out, "%s\n\n", item->valuestring);
}

static void put_file(FILE *out, const char *path) {
  char *text = NULL;
  size_t length = 0;
  pb_error err = {0};
  bench_check(pb_text_read(path, &text, &length, &err), &err);
  fwrite(text, 1, length, out);
  free(text);
}

int main(int argc, char **argv) {
  if (argc < 4) {
    fprintf(stderr, "usage: bench_document NOTES OUT JSON…\n");
    return 2;
  }
  const int count = argc - 3;
  cJSON **json = bench_memory((size_t)count, sizeof *json);
  pb_outfile file = {0};
  pb_error err = {0};
  for (int k = 0; k < count; k++) json[k] = load(argv[3 + k]);
  bench_check(pb_outfile_create(argv[2], &file, &err), &err);
  FILE *out = fopen(file.temp, "w");
  if (!out) bench_fail("%s: cannot be written", argv[2]);
  fputs("# Performance\n\nWritten by `./bench.sh`. Ratios are judged, times are told: they belong "
        "to the machine.\nEach ratio is the median of measurements made in turns, in one run.\n\n",
        out);
  put_machine(out, json[0]);
  put_summary(out, json, count);
  for (int k = 0; k < count; k++) put_program(out, json[k]);
  put_file(out, argv[1]);
  if (ferror(out) | fclose(out)) bench_fail("%s: cannot be written", argv[2]);
  bench_check(pb_outfile_commit(&file, &err), &err);
  for (int k = 0; k < count; k++) cJSON_Delete(json[k]);
  free(json);
  return 0;
}
