// Symmetric sparse matrices by compressed columns: see sparse.h.
#include "part/sparse.h"

#include <inttypes.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

void pb_sparse_clear(pb_sparse *a) {
  free(a->start);
  free(a->row);
  free(a->value);
  *a = (pb_sparse){0};
}

static pb_status check_entries(size_t n, size_t count, const int64_t *row, const int64_t *col,
                               pb_error *err) {
  for (size_t k = 0; k < count; k++) {
    bool inside = row[k] >= 0 && col[k] >= 0 && (size_t)row[k] < n && (size_t)col[k] < n;
    if (!inside)
      return pb_fail(err, PB_ERR_ARGUMENT, "matrix",
                     "entry %zu is at (%" PRId64 ", %" PRId64 ") of a matrix of size %zu", k + 1,
                     row[k] + 1, col[k] + 1, n);
  }
  return PB_OK;
}

static int64_t smaller(int64_t a, int64_t b) {
  return a < b ? a : b;
}

static int64_t larger(int64_t a, int64_t b) {
  return a > b ? a : b;
}

// From counts in at[1 …] to places in at[0 …].
static void accumulate(int64_t *at, size_t n) {
  for (size_t j = 0; j < n; j++) at[j + 1] += at[j];
}

// Puts the entries in order of rows, then, keeping that order, into their columns: each column's
// rows come out ascending without a comparison.
static void sort_entries(size_t n, size_t count, const int64_t *row, const int64_t *col,
                         const double *value, int64_t *at, int64_t *order, pb_sparse *out) {
  memset(at, 0, (n + 1) * sizeof *at);
  for (size_t k = 0; k < count; k++) at[smaller(row[k], col[k]) + 1]++;
  accumulate(at, n);
  for (size_t k = 0; k < count; k++) order[at[smaller(row[k], col[k])]++] = (int64_t)k;
  memset(out->start, 0, (n + 1) * sizeof *out->start);
  for (size_t k = 0; k < count; k++) out->start[larger(row[k], col[k]) + 1]++;
  accumulate(out->start, n);
  memcpy(at, out->start, (n + 1) * sizeof *at);
  for (size_t i = 0; i < count; i++) {
    size_t k = (size_t)order[i], to = (size_t)at[larger(row[k], col[k])]++;
    out->row[to] = smaller(row[k], col[k]);
    out->value[to] = value[k];
  }
}

// Adds up neighbours of the same place and moves the rest together.
static void merge_equal(pb_sparse *a) {
  size_t to = 0, from = 0;
  for (size_t j = 0; j < a->n; j++) {
    size_t begin = to, end = (size_t)a->start[j + 1];
    for (; from < end; from++) {
      if (to > begin && a->row[to - 1] == a->row[from]) {
        a->value[to - 1] += a->value[from];
      } else {
        a->row[to] = a->row[from];
        a->value[to++] = a->value[from];
      }
    }
    a->start[j] = (int64_t)begin;
  }
  a->start[a->n] = (int64_t)to;
}

// Gives back what merging freed; a failure to do so costs memory only.
static void shrink(pb_sparse *a) {
  size_t entries = (size_t)a->start[a->n] + 1;
  int64_t *row = realloc(a->row, entries * sizeof *row);
  if (row) a->row = row;
  double *value = realloc(a->value, entries * sizeof *value);
  if (value) a->value = value;
}

pb_status pb_sparse_from_entries(size_t n, size_t count, const int64_t *row, const int64_t *col,
                                 const double *value, pb_sparse *out, pb_error *err) {
  *out = (pb_sparse){0};
  pb_status st = check_entries(n, count, row, col, err);
  if (st) return st;
  pb_sparse made = {n, malloc((n + 1) * sizeof(int64_t)), malloc((count + 1) * sizeof(int64_t)),
                    malloc((count + 1) * sizeof(double))};
  int64_t *at = malloc((n + 1) * sizeof *at), *order = malloc((count + 1) * sizeof *order);
  if (made.start && made.row && made.value && at && order) {
    sort_entries(n, count, row, col, value, at, order, &made);
    merge_equal(&made);
    shrink(&made);
    *out = made;
  } else {
    pb_sparse_clear(&made);
    st = pb_fail_memory(err, "matrix");
  }
  free(at);
  free(order);
  return st;
}

void pb_sparse_multiply(const pb_sparse *a, size_t columns, const double *x, double *y) {
  size_t n = a->n;
  memset(y, 0, n * columns * sizeof *y);
  for (size_t c = 0; c < columns; c++, x += n, y += n) {
    for (size_t j = 0; j < n; j++) {
      double xj = x[j], sum = 0;
      for (int64_t at = a->start[j]; at < a->start[j + 1]; at++) {
        size_t i = (size_t)a->row[at];
        sum += a->value[at] * x[i];
        if (i != j) y[i] += a->value[at] * xj;
      }
      y[j] += sum;
    }
  }
}

// `columns` of them at once: an entry is read for all.
static inline void multiply_triple(const pb_sparse *a, size_t columns, const double *x, double *y) {
  size_t n = a->n, ld = 3 * n;
  for (size_t j = 0; j < n; j++) {
    double own[4][3], sum[4][3] = {{0}};
    for (size_t c = 0; c < columns; c++)
      for (size_t d = 0; d < 3; d++) own[c][d] = x[3 * j + d + c * ld];
    for (int64_t at = a->start[j]; at < a->start[j + 1]; at++) {
      size_t i = (size_t)a->row[at];
      double v = a->value[at], w = i == j ? 0 : v;
      const double *xi = x + 3 * i;
      double *yi = y + 3 * i;
      for (size_t c = 0; c < columns; c++, xi += ld, yi += ld) {
        for (size_t d = 0; d < 3; d++) sum[c][d] += v * xi[d];
        for (size_t d = 0; d < 3; d++) yi[d] += w * own[c][d];
      }
    }
    for (size_t c = 0; c < columns; c++)
      for (size_t d = 0; d < 3; d++) y[3 * j + d + c * ld] += sum[c][d];
  }
}

void pb_sparse_multiply_triple(const pb_sparse *a, size_t columns, const double *x, double *y) {
  size_t ld = 3 * a->n;
  memset(y, 0, ld * columns * sizeof *y);
  for (; columns >= 4; columns -= 4, x += 4 * ld, y += 4 * ld) multiply_triple(a, 4, x, y);
  for (; columns; columns--, x += ld, y += ld) multiply_triple(a, 1, x, y);
}
