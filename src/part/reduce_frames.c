// Frames in terms of rows of K: which node has which row, and how frames are tied to theirs.
//
// The tie of an averaged frame is C = (RᵀGR)⁻¹RᵀG, R the rigid motions of its nodes about its
// origin, G = g ⊗ I₃: node i has RᵀG_i = [m₀ I; [m₁]×] with the moments m₀ = Σ g_ij and
// m₁ = Σ g_ij x_j of fem.h.
#include "part/reduce_internal.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/lapack.h"

// ---- rows and nodes -----------------------------------------------------------------------------

static pb_status check_matrices(const pb_fem *fem, pb_error *err) {
  if (!fem->frames) return pb_fail(err, PB_ERR_ARGUMENT, fem->name, "has no interface frame");
  if (fem->k.n != fem->m.n || !fem->k.n)
    return pb_fail(err, PB_ERR_ARGUMENT, fem->name, "K has %zu rows and M %zu", fem->k.n, fem->m.n);
  const pb_sparse *both[2] = {&fem->k, &fem->m};
  for (size_t i = 0; i < 2; i++)
    for (int64_t at = 0; at < both[i]->start[both[i]->n]; at++)
      if (!isfinite(both[i]->value[at]))
        return pb_fail(err, PB_ERR_ARGUMENT, fem->name, "%s has an entry that is not finite",
                       i ? "M" : "K");
  return PB_OK;
}

static pb_status map_rows(reduce_work *w, pb_error *err) {
  const pb_fem *fem = w->fem;
  w->node_of_row = malloc(w->full * sizeof *w->node_of_row);
  w->rigid_row = calloc(w->full, sizeof *w->rigid_row);
  w->held = calloc(w->full, sizeof *w->held);
  if (!w->node_of_row || !w->rigid_row || !w->held) return pb_fail_memory(err, fem->name);
  for (size_t r = 0; r < w->full; r++) w->node_of_row[r] = SIZE_MAX;
  for (size_t i = 0; i < 3 * fem->nodes; i++) {
    int64_t r = fem->dof[i];
    if (r < 0) continue;
    if ((size_t)r >= w->full || w->node_of_row[r] != SIZE_MAX)
      return pb_fail(err, PB_ERR_ARGUMENT, fem->name, "row %" PRId64 " of node %" PRId64 " %s",
                     r + 1, pb_fem_node_number(fem, i / 3),
                     (size_t)r >= w->full ? "is beyond the matrices" : "is another node's too");
    w->node_of_row[r] = i / 3;
  }
  for (size_t r = 0; r < w->full; r++) {
    if (w->node_of_row[r] == SIZE_MAX)
      return pb_fail(err, PB_ERR_ARGUMENT, fem->name, "row %zu of K belongs to no node", r + 1);
    int64_t node = pb_fem_node_number(fem, w->node_of_row[r]);
    if (!(pb_sparse_diagonal(&fem->k, r) > 0))
      return pb_fail(err, PB_ERR_SINGULAR, fem->name,
                     "row %zu of K (node %" PRId64 ") has no positive diagonal: nothing holds it",
                     r + 1, node);
    if (pb_sparse_diagonal(&fem->m, r) < 0)
      return pb_fail(err, PB_ERR_ARGUMENT, fem->name,
                     "row %zu of M (node %" PRId64 ") has a negative diagonal: %g", r + 1, node,
                     pb_sparse_diagonal(&fem->m, r));
  }
  return PB_OK;
}

// ---- ties ---------------------------------------------------------------------------------------

void reduce_rigid_tie(const double x[3], double tie[18]) {
  memset(tie, 0, 18 * sizeof *tie);
  for (int a = 0; a < 3; a++) {
    int b = (a + 1) % 3, c = (a + 2) % 3;
    tie[a + 3 * a] = 1;
    tie[b + 3 * (3 + a)] = -x[c];
    tie[c + 3 * (3 + a)] = x[b];
  }
}

static void node_offset(const pb_fem *fem, const pb_fem_frame *frame, size_t i, double x[3]) {
  for (size_t a = 0; a < 3; a++) x[a] = fem->xyz[a + 3 * frame->node[i]] - frame->origin[a];
}

// RᵀG_i, 6 × 3 column-major.
static void weigh_node(const double moment[4], double out[18]) {
  memset(out, 0, 18 * sizeof *out);
  for (int a = 0; a < 3; a++) {
    int b = (a + 1) % 3, c = (a + 2) % 3;
    out[a + 6 * a] = moment[0];
    // The moment about a of a force along b is −x_c, along c is x_b.
    out[3 + a + 6 * b] = -moment[1 + c];
    out[3 + a + 6 * c] = moment[1 + b];
  }
}

// LU of RᵀGR, its rotations scaled by the frame's size.
typedef struct motions {
  double g[36], scale[6];
  int pivot[6];
} motions;

static pb_status factor_motions(const pb_fem_frame *frame, double size, motions *m, pb_error *err) {
  double largest = 0, rcond = 0, work[24];
  int six = 6, info = 0, iwork[6];
  for (int i = 0; i < 6; i++) m->scale[i] = i < 3 ? 1 : 1 / size;
  for (int j = 0; j < 6; j++) {
    double sum = 0;
    for (int i = 0; i < 6; i++) sum += fabs(m->g[i + 6 * j] *= m->scale[i] * m->scale[j]);
    largest = fmax(largest, sum);
  }
  dgetrf_(&six, &six, m->g, &six, m->pivot, &info);
  if (!info) dgecon_("1", &six, m->g, &six, &largest, &rcond, work, iwork, &info);
  if (info || !(rcond > 1e-10))
    return pb_fail(err, PB_ERR_ARGUMENT, frame->name,
                   "the frame's %zu nodes do not define its six motions: they lie on a line, or "
                   "their weights vanish",
                   frame->nodes);
  return PB_OK;
}

// RᵀGR of the frame's nodes; for a rigid frame, where G only tells whether they lie on a line, I.
static pb_status tie_nodes(const pb_fem *fem, const reduce_frame *f, motions *m, pb_error *err) {
  double size = 0;
  *m = (motions){0};
  for (size_t i = 0; i < f->from->nodes; i++) {
    double x[3], r[18], weighed[18];
    node_offset(fem, f->from, i, x);
    size = fmax(size, sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]));
    reduce_rigid_tie(x, r);
    if (f->rigid) {
      const double moment[4] = {1, x[0], x[1], x[2]};
      weigh_node(moment, weighed);
    } else {
      weigh_node(f->from->moment + 4 * i, weighed);
    }
    for (int c = 0; c < 6; c++)
      for (int d = 0; d < 3; d++)
        for (int row = 0; row < 6; row++) m->g[row + 6 * c] += weighed[row + 6 * d] * r[d + 3 * c];
    memcpy(f->tie + 18 * i, f->rigid ? r : weighed, sizeof r);
  }
  return factor_motions(f->from, size > 0 ? size : 1, m, err);
}

static pb_status tie_average(const pb_fem *fem, const reduce_frame *f, pb_error *err) {
  motions m;
  int six = 6, info = 0, columns = (int)(3 * f->from->nodes);
  if (!f->from->moment)
    return pb_fail(err, PB_ERR_ARGUMENT, f->from->name, "an averaged frame needs weights");
  pb_status st = tie_nodes(fem, f, &m, err);
  if (st) return st;
  for (size_t i = 0; i < 18 * f->from->nodes; i++) f->tie[i] *= m.scale[i % 6];
  dgetrs_("N", &six, &columns, m.g, &six, m.pivot, f->tie, &six, &info);
  for (size_t i = 0; i < 18 * f->from->nodes; i++) f->tie[i] *= m.scale[i % 6];
  return PB_OK;
}

static pb_status tie_rigid(reduce_work *w, const reduce_frame *f, pb_error *err) {
  motions m;
  const pb_fem_frame *frame = f->from;
  pb_status st = tie_nodes(w->fem, f, &m, err);
  for (size_t i = 0; !st && i < 3 * frame->nodes; i++) {
    size_t node = frame->node[i / 3];
    int64_t r = w->fem->dof[i % 3 + 3 * node];
    if (r < 0) {
      st = pb_fail(err, PB_ERR_ARGUMENT, frame->name,
                   "node %" PRId64 " of a rigid frame cannot move: K has no row for it",
                   pb_fem_node_number(w->fem, node));
    } else if (w->rigid_row[r]) {
      st = pb_fail(err, PB_ERR_ARGUMENT, frame->name,
                   "node %" PRId64 " is in two rigid frames, or twice in this one",
                   pb_fem_node_number(w->fem, node));
    } else {
      w->rigid_row[r] = w->held[r] = true;
    }
  }
  return st;
}

// A node without rows would count as one that stays where it is.
static pb_status check_frame(const pb_fem *fem, const pb_fem_frame *frame, pb_error *err) {
  if (!frame->nodes) return pb_fail(err, PB_ERR_ARGUMENT, frame->name, "has no nodes");
  for (size_t i = 0; i < frame->nodes; i++) {
    if (frame->node[i] >= fem->nodes)
      return pb_fail(err, PB_ERR_ARGUMENT, frame->name, "the model has no node of index %zu",
                     frame->node[i]);
    const int64_t *dof = fem->dof + 3 * frame->node[i];
    if (dof[0] < 0 && dof[1] < 0 && dof[2] < 0)
      return pb_fail(err, PB_ERR_ARGUMENT, frame->name,
                     "node %" PRId64 " cannot move: K has no row for it",
                     pb_fem_node_number(fem, frame->node[i]));
  }
  return PB_OK;
}

static pb_status tie_frames(reduce_work *w, pb_error *err) {
  const pb_fem *fem = w->fem;
  w->frame = calloc(w->frames, sizeof *w->frame);
  if (!w->frame) return pb_fail_memory(err, fem->name);
  pb_status st = PB_OK;
  for (size_t f = 0; !st && f < w->frames; f++) {
    reduce_frame *frame = &w->frame[f];
    frame->from = &fem->frame[f];
    frame->rigid = frame->from->tie == PB_TIE_RIGID;
    st = check_frame(fem, frame->from, err);
    if (st) break;
    frame->tie = malloc(18 * frame->from->nodes * sizeof(double));
    if (!frame->tie) return pb_fail_memory(err, fem->name);
    st = frame->rigid ? tie_rigid(w, frame, err) : tie_average(fem, frame, err);
    w->averaged += !frame->rigid;
  }
  return st;
}

void reduce_average(const reduce_work *w, size_t columns, const double *u, double *out, size_t ld) {
  for (size_t f = 0; f < w->frames; f++) {
    const reduce_frame *frame = &w->frame[f];
    for (size_t c = 0; !frame->rigid && c < columns; c++) {
      double *q = out + frame->border - w->pins + c * ld;
      memset(q, 0, 6 * sizeof *q);
      for (size_t i = 0; i < 3 * frame->from->nodes; i++) {
        int64_t r = w->fem->dof[i % 3 + 3 * frame->from->node[i / 3]];
        double value = r < 0 ? 0 : u[(size_t)r + c * w->full];
        for (size_t a = 0; a < 6; a++) q[a] += frame->tie[a + 6 * i] * value;
      }
    }
  }
}

void reduce_spread(const reduce_work *w, size_t columns, const double *z, size_t ld, double *u) {
  for (size_t f = 0; f < w->frames; f++) {
    const reduce_frame *frame = &w->frame[f];
    for (size_t c = 0; !frame->rigid && c < columns; c++) {
      const double *q = z + frame->border - w->pins + c * ld;
      for (size_t i = 0; i < 3 * frame->from->nodes; i++) {
        int64_t r = w->fem->dof[i % 3 + 3 * frame->from->node[i / 3]];
        for (size_t a = 0; r >= 0 && a < 6; a++)
          u[(size_t)r + c * w->full] += frame->tie[a + 6 * i] * q[a];
      }
    }
  }
}

void reduce_move_rigid(const reduce_work *w, size_t f, size_t d, double *u) {
  const reduce_frame *frame = &w->frame[f];
  for (size_t i = 0; i < 3 * frame->from->nodes; i++) {
    int64_t r = w->fem->dof[i % 3 + 3 * frame->from->node[i / 3]];
    if (r >= 0) u[r] += frame->tie[18 * (i / 3) + i % 3 + 3 * d];
  }
}

pb_status reduce_set_up(reduce_work *w, pb_error *err) {
  const pb_fem *fem = w->fem;
  pb_status st = check_matrices(fem, err);
  if (st) return st;
  w->full = fem->k.n;
  w->frames = fem->frames;
  w->boundary = 6 * fem->frames;
  st = map_rows(w, err);
  if (!st) st = tie_frames(w, err);
  if (!st) st = reduce_check_connected(w, err);
  if (!st) st = reduce_choose_pins(w, err);
  if (st) return st;
  w->border = w->pins;
  for (size_t f = 0; f < w->frames; f++) {
    if (w->frame[f].rigid) continue;
    w->frame[f].border = w->border;
    w->border += 6;
  }
  return reduce_mass_detect(w, err);
}
