// A matrix while it is read: see matrix_build.h.
#include "part/matrix_build.h"

#include <ctype.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

static bool grow(void *field, size_t count, size_t size) {
  void **array = field;
  void *larger = realloc(*array, count * size);
  if (larger) *array = larger;
  return larger != NULL;
}

pb_status pb_matrix_build_reserve(pb_matrix_build *b, size_t count, pb_error *err) {
  pb_matrix_file *f = b->file;
  if (count <= b->capacity) return PB_OK;
  if (count > SIZE_MAX / 64 || !grow(&f->row, count, sizeof *f->row) ||
      !grow(&f->col, count, sizeof *f->col) || !grow(&f->value, count, sizeof *f->value))
    return pb_fail_memory(err, "matrix entries");
  b->capacity = count;
  return PB_OK;
}

static size_t label_hash(pb_row_label label) {
  uint64_t h = (uint64_t)label.node * 8 + (uint64_t)label.direction;
  h *= UINT64_C(0x9E3779B97F4A7C15);
  return (size_t)(h >> 20);
}

static bool same_label(pb_row_label a, pb_row_label b) {
  return a.node == b.node && a.direction == b.direction;
}

// The slot that holds the label, or the empty one where it belongs.
static size_t *find_slot(const pb_matrix_build *b, pb_row_label label) {
  size_t mask = b->slots - 1, at = label_hash(label) & mask;
  while (b->slot[at] && !same_label(b->file->label[b->slot[at] - 1], label)) at = (at + 1) & mask;
  return &b->slot[at];
}

static pb_status grow_labels(pb_matrix_build *b, pb_error *err) {
  size_t capacity = b->label_capacity ? 2 * b->label_capacity : 256;
  size_t *slot = calloc(4 * capacity, sizeof *slot);
  if (!slot || !grow(&b->file->label, capacity, sizeof *b->file->label)) {
    free(slot);
    return pb_fail_memory(err, "matrix rows");
  }
  free(b->slot);
  b->slot = slot;
  b->slots = 4 * capacity;
  b->label_capacity = capacity;
  for (size_t i = 0; i < b->file->rows; i++) *find_slot(b, b->file->label[i]) = i + 1;
  return PB_OK;
}

pb_status pb_matrix_build_label(pb_matrix_build *b, pb_row_label label, int64_t *row,
                                pb_error *err) {
  if (b->file->rows == b->label_capacity) {
    pb_status st = grow_labels(b, err);
    if (st) return st;
  }
  size_t *slot = find_slot(b, label);
  if (!*slot) {
    b->file->label[b->file->rows++] = label;
    *slot = b->file->rows;
  }
  *row = (int64_t)*slot - 1;
  return PB_OK;
}

typedef struct placed_label {
  pb_row_label label;
  size_t from;
} placed_label;

static int label_order(const void *a, const void *b) {
  const pb_row_label *x = &((const placed_label *)a)->label, *y = &((const placed_label *)b)->label;
  int modal = !x->direction - !y->direction;
  if (modal) return modal;
  if (x->node != y->node) return x->node < y->node ? -1 : 1;
  return x->direction - y->direction;
}

pb_status pb_matrix_build_sort(pb_matrix_build *b, pb_error *err) {
  pb_matrix_file *f = b->file;
  f->cols = f->rows;
  if (!f->rows) return PB_OK;
  placed_label *placed = malloc(f->rows * sizeof *placed);
  int64_t *to = malloc(f->rows * sizeof *to);
  pb_status st = placed && to ? PB_OK : pb_fail_memory(err, "matrix rows");
  if (!st) {
    for (size_t i = 0; i < f->rows; i++) placed[i] = (placed_label){f->label[i], i};
    qsort(placed, f->rows, sizeof *placed, label_order);
    for (size_t i = 0; i < f->rows; i++) {
      f->label[i] = placed[i].label;
      to[placed[i].from] = (int64_t)i;
    }
    for (size_t k = 0; k < f->count; k++) {
      f->row[k] = to[f->row[k]];
      f->col[k] = to[f->col[k]];
    }
  }
  free(placed);
  free(to);
  return st;
}

// ---- triangles ----------------------------------------------------------------------------------

static int key_order(const void *a, const void *b) {
  uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
  return (x > y) - (x < y);
}

// Whether a place off the diagonal is there twice, mirrored or not.
static pb_status find_twins(const pb_matrix_file *f, bool *twins, pb_error *err) {
  uint64_t *key = malloc((f->count + 1) * sizeof *key);
  if (!key) return pb_fail_memory(err, "matrix entries");
  size_t n = 0;
  for (size_t k = 0; k < f->count; k++) {
    uint64_t i = (uint64_t)f->row[k], j = (uint64_t)f->col[k];
    if (i != j) key[n++] = i < j ? i << 32 | j : j << 32 | i;
  }
  qsort(key, n, sizeof *key, key_order);
  *twins = false;
  for (size_t k = 1; k < n; k++) *twins |= key[k] == key[k - 1];
  free(key);
  return PB_OK;
}

pb_status pb_matrix_build_judge_half(pb_matrix_build *b, pb_error *err) {
  pb_matrix_file *f = b->file;
  bool upper = false, lower = false, twins = false;
  for (size_t k = 0; k < f->count; k++) {
    upper |= f->row[k] < f->col[k];
    lower |= f->row[k] > f->col[k];
  }
  f->half = upper != lower;
  if (!upper || !lower || f->rows > UINT32_MAX) return PB_OK;
  pb_status st = find_twins(f, &twins, err);
  if (st || twins) return st;
  f->half = true;
  for (size_t k = 0; k < f->count; k++) {
    if (f->row[k] <= f->col[k]) continue;
    int64_t row = f->row[k];
    f->row[k] = f->col[k];
    f->col[k] = row;
  }
  return PB_OK;
}

// ---- several matrices ---------------------------------------------------------------------------

pb_status pb_matrix_build_section(pb_matrix_build *b, pb_lines *in, const char *name) {
  if (b->sections == PB_SECTIONS)
    return pb_lines_fail(in, "more than %d matrices in one file", PB_SECTIONS);
  for (size_t k = 0; k < b->sections; k++)
    if (!strcasecmp(b->section[k].name, name))
      return pb_lines_fail(in, "a second matrix with the name '%s'", name);
  pb_matrix_section *s = &b->section[b->sections++];
  *s = (pb_matrix_section){.begin = b->file->count};
  snprintf(s->name, sizeof s->name, "%s", name);
  return PB_OK;
}

// 'K', 'M' or 0 by the names that programs and people give: STIFFNESS, MAT_K, MATK, KAAX …
static char meaning(const char *name) {
  if (strcasestr(name, "STIF")) return 'K';
  if (strcasestr(name, "MASS")) return 'M';
  if (strcasestr(name, "DAMP")) return 0;
  if (!strcasecmp(name, "MATK")) return 'K';
  const char *suffix = strrchr(name, '_');
  char letter =
      (char)toupper((unsigned char)(suffix && suffix[1] && !suffix[2] ? suffix[1] : name[0]));
  return letter == 'K' || letter == 'M' ? letter : 0;
}

static bool fits(const pb_matrix_section *s, const char *name) {
  if (!strcasecmp(s->name, name)) return true;
  bool letter = !strcasecmp(name, "K") || !strcasecmp(name, "M");
  return letter && meaning(s->name) == toupper((unsigned char)name[0]);
}

static pb_status not_found(const pb_matrix_build *b, const char *path, const char *name,
                           size_t matches, pb_error *err) {
  char list[256] = "";
  for (size_t k = 0, at = 0; k < b->sections && at < sizeof list; k++)
    at += (size_t)snprintf(list + at, sizeof list - at, "%s%s", k ? ", " : "", b->section[k].name);
  if (!b->sections) return pb_fail(err, PB_ERR_SYNTAX, path, "holds no matrix");
  return pb_fail(err, PB_ERR_SYNTAX, path, "%s of its matrices (%s) %s %s",
                 matches ? "more than one" : "none", list, matches > 1 ? "are" : "is",
                 name ? name : "asked for: name one");
}

pb_status pb_matrix_build_choose(pb_matrix_build *b, const char *path, const char *name,
                                 pb_matrix_section *chosen, pb_error *err) {
  size_t matches = 0, found = 0;
  for (size_t k = 0; k < b->sections; k++) {
    bool only = b->sections == 1 && (!name || !meaning(b->section[k].name));
    if (!only && !(name && fits(&b->section[k], name))) continue;
    matches++;
    found = k;
  }
  if (matches != 1) return not_found(b, path, name, matches, err);
  pb_matrix_file *f = b->file;
  size_t begin = b->section[found].begin;
  size_t end = found + 1 < b->sections ? b->section[found + 1].begin : f->count;
  f->count = end - begin;
  if (f->count) {
    memmove(f->row, f->row + begin, f->count * sizeof *f->row);
    memmove(f->col, f->col + begin, f->count * sizeof *f->col);
    memmove(f->value, f->value + begin, f->count * sizeof *f->value);
  }
  if (chosen) *chosen = b->section[found];
  return PB_OK;
}

void pb_matrix_build_end(pb_matrix_build *b) {
  free(b->slot);
  b->slot = NULL;
}
