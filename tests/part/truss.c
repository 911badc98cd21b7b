// Spring nets and the dense oracle: see truss.h. Everything here is written for being obviously
// right, not fast: full matrices, an SVD for the constraints, no factor shared.
#include "truss.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"
#include "base/text.h"
#include "part/mesh.h"
#include "signal/random.h"

// ---- nets ---------------------------------------------------------------------------------------

typedef struct entries {
  size_t count;
  int64_t *row, *col;
  double *value;
} entries;

static void add(entries *e, size_t i, size_t j, double value) {
  e->row[e->count] = (int64_t)i;
  e->col[e->count] = (int64_t)j;
  e->value[e->count++] = value;
}

static int allocate(entries *e, size_t room) {
  *e = (entries){0, malloc(room * sizeof(int64_t)), malloc(room * sizeof(int64_t)),
                 malloc(room * sizeof(double))};
  return e->row && e->col && e->value ? 0 : -1;
}

static void release(entries *e) {
  free(e->row);
  free(e->col);
  free(e->value);
}

static void add_spring(entries *k, entries *m, const double *xyz, size_t i, size_t j, bool scalar,
                       double stiffness) {
  double n[3], length = 0;
  for (size_t a = 0; a < 3; a++) n[a] = xyz[a + 3 * j] - xyz[a + 3 * i];
  length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  for (size_t a = 0; a < 3; a++) {
    for (size_t b = 0; b < 3; b++) {
      double value = stiffness * n[a] * n[b] / (length * length);
      if (b >= a) {
        add(k, 3 * i + a, 3 * i + b, value);
        add(k, 3 * j + a, 3 * j + b, value);
      }
      add(k, 3 * i + a, 3 * j + b, -value);
    }
    double mass = scalar ? 0.01 : 0.01 * (1 + (double)a);  // a consistent bar's: 2 1 1 2
    add(m, 3 * i + a, 3 * i + a, 2 * mass);
    add(m, 3 * j + a, 3 * j + a, 2 * mass);
    add(m, 3 * i + a, 3 * j + a, mass);
  }
}

int truss_build(size_t nodes, double reach, bool scalar, unsigned seed, pb_fem *fem) {
  pb_random random;
  pb_random_seed(&random, seed, 0);
  *fem = (pb_fem){.name = pb_text_copy("truss"), .nodes = nodes};
  fem->xyz = malloc(3 * nodes * sizeof(double));
  fem->dof = malloc(3 * nodes * sizeof(int64_t));
  entries k, m;
  if (allocate(&k, 24 * nodes * nodes) || allocate(&m, 12 * nodes * nodes)) return -1;
  static const double box[3] = {1, 0.4, 0.3};
  for (size_t i = 0; i < 3 * nodes; i++) {
    fem->xyz[i] = box[i % 3] * pb_random_uniform(&random);
    fem->dof[i] = (int64_t)i;
  }
  for (size_t i = 0; i < nodes; i++) {
    for (size_t j = i + 1; j < nodes; j++) {
      double sum = 0;
      for (size_t a = 0; a < 3; a++) sum += pow(fem->xyz[a + 3 * i] - fem->xyz[a + 3 * j], 2);
      if (sum < reach * reach)
        add_spring(&k, &m, fem->xyz, i, j, scalar, 1e6 * (1 + pb_random_uniform(&random)));
    }
  }
  pb_error err;
  int failed = pb_sparse_from_entries(3 * nodes, k.count, k.row, k.col, k.value, &fem->k, &err) ||
               pb_sparse_from_entries(3 * nodes, m.count, m.row, m.col, m.value, &fem->m, &err);
  release(&k);
  release(&m);
  return failed;
}

// The net with more nodes: old entries first, `nodes` with three rows each.
static int grow(pb_fem *fem, size_t nodes, entries *k, entries *m, size_t room) {
  size_t old = fem->nodes;
  double *xyz = realloc(fem->xyz, 3 * nodes * sizeof *xyz);
  if (xyz) fem->xyz = xyz;
  int64_t *dof = realloc(fem->dof, 3 * nodes * sizeof *dof);
  if (dof) fem->dof = dof;
  size_t kept = (size_t)(fem->k.start[fem->k.n] + fem->m.start[fem->m.n]);
  if (!xyz || !dof || allocate(k, kept + room) || allocate(m, kept + room)) return -1;
  for (size_t i = 3 * old; i < 3 * nodes; i++) fem->dof[i] = (int64_t)i;
  for (size_t j = 0; j < fem->k.n; j++) {
    for (int64_t at = fem->k.start[j]; at < fem->k.start[j + 1]; at++)
      add(k, (size_t)fem->k.row[at], j, fem->k.value[at]);
    for (int64_t at = fem->m.start[j]; at < fem->m.start[j + 1]; at++)
      add(m, (size_t)fem->m.row[at], j, fem->m.value[at]);
  }
  fem->nodes = nodes;
  return 0;
}

static int rebuild(pb_fem *fem, entries *k, entries *m) {
  pb_error err;
  pb_sparse_clear(&fem->k);
  pb_sparse_clear(&fem->m);
  size_t n = 3 * fem->nodes;
  int failed = pb_sparse_from_entries(n, k->count, k->row, k->col, k->value, &fem->k, &err) ||
               pb_sparse_from_entries(n, m->count, m->row, m->col, m->value, &fem->m, &err);
  release(k);
  release(m);
  return failed;
}

int truss_hang(pb_fem *fem, size_t count, size_t node, double stiffness, double mass) {
  entries k, m;
  size_t old = fem->nodes;
  if (grow(fem, old + count, &k, &m, 9 * count)) return -1;
  for (size_t i = old; i < old + count; i++) {
    for (size_t a = 0; a < 3; a++) {
      // At the same place, so that a rigid motion stretches no spring.
      fem->xyz[a + 3 * i] = fem->xyz[a + 3 * node];
      add(&k, 3 * node + a, 3 * node + a, stiffness);
      add(&k, 3 * node + a, 3 * i + a, -stiffness);
      add(&k, 3 * i + a, 3 * i + a, stiffness);
      add(&m, 3 * i + a, 3 * i + a, mass);
    }
  }
  return rebuild(fem, &k, &m);
}

int truss_couple(pb_fem *fem, size_t i, size_t j, double mass) {
  entries k, m;
  if (grow(fem, fem->nodes, &k, &m, 9)) return -1;
  for (size_t a = 0; a < 3; a++) {
    add(&m, 3 * i + a, 3 * i + a, mass);
    add(&m, 3 * j + a, 3 * j + a, mass);
    add(&m, 3 * i + a, 3 * j + a, mass / 2);
  }
  return rebuild(fem, &k, &m);
}

int truss_swing(pb_fem *fem) {
  entries k, m;
  size_t i = fem->nodes;
  if (grow(fem, i + 1, &k, &m, 64)) return -1;
  static const double off[3] = {0.05, 0.03, 0.02};
  for (size_t a = 0; a < 3; a++) fem->xyz[a + 3 * i] = fem->xyz[a] + off[a];
  add_spring(&k, &m, fem->xyz, 0, i, true, 1e6);
  return rebuild(fem, &k, &m);
}

int truss_twin(pb_fem *fem) {
  entries k, m;
  size_t old = fem->nodes, count_k = 0, count_m = 0;
  if (grow(fem, 2 * old, &k, &m, (size_t)(fem->k.start[fem->k.n] + fem->m.start[fem->m.n])))
    return -1;
  memcpy(fem->xyz + 3 * old, fem->xyz, 3 * old * sizeof *fem->xyz);
  count_k = k.count;
  count_m = m.count;
  for (size_t e = 0; e < count_k; e++)
    add(&k, (size_t)k.row[e] + 3 * old, (size_t)k.col[e] + 3 * old, k.value[e]);
  for (size_t e = 0; e < count_m; e++)
    add(&m, (size_t)m.row[e] + 3 * old, (size_t)m.col[e] + 3 * old, m.value[e]);
  return rebuild(fem, &k, &m);
}

// ---- bar ----------------------------------------------------------------------------------------

typedef struct bar {
  const pb_section *section;
  double length;
  size_t layers;
} bar;

static void place_bar(const void *context, size_t node, size_t half_level, double xyz[3]) {
  const bar *b = context;
  xyz[0] = b->length * (double)half_level / (double)(2 * b->layers);
  xyz[1] = b->section->at[node].x;
  xyz[2] = b->section->at[node].y;
}

static int bar_region(const void *context, size_t quad, size_t layer) {
  (void)context;
  (void)quad;
  (void)layer;
  return 0;
}

int bar_build(double length, double side, size_t along, size_t across, pb_fem *fem) {
  static const pb_material material = {200e9, 0, 7800};
  pb_error err;
  double h = side / 2;
  pb_section section = {.tolerance = 1e-9};
  pb_block block = {.corner = {{-h, -h}, {h, -h}, {h, h}, {-h, h}}, .cells = {across, across}};
  bar b = {&section, length, along};
  pb_extrusion extrusion = {along, place_bar, bar_region, &b};
  pb_mesh mesh = {0};
  *fem = (pb_fem){0};
  int failed = pb_section_add(&section, &block, false, false, &err) ||
               pb_mesh_extrude(&section, &extrusion, &mesh, &err) ||
               pb_mesh_assemble(&mesh, 1, &material, fem, &err);
  pb_section_clear(&section);
  pb_mesh_clear(&mesh);
  if (!failed && !fem->name) fem->name = pb_text_copy("bar");
  return failed;
}

// ---- frames -------------------------------------------------------------------------------------

void truss_drop_frame(pb_fem *fem) {
  pb_fem_frame *frame = &fem->frame[--fem->frames];
  free(frame->name);
  free(frame->node);
  free(frame->moment);
}

int truss_frame_of(pb_fem *fem, const char *name, pb_frame_tie tie, const double origin[3],
                   const size_t *node, size_t nodes, const double *weight) {
  pb_fem_frame *more = realloc(fem->frame, (fem->frames + 1) * sizeof *more);
  if (!more) return -1;
  fem->frame = more;
  pb_fem_frame *frame = &fem->frame[fem->frames++];
  *frame = (pb_fem_frame){.name = pb_text_copy(name), .tie = tie, .nodes = nodes};
  memcpy(frame->origin, origin, sizeof frame->origin);
  frame->node = malloc((nodes + 1) * sizeof *frame->node);
  if (!frame->node) return -1;
  memcpy(frame->node, node, nodes * sizeof *node);
  pb_error err;
  return (int)pb_fem_frame_weights(fem, frame, weight, &err);
}

int truss_frame(pb_fem *fem, const char *name, pb_frame_tie tie, size_t axis, double lo,
                double hi) {
  size_t *node = malloc(fem->nodes * sizeof *node), nodes = 0;
  double origin[3] = {0};
  for (size_t i = 0; node && i < fem->nodes; i++) {
    if (fem->xyz[axis + 3 * i] < lo || fem->xyz[axis + 3 * i] > hi) continue;
    node[nodes++] = i;
    for (size_t a = 0; a < 3; a++) origin[a] += fem->xyz[a + 3 * i];
  }
  for (size_t a = 0; a < 3; a++) origin[a] = origin[a] / (double)(nodes ? nodes : 1) + 0.01;
  int failed = node ? truss_frame_of(fem, name, tie, origin, node, nodes, NULL) : -1;
  free(node);
  return failed;
}

// ---- dense Craig–Bampton ------------------------------------------------------------------------

static double *dense_matrix(const pb_sparse *a) {
  double *out = calloc(a->n * a->n, sizeof *out);
  for (size_t j = 0; out && j < a->n; j++)
    for (int64_t at = a->start[j]; at < a->start[j + 1]; at++)
      out[(size_t)a->row[at] + j * a->n] = out[j + (size_t)a->row[at] * a->n] = a->value[at];
  return out;
}

static void multiply(const char *ta, const char *tb, size_t m, size_t n, size_t k, const double *a,
                     size_t lda, const double *b, size_t ldb, double *c, size_t ldc) {
  int im = (int)m, in = (int)n, ik = (int)k, ia = (int)lda, ib = (int)ldb, ic = (int)ldc;
  double one = 1, zero = 0;
  dgemm_(ta, tb, &im, &in, &ik, &one, a, &ia, b, &ib, &zero, c, &ic);
}

// u = v + ω × x as a 3 × 6 array.
static void motions(const double x[3], double r[3][6]) {
  double all[3][6] = {
      {1, 0, 0, 0, x[2], -x[1]}, {0, 1, 0, -x[2], 0, x[0]}, {0, 0, 1, x[1], -x[0], 0}};
  memcpy(r, all, sizeof all);
}

// Constraints E u = F q, dense: six rows of averages for an averaged frame, three rows a node for a
// rigid one.
typedef struct constraints {
  size_t n, rows, b;
  double *e, *f;  // rows × n, rows × b
} constraints;

static void constrain_average(const pb_fem *fem, size_t f, constraints *c) {
  const pb_fem_frame *frame = &fem->frame[f];
  double g[36] = {0};
  int six = 6, n = (int)c->n, pivot[6], info;
  double *rows = calloc(6 * c->n, sizeof *rows);
  if (!rows) return;
  for (size_t i = 0; i < frame->nodes; i++) {
    double x[3], r[3][6], weight = frame->moment[4 * i];
    for (size_t a = 0; a < 3; a++) x[a] = fem->xyz[a + 3 * frame->node[i]] - frame->origin[a];
    motions(x, r);
    for (size_t a = 0; a < 3; a++) {
      for (size_t p = 0; p < 6; p++) {
        rows[p + 6 * (size_t)fem->dof[a + 3 * frame->node[i]]] = weight * r[a][p];
        for (size_t q = 0; q < 6; q++) g[p + 6 * q] += weight * r[a][p] * r[a][q];
      }
    }
  }
  dgesv_(&six, &n, g, &six, pivot, rows, &six, &info);
  for (size_t p = 0; p < 6; p++) {
    for (size_t j = 0; j < c->n; j++) c->e[c->rows + p + j * 3 * c->n] = rows[p + 6 * j];
    c->f[c->rows + p + (6 * f + p) * 3 * c->n] = 1;
  }
  c->rows += 6;
  free(rows);
}

static void constrain_rigid(const pb_fem *fem, size_t f, constraints *c) {
  const pb_fem_frame *frame = &fem->frame[f];
  for (size_t i = 0; i < frame->nodes; i++) {
    double x[3], r[3][6];
    for (size_t a = 0; a < 3; a++) x[a] = fem->xyz[a + 3 * frame->node[i]] - frame->origin[a];
    motions(x, r);
    for (size_t a = 0; a < 3; a++, c->rows++) {
      c->e[c->rows + (size_t)fem->dof[a + 3 * frame->node[i]] * 3 * c->n] = 1;
      for (size_t p = 0; p < 6; p++) c->f[c->rows + (6 * f + p) * 3 * c->n] = r[a][p];
    }
  }
}

// Rows are allocated 3n of: more than any test uses.
static int constrain(const pb_fem *fem, constraints *c) {
  *c = (constraints){.n = fem->k.n, .b = 6 * fem->frames};
  c->e = calloc(3 * c->n * c->n, sizeof *c->e);
  c->f = calloc(3 * c->n * c->b, sizeof *c->f);
  if (!c->e || !c->f) return -1;
  for (size_t f = 0; f < fem->frames; f++) {
    if (fem->frame[f].tie == PB_TIE_RIGID) {
      constrain_rigid(fem, f, c);
    } else {
      constrain_average(fem, f, c);
    }
  }
  return 0;
}

// u₀ (n × b) with E u₀ = F and a basis Z (n × (n − rows)) of E's null space, from E = U S Vᵀ.
static int solve_constraints(const constraints *c, double *u0, double *z) {
  int rows = (int)c->rows, n = (int)c->n, ld = 3 * n, lwork = 20 * n, info;
  double *s = malloc(c->n * sizeof *s), *u = malloc(c->rows * c->rows * sizeof *u);
  double *vt = malloc(c->n * c->n * sizeof *vt), *work = malloc((size_t)lwork * sizeof *work);
  double *uf = calloc(c->n * c->b, sizeof *uf);
  if (!s || !u || !vt || !work || !uf) return -1;
  dgesvd_("A", "A", &rows, &n, c->e, &ld, s, u, &rows, vt, &n, work, &lwork, &info);
  multiply("T", "N", c->rows, c->b, c->rows, u, c->rows, c->f, 3 * c->n, uf, c->n);
  for (size_t j = 0; j < c->b; j++)
    for (size_t i = 0; i < c->rows; i++) uf[i + j * c->n] /= s[i];
  multiply("T", "N", c->n, c->b, c->rows, vt, c->n, uf, c->n, u0, c->n);
  for (size_t j = 0; j < c->n - c->rows; j++)
    for (size_t i = 0; i < c->n; i++) z[i + j * c->n] = vt[c->rows + j + i * c->n];
  free(s);
  free(u);
  free(vt);
  free(work);
  free(uf);
  return info;
}

// aᵀ x b for n × n x: ca × cb.
static void sandwich(const double *a, size_t ca, const double *x, const double *b, size_t cb,
                     size_t n, double *out, size_t ld) {
  double *xb = malloc((n * cb + 1) * sizeof *xb);
  if (!xb) return;
  if (ca && cb) {
    multiply("N", "N", n, cb, n, x, n, b, n, xb, n);
    multiply("T", "N", ca, cb, n, a, n, xb, n, out, ld);
  }
  free(xb);
}

// Constraint modes into t's first b columns, all fixed-interface modes behind, ω² of these.
static int dense_shapes(const pb_fem *fem, const double *k, const double *m, double *t,
                        double *omega2, size_t *held) {
  constraints c;
  if (constrain(fem, &c)) return -1;
  size_t n = c.n, y = n - c.rows;
  double *z = malloc((n * n + 1) * sizeof *z), *kz = malloc((n * n + 1) * sizeof *kz);
  double *mz = malloc((n * n + 1) * sizeof *mz), *force = malloc((n * c.b + 1) * sizeof *force);
  int iy = (int)y, ib = (int)c.b, info, itype = 1, lwork = 1 + 6 * iy + 2 * iy * iy,
      liwork = 3 + 5 * iy, *iwork = malloc((n + 8) * 5 * sizeof *iwork);
  double *work = malloc((size_t)(lwork + 1) * sizeof *work), one = 1;
  if (!z || !kz || !mz || !force || !iwork || !work) return -1;
  int failed = solve_constraints(&c, t, z);
  sandwich(z, y, k, z, y, n, kz, y);
  sandwich(z, y, k, t, c.b, n, force, y);
  double *factor = malloc((y * y + 1) * sizeof *factor);
  if (!factor) return -1;
  memcpy(factor, kz, y * y * sizeof *kz);
  dpotrf_("L", &iy, factor, &iy, &info);
  failed |= info;
  dpotrs_("L", &iy, &ib, factor, &iy, force, &iy, &info);
  int in = (int)n;
  double minus = -1;
  dgemm_("N", "N", &in, &ib, &iy, &minus, z, &in, force, &iy, &one, t, &in);
  sandwich(z, y, m, z, y, n, mz, y);
  dsygvd_(&itype, "V", "L", &iy, kz, &iy, mz, &iy, omega2, work, &lwork, iwork, &liwork, &info);
  failed |= info;
  multiply("N", "N", n, y, y, z, n, kz, y, t + n * c.b, n);
  *held = y;
  free(z);
  free(kz);
  free(mz);
  free(force);
  free(iwork);
  free(work);
  free(factor);
  free(c.e);
  free(c.f);
  return failed;
}

int dense_reduce(const pb_fem *fem, size_t p, double **k, double **m, double **omega2) {
  size_t n = fem->k.n, b = 6 * fem->frames, size = b + p, held;
  double *fk = dense_matrix(&fem->k), *fm = dense_matrix(&fem->m);
  double *t = calloc(n * (n + b), sizeof *t);
  *k = malloc(size * size * sizeof(double));
  *m = malloc(size * size * sizeof(double));
  *omega2 = malloc((n + 1) * sizeof(double));
  if (!fk || !fm || !t || !*k || !*m || !*omega2) return -1;
  int failed = dense_shapes(fem, fk, fm, t, *omega2, &held);
  sandwich(t, size, fk, t, size, n, *k, size);
  sandwich(t, size, fm, t, size, n, *m, size);
  free(fk);
  free(fm);
  free(t);
  return failed || held < p;
}

int dense_fixed(const pb_fem *fem, double **omega2, size_t *count) {
  double *k, *m;
  int failed = dense_reduce(fem, 0, &k, &m, omega2);
  size_t rows = 0;
  for (size_t f = 0; f < fem->frames; f++)
    rows += fem->frame[f].tie == PB_TIE_RIGID ? 3 * fem->frame[f].nodes : 6;
  *count = fem->k.n - rows;
  free(k);
  free(m);
  return failed;
}
