// Elements as other programs write them: see outside.h.
#include "support/outside.h"

#include <matio.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/beam.h"

enum { N = OUTSIDE_SIZE, FRAMES = OUTSIDE_FRAMES };

static const long node_of[FRAMES] = {101, 205, 300};

double outside_entry(const double *x, size_t i, size_t j) {
  return x[i + j * N];
}

void outside_make(outside_element *e) {
  static const beam steel = {.length = 0.1,
                             .ea = 20317431.7,
                             .ei = 51.2837163,
                             .gj = 40.713371,
                             .mass = 0.08,
                             .polar_inertia = 2.0371e-6};
  double k[18 * 18], m[18 * 18];
  memset(e, 0, sizeof *e);
  beam_chain(&steel, 2, k, m, e->position);
  for (int i = 0; i < FRAMES; i++) e->node[i] = node_of[i];
  for (size_t j = 0; j < 18; j++) {
    for (size_t i = 0; i < 18; i++) {
      e->k[i + j * N] = k[i + j * 18];
      e->m[i + j * N] = m[i + j * 18];
    }
  }
  for (size_t p = 18; p < N; p++) {
    e->k[p + p * N] = 4e8 * (double)(p - 16);
    e->m[p + p * N] = 1;
    for (size_t i = 0; i < 18; i++)
      if (i % 6 == p - 17) e->m[i + p * N] = e->m[p + i * N] = 1e-3 * (double)(1 + i / 6);
  }
}

static FILE *open_file(const char *path) {
  FILE *f = fopen(path, "w");
  if (!f) abort();
  return f;
}

static long label_node(size_t i) {
  return i < 6 * FRAMES ? node_of[i / 6] : 9001 + (long)(i - 6 * FRAMES);
}

// ---- Matrix Market ------------------------------------------------------------------------------

static int entries(const double *x, int half) {
  int count = 0;
  for (size_t j = 0; j < N; j++)
    for (size_t i = half ? j : 0; i < N; i++) count += outside_entry(x, i, j) != 0;
  return count;
}

static void market(const char *path, const double *x, int half, const char *comment) {
  FILE *f = open_file(path);
  fprintf(f, "%%%%MatrixMarket matrix coordinate real %s\n%s", half ? "symmetric" : "general",
          comment);
  fprintf(f, "%d %d %d\n", N, N, entries(x, half));
  for (size_t j = 0; j < N; j++)
    for (size_t i = half ? j : 0; i < N; i++)
      if (outside_entry(x, i, j) != 0)
        fprintf(f, "%zu %zu %.17g\n", i + 1, j + 1, outside_entry(x, i, j));
  fclose(f);
}

static void market_symmetric(const char *path, char which, const double *x) {
  (void)which;
  market(path, x, 1, "% a comment\n");
}

static void market_general(const char *path, char which, const double *x) {
  (void)which;
  market(path, x, 0, "");
}

static void market_mmf(const char *path, char which, const double *x) {
  (void)which;
  market(path, x, 1, "% Written by ANSYS *EXPORT\n");
}

static void market_array(const char *path, char which, const double *x) {
  (void)which;
  FILE *f = open_file(path);
  fprintf(f, "%%%%MatrixMarket matrix array real general\n%d %d\n", N, N);
  for (size_t k = 0; k < (size_t)N * N; k++) fprintf(f, "%.17g\n", x[k]);
  fclose(f);
}

// ---- Ansys *PRINT -------------------------------------------------------------------------------

static void print_matrix(FILE *f, char which, const double *x, const char *format, int dense) {
  fprintf(f, "\nMAT_%c: \n", which);
  for (size_t i = 0; i < N; i++) {
    for (size_t j = 0; j < N; j++) {
      if (!dense && outside_entry(x, i, j) == 0) continue;
      fprintf(f, "[%3zu,%3zu]:", i + 1, j + 1);
      fprintf(f, format, outside_entry(x, i, j));
      fputc(' ', f);
    }
    fputc('\n', f);
  }
}

static void print_dense(const char *path, char which, const double *x) {
  FILE *f = open_file(path);
  print_matrix(f, which, x, "%10.3e", 1);
  fclose(f);
}

static void print_sparse(const char *path, char which, const double *x) {
  FILE *f = open_file(path);
  print_matrix(f, which, x, "%23.16e", 0);
  fclose(f);
}

// ---- CalculiX -----------------------------------------------------------------------------------

static void calculix(const char *path, char which, const double *x) {
  (void)which;
  FILE *f = open_file(path);
  for (size_t j = 0; j < N; j++)
    for (size_t i = 0; i <= j; i++)
      fprintf(f, "%zu %zu %20.13e\n", i + 1, j + 1, outside_entry(x, i, j));
  fclose(f);
  char dof[512];
  snprintf(dof, sizeof dof, "%.*s.dof", (int)(strrchr(path, '.') - path), path);
  f = open_file(dof);
  for (size_t i = 0; i < N; i++)
    fprintf(f, "%ld.%zu\n", label_node(i), i < 6 * FRAMES ? i % 6 + 1 : 1);
  fclose(f);
}

// ---- NASTRAN ------------------------------------------------------------------------------------

static void dmig_header(FILE *f, char which) {
  fprintf(f, "DMIG    %cAAX    %8d%8d%8d%8d%8s%8s%8d\n", which, 0, 6, 2, 0, "", "", N);
}

static int component(size_t i) {
  return i < 6 * FRAMES ? (int)(i % 6) + 1 : 0;
}

static void dmig_large_matrix(FILE *f, char which, const double *x) {
  dmig_header(f, which);
  for (size_t j = 0; j < N; j++) {
    fprintf(f, "DMIG*   %cAAX            %16ld%16d\n", which, label_node(j), component(j));
    for (size_t i = j; i < N; i++) {
      char number[40];
      snprintf(number, sizeof number, "%16.9E", outside_entry(x, i, j));
      char *exponent = strchr(number, 'E');
      if (exponent) *exponent = 'D';
      if (outside_entry(x, i, j) != 0)
        fprintf(f, "*       %16ld%16d%s\n", label_node(i), component(i), number);
    }
  }
}

static void dmig_large(const char *path, char which, const double *x) {
  FILE *f = open_file(path);
  fprintf(f, "$TITLE   = BEAM\n$ a comment\n");
  dmig_large_matrix(f, which, x);
  fclose(f);
}

// Two rows to a continuation, the first one on the column's own line; the exponent has no letter.
static void dmig_small(const char *path, char which, const double *x) {
  FILE *f = open_file(path);
  dmig_header(f, which);
  for (size_t j = 0; j < N; j++) {
    int written = 0;
    fprintf(f, "DMIG    %cAAX    %8ld%8d%8s", which, label_node(j), component(j), "");
    for (size_t i = 0; i <= j; i++) {
      double value = outside_entry(x, i, j);
      if (value == 0 && i != j) continue;
      int power = value != 0 ? (int)floor(log10(fabs(value))) : 0;
      char number[40];
      snprintf(number, sizeof number, "%.3f%+d", value / pow(10, power), power);
      if (written % 2 == 1) fprintf(f, "\n%-8s", "+");
      fprintf(f, "%8ld%8d%8s%8s", label_node(i), component(i), number, "");
      written++;
    }
    fputc('\n', f);
  }
  fprintf(f, "ENDDATA\n");
  fclose(f);
}

static void dmig_free(const char *path, char which, const double *x) {
  FILE *f = open_file(path);
  fprintf(f, "DMIG,%cSYM,0,1,2,0,,,%d\n", which, N);
  for (size_t j = 0; j < N; j++)
    for (size_t i = 0; i < N; i++)
      if (i == 0)
        fprintf(f, "DMIG,%cSYM,%ld,%d,,%ld,%d,%.9e\n", which, label_node(j), component(j),
                label_node(i), component(i), outside_entry(x, i, j));
      else
        fprintf(f, "+,%ld,%d,%.9e\n", label_node(i), component(i), outside_entry(x, i, j));
  fclose(f);
}

// ---- Abaqus -------------------------------------------------------------------------------------

static void abaqus_matrix_input(const char *path, char which, const double *x) {
  (void)which;
  FILE *f = open_file(path);
  for (size_t j = 0; j < N; j++)
    for (size_t i = j; i < N; i++)
      if (outside_entry(x, i, j) != 0 || i == j)
        fprintf(f, "%ld,%d, %ld,%d, %.15e\n", label_node(i), i < 18 ? component(i) : 1,
                label_node(j), j < 18 ? component(j) : 1, outside_entry(x, i, j));
  fclose(f);
}

static void abaqus_coordinate(const char *path, char which, const double *x) {
  (void)which;
  FILE *f = open_file(path);
  for (size_t i = 0; i < N; i++)
    for (size_t j = 0; j < N; j++)
      if (outside_entry(x, i, j) != 0)
        fprintf(f, "%zu  %zu  %.15e\n", i + 1, j + 1, outside_entry(x, i, j));
  fclose(f);
}

static void user_head(FILE *f) {
  fprintf(f, "**\n** SUBSTRUCTURE GENERATED\n*USER ELEMENT, NODES=        %d, LINEAR\n",
          FRAMES + 2);
  fprintf(f, "** ELEMENT NODES\n** %ld, %ld, %ld,\n** 9001, 9002\n", node_of[0], node_of[1],
          node_of[2]);
  fprintf(f, "1, 2, 3, 4, 5, 6\n%d, 1\n", FRAMES + 1);
}

static void user_matrix(FILE *f, char which, const double *x) {
  fprintf(f, "*MATRIX,TYPE=%s\n", which == 'K' ? "STIFFNESS" : "MASS");
  for (size_t i = 0; i < N; i++)
    for (size_t j = 0; j <= i; j++)
      fprintf(f, "%20.13e%s", outside_entry(x, i, j), j == i || j % 4 == 3 ? ",\n" : ", ");
}

static void abaqus_user(const char *path, char which, const double *x) {
  FILE *f = open_file(path);
  user_head(f);
  user_matrix(f, which, x);
  fclose(f);
}

// ---- CSV and MAT --------------------------------------------------------------------------------

static void csv(const char *path, char which, const double *x) {
  (void)which;
  FILE *f = open_file(path);
  for (size_t i = 0; i < N; i++)
    for (size_t j = 0; j < N; j++)
      fprintf(f, "%.17g%s", outside_entry(x, i, j), j == N - 1 ? "\r\n" : ",");
  fclose(f);
}

static void mat(const char *path, char which, const double *x) {
  mat_t *file = Mat_CreateVer(path, NULL, MAT_FT_MAT5);
  if (!file) abort();
  size_t dims[2] = {N, N};
  char name[2] = {which, 0};
  matvar_t *v = Mat_VarCreate(name, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, (void *)x, 0);
  Mat_VarWrite(file, v, MAT_COMPRESSION_NONE);
  Mat_VarFree(v);
  Mat_Close(file);
}

const outside_form outside_forms[] = {
    {"market-symmetric.mtx", market_symmetric, 0, 0, 1, "Matrix Market"},
    {"market-general.mtx", market_general, 0, 0, 1, "Matrix Market"},
    {"market-array.mtx", market_array, 0, 0, 1, "Matrix Market"},
    {"mmf.txt", market_mmf, 0, 0, 1, "Ansys MMF"},
    {"print.txt", print_dense, 5.1e-4, 0, 1, "Ansys *PRINT"},
    {"print-sparse.txt", print_sparse, 1e-15, 0, 0, "Ansys *PRINT"},
    {"calculix.sti", calculix, 1e-13, 1, 1, "CalculiX"},
    {"dmig-large.pch", dmig_large, 1e-9, 1, 1, "NASTRAN DMIG"},
    {"dmig-small.pch", dmig_small, 5.1e-4, 1, 1, "NASTRAN DMIG"},
    {"dmig-free.pch", dmig_free, 1e-9, 1, 1, "NASTRAN DMIG"},
    {"abaqus-input.mtx", abaqus_matrix_input, 1e-14, 1, 0, "Abaqus .mtx"},
    {"abaqus-coordinate.mtx", abaqus_coordinate, 1e-14, 0, 0, "Abaqus .mtx"},
    {"abaqus-user.mtx", abaqus_user, 1e-13, 1, 1, "Abaqus .mtx"},
    {"table.csv", csv, 0, 0, 1, "CSV"},
    {"array.mat", mat, 0, 0, 1, "MAT v5"},
    {NULL, NULL, 0, 0, 0, NULL},
};

int outside_write_both(const char *form, const char *path, const outside_element *e) {
  int known = 1;
  FILE *f = open_file(path);
  if (!strcmp(form, "print")) {
    print_matrix(f, 'K', e->k, "%23.16e", 1);
    print_matrix(f, 'M', e->m, "%23.16e", 1);
  } else if (!strcmp(form, "dmig-large")) {
    dmig_large_matrix(f, 'K', e->k);
    dmig_large_matrix(f, 'M', e->m);
  } else if (!strcmp(form, "abaqus-user-element")) {
    user_head(f);
    user_matrix(f, 'K', e->k);
    user_matrix(f, 'M', e->m);
  } else {
    known = 0;
  }
  fclose(f);
  return known ? 0 : -1;
}

// ---- Ansys listings -----------------------------------------------------------------------------

static void banner(FILE *f) {
  fprintf(f, "\n *** ANSYS - ENGINEERING ANALYSIS SYSTEM  RELEASE 2019 R3          19.5     ***\n"
             " DISTRIBUTED ANSYS Academic Research\n\n"
             " 00208316  VERSION=WINDOWS x64   14:40:51  JUN 10, 2020 CP=      0.469\n\n"
             " Beam 1 of 3 -- Modal (B5)\n\n\n\n");
}

static void list_masters(FILE *f, const outside_element *e, int page) {
  static const char *const name[] = {"UX", "UY", "UZ", "ROTX", "ROTY", "ROTZ"};
  fprintf(f, "\n LIST MASTERS ON ALL SELECTED NODES.\n"
             " CURRENT DOF SET= UX   UY   UZ   ROTX ROTY ROTZ\n");
  for (int r = 0; r < 6 * FRAMES; r++) {
    if (r % page == 0) {
      banner(f);
      fprintf(f, "  NODE DOF\n");
    }
    fprintf(f, "%8ld %-4s\n", e->node[r / 6], name[r % 6]);
  }
}

void outside_write_listing(const char *path, const outside_element *e, int page, int angles,
                           int masters) {
  FILE *f = open_file(path);
  if (masters < 0) list_masters(f, e, page);
  fprintf(f, "\n LIST ALL SELECTED NODES.   DSYS=      0\n");
  for (int r = 0; r < 2 * FRAMES; r++) {  // each second one is no master
    if (r % page == 0) {
      banner(f);
      fprintf(
          f,
          angles
              ? "    NODE        X             Y             Z           THXY     THYZ     THZX\n"
              : "   NODE        X                   Y                   Z\n");
    }
    const double *p = e->position + 3 * (r / 2);
    long number = r % 2 ? e->node[r / 2] + 1 : e->node[r / 2];
    double shift = r % 2 ? 0.5 : 0;
    if (angles)
      fprintf(f, "%9ld %13.5E %13.5E %13.5E     0.00     0.00     0.00\n", number, p[0] + shift,
              p[1], p[2]);
    else
      fprintf(f, "%9ld    %-20.12G%-20.12G%-20.12G\n", number, p[0] + shift, p[1], p[2]);
  }
  fprintf(f, "\n /OUTPUT FILE= TEMP\n");
  if (masters > 0) list_masters(f, e, page);
  fclose(f);
}
