// Collecting results and ending with a verdict: see bench.h.
#include "bench.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "internal.h"
#include "options.h"
#include "outfile.h"

void bench_fail(const char *format, ...) {
  va_list list;
  va_start(list, format);
  fprintf(stderr, "%s: ", program_invocation_short_name);
  vfprintf(stderr, format, list);
  fputc('\n', stderr);
  va_end(list);
  exit(PB_EXIT_FAILED);
}

void bench_check(pb_status st, const pb_error *err) {
  if (!st) return;
  pb_print_error(stderr, err);
  exit(PB_EXIT_FAILED);
}

void *bench_memory(size_t count, size_t size) {
  size_t bytes = (count * size + 63) / 64 * 64;
  void *memory = aligned_alloc(64, bytes ? bytes : 64);
  if (!memory) bench_fail("out of memory");
  return memset(memory, 0, bytes ? bytes : 64);
}

static char *copy_text(const char *text) {
  char *copy = text ? strdup(text) : NULL;
  if (text && !copy) bench_fail("out of memory");
  return copy;
}

// The array with room for one more.
static void *grown(void *array, size_t count, size_t size) {
  void *larger = realloc(array, (count + 1) * size);
  if (!larger) bench_fail("out of memory");
  return larger;
}

// ---- command line -------------------------------------------------------------------------------

enum { KEY_JSON = 0x100, KEY_QUICK, KEY_PLOTS };

static const struct argp_option option_table[] = {
    {"json", KEY_JSON, NULL, 0, "Print JSON instead of tables", 0},
    {"quick", KEY_QUICK, NULL, 0, "Shorter measurements; the largest cases may be left out", 0},
    {"plots", KEY_PLOTS, "DIR", 0, "Draw the growth with size into DIR", 0},
    {NULL, 'o', "FILE", 0, "Write the JSON to FILE as well", 0},
    {0},
};

static error_t parse(int key, char *arg, struct argp_state *state) {
  bench *b = state->input;
  switch (key) {
  case KEY_JSON:
    b->json = true;
    return 0;
  case KEY_QUICK:
    b->quick = true;
    return 0;
  case KEY_PLOTS:
    free(b->plots);
    b->plots = copy_text(arg);
    return 0;
  case 'o':
    free(b->out);
    b->out = copy_text(arg);
    return 0;
  case ARGP_KEY_ARG:
    argp_error(state, "unexpected argument '%s'", arg);
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

bench *bench_begin(int argc, char **argv, const char *name, const char *question) {
  bench *b = bench_memory(1, sizeof *b);
  b->name = copy_text(name);
  b->question = copy_text(question);
  struct argp argp = {.options = option_table, .parser = parse, .doc = question};
  pb_options_parse(&argp, argc, argv, b);
  bench_machine_describe(&b->machine);
  b->begun = bench_now();
  return b;
}

bool bench_quick(const bench *b) {
  return b->quick;
}

// ---- results ------------------------------------------------------------------------------------

bench_table *bench_table_add(bench *b, const char *key, const char *title, const char *case_name,
                             size_t count, const bench_column *column) {
  bench_table *t = bench_memory(1, sizeof *t);
  t->key = copy_text(key);
  t->title = copy_text(title);
  t->case_name = copy_text(case_name);
  t->columns = count;
  t->column = bench_memory(count, sizeof *t->column);
  memcpy(t->column, column, count * sizeof *column);
  if (b->last)
    b->last->next = t;
  else
    b->first = t;
  b->last = t;
  return t;
}

void bench_row(bench_table *t, const char *name, const double *value) {
  t->name = grown(t->name, t->rows, sizeof *t->name);
  t->name[t->rows] = copy_text(name);
  t->value = grown(t->value, t->rows, t->columns * sizeof *t->value);
  memcpy(t->value + t->rows * t->columns, value, t->columns * sizeof *value);
  t->rows++;
}

static void judge(bench *b, bench_judgement j) {
  j.what = copy_text(j.what);
  j.met = j.relation == BENCH_AT_LEAST ? j.value >= j.goal : j.value <= j.goal;
  b->goal = grown(b->goal, b->goals, sizeof *b->goal);
  b->goal[b->goals++] = j;
}

void bench_goal(bench *b, const char *what, double ratio, bench_relation relation, double goal) {
  judge(b, (bench_judgement){(char *)what, NULL, ratio, goal, relation, true, false});
}

void bench_target(bench *b, const char *what, double value, const char *unit,
                  bench_relation relation, double goal) {
  judge(b, (bench_judgement){(char *)what, unit, value, goal, relation, false, false});
}

static size_t column_named(const bench_table *t, const char *key) {
  for (size_t c = 0; c < t->columns; c++)
    if (!strcmp(t->column[c].key, key)) return c;
  bench_fail("table '%s' has no column '%s'", t->key, key);
}

void bench_growth(bench *b, const bench_table *table, const char *x, const char *y, double from) {
  bench_trend trend = {
      .table = table, .x = column_named(table, x), .y = column_named(table, y), .from = from};
  bench_trend_fit(&trend);
  b->trend = grown(b->trend, b->trends, sizeof *b->trend);
  b->trend[b->trends++] = trend;
}

void bench_note(bench *b, const char *format, ...) {
  char *text = NULL;
  va_list list;
  va_start(list, format);
  if (vasprintf(&text, format, list) < 0) bench_fail("out of memory");
  va_end(list);
  b->note = grown(b->note, b->notes, sizeof *b->note);
  b->note[b->notes++] = text;
}

// ---- the end ------------------------------------------------------------------------------------

static pb_status write_json(const bench *b, pb_error *err) {
  pb_outfile file = {0};
  pb_status st = pb_outfile_create(b->out, &file, err);
  if (st) return st;
  FILE *stream = fopen(file.temp, "w");
  bool good = stream != NULL;
  if (good) bench_print_json(b, stream);
  if (good) good = !ferror(stream) & !fclose(stream);
  if (good) return pb_outfile_commit(&file, err);
  pb_outfile_discard(&file);
  return pb_fail(err, PB_ERR_IO, b->out, "cannot be written");
}

static void free_table(bench_table *t) {
  for (size_t r = 0; r < t->rows; r++) free(t->name[r]);
  free(t->name);
  free(t->value);
  free(t->column);
  free(t->key);
  free(t->title);
  free(t->case_name);
  free(t);
}

static void free_all(bench *b) {
  for (bench_table *t = b->first, *next; t; t = next) {
    next = t->next;
    free_table(t);
  }
  for (size_t k = 0; k < b->goals; k++) free(b->goal[k].what);
  for (size_t k = 0; k < b->notes; k++) free(b->note[k]);
  free(b->goal);
  free(b->trend);
  free(b->note);
  free(b->name);
  free(b->question);
  free(b->plots);
  free(b->out);
  free(b);
}

int bench_end(bench *b) {
  pb_error err = {0};
  pb_status st = PB_OK;
  bool met = true;
  for (size_t k = 0; k < b->goals; k++) met = met && (b->goal[k].met || !b->goal[k].judged);
  if (b->plots && b->trends) st = bench_plot(b, &err);
  if (!st && b->out) st = write_json(b, &err);
  if (b->json)
    bench_print_json(b, stdout);
  else
    bench_print_tables(b, stdout);
  if (st) pb_print_error(stderr, &err);
  free_all(b);
  return st || !met || fflush(stdout) ? PB_EXIT_FAILED : PB_EXIT_DONE;
}
