// An element as MAT v5 and as Matrix Market files: see element_out.h.
#include "element_out.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "matfile.h"
#include "outfile.h"

static const char units[] = "SI: m, rad, N, N m, kg, kg m^2, s; frames ux uy uz rx ry rz each in "
                            "part axes, then modes (mass-normalised)";

bool pb_element_format_parse(const char *text, pb_element_format *out) {
  bool mat = !strcmp(text, "mat"), market = !strcmp(text, "mtx");
  if (mat || market) *out = mat ? PB_ELEMENT_MAT5 : PB_ELEMENT_MATRIX_MARKET;
  return mat || market;
}

// ---- names --------------------------------------------------------------------------------------

// One allocation each; the arrays of pointers are what the MAT writer takes.
typedef struct names {
  char **frame, **dof;  // [frames], [size]
} names;

static void free_names(names *list, const pb_element_out *e) {
  for (size_t i = 0; list->frame && i < e->frames; i++) free(list->frame[i]);
  for (size_t i = 0; list->dof && i < e->size; i++) free(list->dof[i]);
  free(list->frame);
  free(list->dof);
}

static char *format_dof(const pb_element_out *e, char *const *frame, size_t i) {
  static const char *const direction[6] = {"ux", "uy", "uz", "rx", "ry", "rz"};
  pb_text text = {0};
  if (i < 6 * e->frames) {
    pb_text_format(&text, "%s.%s", frame[i / 6], direction[i % 6]);
  } else {
    pb_text_format(&text, "mode %zu", i - 6 * e->frames + 1);
  }
  return text.text;
}

static pb_status make_names(const pb_element_out *e, names *list, pb_error *err) {
  *list = (names){calloc(e->frames + 1, sizeof(char *)), calloc(e->size + 1, sizeof(char *))};
  bool ok = list->frame && list->dof;
  for (size_t i = 0; ok && i < e->frames; i++) {
    char number[24];
    snprintf(number, sizeof number, "%zu", i + 1);
    list->frame[i] = pb_text_copy(e->frame_name ? e->frame_name[i] : number);
    ok = list->frame[i] != NULL;
  }
  for (size_t i = 0; ok && i < e->size; i++) {
    list->dof[i] = format_dof(e, list->frame, i);
    ok = list->dof[i] != NULL;
  }
  return ok ? PB_OK : pb_fail_memory(err, e->name);
}

// ---- MAT v5 -------------------------------------------------------------------------------------

static pb_status write_mat(const pb_element_out *e, const names *list, const char *path,
                           pb_error *err) {
  pb_matfile *mat = NULL;
  double *xyz = malloc(4 * (e->frames + 1) * sizeof *xyz);
  if (!xyz) return pb_fail_memory(err, path);
  double *number = xyz + 3 * e->frames;
  for (size_t i = 0; i < e->frames; i++) {
    for (size_t a = 0; a < 3; a++) xyz[i + a * e->frames] = e->position[a + 3 * i];
    number[i] = (double)(i + 1);
  }
  pb_status st = pb_matfile_open(path, &mat, err);
  if (!st) {
    pb_matfile_real(mat, "K", e->size, e->size, e->k);
    pb_matfile_real(mat, "M", e->size, e->size, e->m);
    pb_matfile_real(mat, "int_xyz", e->frames, 3, xyz);
    pb_matfile_real(mat, "int_i", e->frames, 1, number);
    pb_matfile_names(mat, "int_name", (const char *const *)list->frame, e->frames);
    pb_matfile_names(mat, "dof_name", (const char *const *)list->dof, e->size);
    if (e->fixed_hz) pb_matfile_real(mat, "fixed_hz", e->size - 6 * e->frames, 1, e->fixed_hz);
    pb_matfile_text(mat, "name", e->name);
    pb_matfile_text(mat, "units", units);
    pb_matfile_text(mat, "provenance", e->provenance ? e->provenance : "");
    st = pb_matfile_close(mat, err);
  }
  free(xyz);
  return st;
}

// ---- Matrix Market ------------------------------------------------------------------------------

enum { MARKET_FILES = 3 };

static const char *const market_name[MARKET_FILES] = {"K", "M", "int_xyz"};

// Lines of text as comments.
static void print_comment(FILE *f, const char *label, const char *text) {
  fprintf(f, "%% %s: ", label);
  for (; *text; text++) {
    fputc(*text, f);
    if (*text == '\n' && text[1]) fputs("%   ", f);
  }
  fputc('\n', f);
}

static void print_comments(FILE *f, const pb_element_out *e, const names *list, const char *what) {
  print_comment(f, "element", e->name);
  print_comment(f, "matrix", what);
  print_comment(f, "units", units);
  for (size_t i = 0; i < e->frames; i++) print_comment(f, "frame", list->frame[i]);
  if (e->provenance && e->provenance[0]) print_comment(f, "provenance", e->provenance);
}

static void print_symmetric(FILE *f, const double *x, size_t n) {
  size_t entries = 0;
  for (size_t j = 0; j < n; j++)
    for (size_t i = j; i < n; i++) entries += x[i + j * n] != 0;
  fprintf(f, "%zu %zu %zu\n", n, n, entries);
  for (size_t j = 0; j < n; j++) {
    for (size_t i = j; i < n; i++) {
      char number[32];
      if (x[i + j * n] == 0) continue;
      pb_text_number(number, sizeof number, x[i + j * n]);
      fprintf(f, "%zu %zu %s\n", i + 1, j + 1, number);
    }
  }
}

static void print_positions(FILE *f, const pb_element_out *e) {
  fprintf(f, "%zu 3\n", e->frames);
  for (size_t a = 0; a < 3; a++) {
    for (size_t i = 0; i < e->frames; i++) {
      char number[32];
      pb_text_number(number, sizeof number, e->position[a + 3 * i]);
      fprintf(f, "%s\n", number);
    }
  }
}

static pb_status write_market_file(const pb_element_out *e, const names *list, size_t which,
                                   const pb_outfile *out, pb_error *err) {
  FILE *f = fopen(out->temp, "w");
  if (!f) return pb_fail(err, PB_ERR_IO, out->path, "cannot be written: %m");
  bool array = which == 2;
  fprintf(f, "%%%%MatrixMarket matrix %s\n",
          array ? "array real general" : "coordinate real symmetric");
  print_comments(f, e, list, market_name[which]);
  if (array) {
    print_positions(f, e);
  } else {
    print_symmetric(f, which ? e->m : e->k, e->size);
  }
  bool failed = ferror(f);
  failed |= fclose(f) != 0;
  return failed ? pb_fail(err, PB_ERR_IO, out->path, "cannot be written: is the disk full?")
                : PB_OK;
}

// All three are complete before the first gets its name.
static pb_status write_market(const pb_element_out *e, const names *list, const char *path,
                              pb_error *err) {
  pb_outfile out[MARKET_FILES] = {{0}};
  size_t length = strlen(path), stem = length;
  if (length > 4 && !strcmp(path + length - 4, ".mtx")) stem -= 4;
  pb_status st = PB_OK;
  for (size_t i = 0; !st && i < MARKET_FILES; i++) {
    pb_text name = {0};
    pb_text_append_n(&name, path, stem);
    pb_text_format(&name, ".%s.mtx", market_name[i]);
    st = name.failed ? pb_fail_memory(err, path) : pb_outfile_create(name.text, &out[i], err);
    if (!st) st = write_market_file(e, list, i, &out[i], err);
    free(name.text);
  }
  for (size_t i = 0; !st && i < MARKET_FILES; i++) st = pb_outfile_commit(&out[i], err);
  for (size_t i = 0; i < MARKET_FILES; i++) pb_outfile_discard(&out[i]);
  return st;
}

pb_status pb_element_write(const pb_element_out *e, const char *path, pb_element_format format,
                           pb_error *err) {
  names list = {0};
  size_t length = strlen(path);
  bool suffix = length > 4 && !strcmp(path + length - 4, ".mtx");
  bool market = format == PB_ELEMENT_MATRIX_MARKET || (format == PB_ELEMENT_BY_SUFFIX && suffix);
  pb_status st = make_names(e, &list, err);
  if (!st) st = market ? write_market(e, &list, path, err) : write_mat(e, &list, path, err);
  free_names(&list, e);
  return st;
}
