// A measurement as tables for people and as JSON for the document and for scripts.
#include <math.h>

#include "internal.h"
#include "jsonout.h"
#include "options.h"
#include "table.h"

static const char *relation_text(bench_relation relation) {
  return relation == BENCH_AT_LEAST ? "≥" : "≤";
}

// ---- tables -------------------------------------------------------------------------------------

static void print_table(const bench_table *t, FILE *stream) {
  pb_table table = {0};
  pb_error err = {0};
  pb_table_text_column(&table, t->case_name);
  for (size_t c = 0; c < t->columns; c++)
    pb_table_number_column(&table, t->column[c].name, t->column[c].unit, t->column[c].digits);
  for (size_t r = 0; r < t->rows; r++) {
    pb_table_text(&table, t->name[r]);
    for (size_t c = 0; c < t->columns; c++) pb_table_number(&table, t->value[r * t->columns + c]);
  }
  fprintf(stream, "\n%s:\n", t->title);
  bench_check(pb_table_print(&table, stream, 2, &err), &err);
  pb_table_free(&table);
}

static void print_goals(const bench *b, FILE *stream) {
  pb_table table = {0};
  pb_error err = {0};
  if (!b->goals) return;
  pb_table_text_column(&table, "goal");
  pb_table_number_column(&table, "measured", NULL, 3);
  pb_table_text_column(&table, "");
  pb_table_number_column(&table, "wanted", NULL, 3);
  pb_table_text_column(&table, "unit");
  pb_table_text_column(&table, "");
  for (size_t k = 0; k < b->goals; k++) {
    const bench_judgement *j = &b->goal[k];
    pb_table_text(&table, j->what);
    pb_table_number(&table, j->value);
    pb_table_text(&table, relation_text(j->relation));
    pb_table_number(&table, j->goal);
    pb_table_text(&table, j->unit ? j->unit : "×");
    pb_table_text(&table, j->met ? "met" : j->judged ? "MISSED" : "missed (not judged)");
  }
  fprintf(stream, "\nGoals:\n");
  bench_check(pb_table_print(&table, stream, 2, &err), &err);
  pb_table_free(&table);
}

static void print_trends(const bench *b, FILE *stream) {
  if (b->trends) fprintf(stream, "\nGrowth:\n");
  for (size_t k = 0; k < b->trends; k++) {
    const bench_trend *t = &b->trend[k];
    const bench_column *x = &t->table->column[t->x], *y = &t->table->column[t->y];
    fprintf(stream, "  %s, %s: exponent %.2f over %s", t->table->title, y->name, t->exponent,
            x->name);
    if (t->from > 0) fprintf(stream, ", from %g", t->from);
    fputc('\n', stream);
  }
}

void bench_print_tables(const bench *b, FILE *stream) {
  const bench_machine *m = &b->machine;
  fprintf(stream, "%s%s\n", b->question, b->quick ? " (quick)" : "");
  fprintf(stream, "%s, %ld cores (%s; %s), %.1f GiB, %s, %s; load %.1f\n", m->cpu, m->cores,
          m->features, m->caches, m->memory / (1 << 30), m->kernel, m->compiler, m->load);
  for (const bench_table *t = b->first; t; t = t->next) print_table(t, stream);
  print_goals(b, stream);
  print_trends(b, stream);
  if (b->notes) fputc('\n', stream);
  for (size_t k = 0; k < b->notes; k++) fprintf(stream, "  %s\n", b->note[k]);
}

// ---- JSON ---------------------------------------------------------------------------------------

static void put_machine(pb_jsonout *json, const bench_machine *m) {
  pb_jsonout_object(json, "machine");
  pb_jsonout_text(json, "cpu", m->cpu);
  pb_jsonout_integer(json, "cores", (uint64_t)m->cores);
  pb_jsonout_text(json, "features", m->features);
  pb_jsonout_text(json, "caches", m->caches);
  pb_jsonout_number(json, "memory_bytes", m->memory);
  pb_jsonout_text(json, "kernel", m->kernel);
  pb_jsonout_text(json, "compiler", m->compiler);
  pb_jsonout_text(json, "blas", m->blas[0] ? m->blas : NULL);
  pb_jsonout_number(json, "load", m->load);
  pb_jsonout_object_end(json);
}

static void put_table(pb_jsonout *json, const bench_table *t) {
  pb_jsonout_object(json, NULL);
  pb_jsonout_text(json, "key", t->key);
  pb_jsonout_text(json, "title", t->title);
  pb_jsonout_text(json, "case", t->case_name);
  pb_jsonout_array(json, "columns");
  for (size_t c = 0; c < t->columns; c++) {
    pb_jsonout_object(json, NULL);
    pb_jsonout_text(json, "key", t->column[c].key);
    pb_jsonout_text(json, "name", t->column[c].name);
    pb_jsonout_text(json, "unit", t->column[c].unit);
    pb_jsonout_integer(json, "digits", (uint64_t)t->column[c].digits);
    pb_jsonout_object_end(json);
  }
  pb_jsonout_array_end(json);
  pb_jsonout_array(json, "rows");
  for (size_t r = 0; r < t->rows; r++) {
    pb_jsonout_object(json, NULL);
    pb_jsonout_text(json, "case", t->name[r]);
    pb_jsonout_numbers(json, "values", t->value + r * t->columns, t->columns);
    pb_jsonout_object_end(json);
  }
  pb_jsonout_array_end(json);
  pb_jsonout_object_end(json);
}

static void put_goal(pb_jsonout *json, const bench_judgement *j) {
  pb_jsonout_object(json, NULL);
  pb_jsonout_text(json, "what", j->what);
  pb_jsonout_number(json, "measured", j->value);
  pb_jsonout_text(json, "relation", relation_text(j->relation));
  pb_jsonout_number(json, "goal", j->goal);
  pb_jsonout_text(json, "unit", j->unit);
  pb_jsonout_boolean(json, "judged", j->judged);
  pb_jsonout_boolean(json, "met", j->met);
  pb_jsonout_object_end(json);
}

static void put_trend(pb_jsonout *json, const bench_trend *t) {
  pb_jsonout_object(json, NULL);
  pb_jsonout_text(json, "table", t->table->key);
  pb_jsonout_text(json, "x", t->table->column[t->x].key);
  pb_jsonout_text(json, "y", t->table->column[t->y].key);
  pb_jsonout_text(json, "name", t->table->column[t->y].name);
  pb_jsonout_number(json, "from", t->from);
  pb_jsonout_number(json, "exponent", t->exponent);
  pb_jsonout_object_end(json);
}

void bench_print_json(const bench *b, FILE *stream) {
  pb_jsonout json;
  pb_jsonout_begin(&json, stream);
  pb_jsonout_object(&json, NULL);
  pb_jsonout_text(&json, "bench", b->name);
  pb_jsonout_text(&json, "question", b->question);
  pb_jsonout_boolean(&json, "quick", b->quick);
  pb_jsonout_number(&json, "seconds", bench_now() - b->begun);
  put_machine(&json, &b->machine);
  pb_jsonout_array(&json, "tables");
  for (const bench_table *t = b->first; t; t = t->next) put_table(&json, t);
  pb_jsonout_array_end(&json);
  pb_jsonout_array(&json, "goals");
  for (size_t k = 0; k < b->goals; k++) put_goal(&json, &b->goal[k]);
  pb_jsonout_array_end(&json);
  pb_jsonout_array(&json, "growth");
  for (size_t k = 0; k < b->trends; k++) put_trend(&json, &b->trend[k]);
  pb_jsonout_array_end(&json);
  pb_jsonout_array(&json, "notes");
  for (size_t k = 0; k < b->notes; k++) pb_jsonout_text(&json, NULL, b->note[k]);
  pb_jsonout_array_end(&json);
  pb_jsonout_object_end(&json);
  pb_jsonout_end(&json);
}
