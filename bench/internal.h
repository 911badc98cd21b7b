// What the harness' own files share.
#ifndef PB_BENCH_INTERNAL_H
#define PB_BENCH_INTERNAL_H

#include <stdio.h>

#include "bench.h"

struct bench_table {
  char *key, *title, *case_name;
  size_t columns;
  bench_column *column;  // [columns]
  size_t rows;
  char **name;    // [rows]
  double *value;  // [rows][columns]
  bench_table *next;
};

typedef struct bench_judgement {
  char *what;
  const char *unit;  // NULL: a ratio
  double value, goal;
  bench_relation relation;
  bool judged, met;
} bench_judgement;

typedef struct bench_trend {
  const bench_table *table;
  size_t x, y;  // columns
  double from;
  double exponent, factor;  // y ≈ factor · x^exponent; NaN with fewer than two points
} bench_trend;

struct bench {
  char *name, *question;
  bool json, quick;
  char *plots, *out;  // directory, file; NULL: not asked for
  bench_machine machine;
  double begun;
  bench_table *first, *last;
  size_t goals, trends, notes;
  bench_judgement *goal;
  bench_trend *trend;
  char **note;
};

void bench_print_tables(const bench *b, FILE *stream);
void bench_print_json(const bench *b, FILE *stream);

// Fits exponent and factor.
void bench_trend_fit(bench_trend *trend);

// One figure for all trends of the program: DIR/performance-NAME.png.
pb_status bench_plot(const bench *b, pb_error *err);

#endif
