// From an assembled plant to its modal state space: pb_model_compile.
//
// Each mode has the states [s η, η̇] with s = ω (1 rad/s for a rigid-body mode), so that both weigh
// alike:  A = [[0, s], [−ω²/s, −Ĉ]].  Modes that Ĉ does not couple are 2 × 2 blocks as they are.
// Modes that it couples (non-proportional damping) form a group whose matrix is block-diagonalised
// by its complex eigenvectors, in real form.
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "assembly/system.h"
#include "base/lapack.h"
#include "base/text.h"
#include "model/block.h"
#include "model/build.h"
#include "model/modes.h"
#include "model/relax.h"

static const double two_pi = 6.283185307179586476925286766559;

static double state_scale(const pb_modes *m, size_t j) {
  return m->omega[j] > 0 ? m->omega[j] : 1;
}

// Two modes count as coupled above 1e-12 of the geometric mean of their frequencies: what is
// dropped changes a damping ratio of 1e-3 by less than 1e-9 of itself.
static bool coupled(const pb_modes *m, size_t i, size_t j) {
  double size = sqrt(state_scale(m, i) * state_scale(m, j));
  return fabs(m->damping[i + j * m->n]) > 1e-12 * size;
}

static size_t find(size_t *parent, size_t i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

// group[j]: number of the group of mode j, in order of the groups' first modes. Returns their
// count.
static size_t find_groups(const pb_modes *m, size_t *parent, size_t *group) {
  for (size_t i = 0; i < m->n; i++) parent[i] = i;
  for (size_t j = 0; j < m->n; j++)
    for (size_t i = 0; i < j; i++)
      if (coupled(m, i, j)) {
        size_t a = find(parent, i), b = find(parent, j);
        parent[a > b ? a : b] = a > b ? b : a;
      }
  size_t count = 0;
  for (size_t j = 0; j < m->n; j++) {
    size_t root = find(parent, j);
    group[j] = root == j ? count++ : group[root];
  }
  return count;
}

// One group's equations in its own states: s η and η̇ of each of its modes.
typedef struct group_system {
  size_t modes, n;     // g, 2g
  const size_t *mode;  // [g]
  double *a, *v;       // n × n
  double *b;           // n × nu
  double *c;           // ny × n
  size_t *size;        // [n] block sizes
  size_t blocks;
} group_system;

static void group_clear(group_system *g) {
  free(g->a);
  free(g->v);
  free(g->b);
  free(g->c);
  free(g->size);
}

static pb_status group_new(const pb_modes *m, const size_t *mode, size_t count, group_system *g,
                           pb_error *err) {
  size_t n = 2 * count;
  *g = (group_system){.modes = count, .n = n, .mode = mode};
  g->a = calloc(n * n, sizeof(double));
  g->v = malloc(n * n * sizeof(double));
  g->b = calloc(n * m->nu, sizeof(double));
  g->c = calloc(n * m->ny, sizeof(double));
  g->size = malloc(n * sizeof *g->size);
  if (g->a && g->v && g->b && g->c && g->size) return PB_OK;
  group_clear(g);
  return pb_fail_memory(err, "");
}

// States are laid out mode by mode, the fastest first: on a matrix graded so, the QR algorithm
// finds the small eigenvalues to an accuracy of their own instead of that of the largest.
static void group_fill(const pb_modes *m, group_system *g) {
  size_t count = g->modes, n = g->n, ny = m->ny;
  for (size_t j = 0; j < count; j++) {
    size_t mode = g->mode[j], x = 2 * (count - 1 - j), v = x + 1;
    double s = state_scale(m, mode), w2 = m->omega[mode] * m->omega[mode];
    g->a[x + v * n] = s;
    g->a[v + x * n] = -w2 / s;
    for (size_t i = 0; i < m->nu; i++) {
      const bool displaces = i - m->displacing < m->displacings;
      g->b[(displaces ? x : v) + i * n] = (displaces ? s : 1) * m->force[mode + i * m->n];
    }
    for (size_t i = 0; i < count; i++)
      g->a[2 * (count - 1 - i) + 1 + v * n] = -m->damping[g->mode[i] + mode * m->n];
    for (size_t o = 0; o < ny; o++) {
      double acceleration = m->output[2][o + mode * ny];
      g->c[o + x * ny] = (m->output[0][o + mode * ny] - acceleration * w2) / s;
      g->c[o + v * ny] = m->output[1][o + mode * ny];
      for (size_t i = 0; i < count; i++)
        g->c[o + v * ny] -=
            m->output[2][o + g->mode[i] * ny] * m->damping[g->mode[i] + mode * m->n];
    }
  }
}

// b ← V⁻¹ b, c ← c V, a ← diag(blocks).
static pb_status group_diagonalize(const pb_modes *m, group_system *g, pb_error *err) {
  if (g->modes == 1) {
    g->blocks = 1;
    g->size[0] = 2;
    return PB_OK;
  }
  pb_status st = pb_block_diagonalize(g->n, g->a, g->v, &g->blocks, g->size, "", err);
  if (st) return st;
  int n = (int)g->n, nu = (int)m->nu, ny = (int)m->ny, info = 0;
  double one = 1, zero = 0;
  double *c = malloc(g->n * m->ny * sizeof *c);
  int *pivot = malloc(g->n * sizeof *pivot);
  if (!c || !pivot) {
    free(c);
    free(pivot);
    return pb_fail_memory(err, "");
  }
  dgemm_("N", "N", &ny, &n, &n, &one, g->c, &ny, g->v, &n, &zero, c, &ny);
  free(g->c);
  g->c = c;
  dgesv_(&n, &nu, g->v, &n, pivot, g->b, &n, &info);
  free(pivot);
  if (info) return pb_fail(err, PB_ERR_NUMERIC, "", "the modal transformation is singular");
  return PB_OK;
}

// Hands the group's blocks over; a real eigenvalue shares a 2 × 2 block with the next one.
static pb_status group_emit(const pb_modes *m, const group_system *g, pb_model_builder *builder,
                            pb_error *err) {
  pb_status st = PB_OK;
  size_t at = 0;
  for (size_t k = 0; k < g->blocks && !st; k++) {
    size_t size = g->size[k];
    if (size == 1 && k + 1 < g->blocks && g->size[k + 1] == 1) size = 2, k++;
    pb_model_part part = {.size = size,
                          .a = g->a + at + at * g->n,
                          .lda = g->n,
                          .b = g->b + at,
                          .ldb = g->n,
                          .c = g->c + at * m->ny,
                          .ldc = m->ny};
    st = pb_model_builder_add(builder, &part, err);
    at += size;
  }
  return st;
}

static pb_status build_group(const pb_modes *m, const size_t *mode, size_t count,
                             pb_model_builder *builder, pb_error *err) {
  group_system g;
  pb_status st = group_new(m, mode, count, &g, err);
  if (st) return st;
  group_fill(m, &g);
  st = group_diagonalize(m, &g, err);
  if (!st) st = group_emit(m, &g, builder, err);
  group_clear(&g);
  return st;
}

static pb_status build_groups(const pb_modes *m, pb_model_builder *builder, pb_error *err) {
  size_t *parent = malloc(m->n * sizeof *parent), *group = malloc(m->n * sizeof *group);
  size_t *list = malloc(m->n * sizeof *list);
  pb_status st = PB_OK;
  if (!parent || !group || !list) {
    st = pb_fail_memory(err, "");
    goto done;
  }
  size_t groups = find_groups(m, parent, group);
  for (size_t g = 0; g < groups && !st; g++) {
    size_t count = 0;
    for (size_t j = 0; j < m->n; j++)
      if (group[j] == g) list[count++] = j;
    st = build_group(m, list, count, builder, err);
  }
done:
  free(parent);
  free(group);
  free(list);
  return st;
}

// Those beyond the plant's own, of an extended system, have no name.
static pb_status copy_signals(const pb_port *port, size_t ports, size_t count, pb_signal *out,
                              pb_error *err) {
  for (size_t i = 0; i < count; i++) {
    out[i].name = pb_text_copy(i < ports ? port[i].name : "");
    out[i].unit = pb_text_copy(i < ports ? pb_signal_unit(port[i].type) : "");
    if (!out[i].name || !out[i].unit) return pb_fail_memory(err, "");
  }
  return PB_OK;
}

// Direct feed-through: D of the system and, of accelerations, Y_2 Φ Φᵀ F.
static void fill_feedthrough(const pb_system *s, const pb_modes *m, double *d) {
  int ny = (int)m->ny, nu = (int)m->nu, n = (int)m->n;
  double one = 1;
  memcpy(d, s->d, m->ny * m->nu * sizeof *d);
  dgemm_("N", "N", &ny, &nu, &n, &one, m->output[2], &ny, m->force, &n, &one, d, &ny);
}

// The electronics of one list of ports, the caller's; NULL where no port has any.
static pb_status list_electronics(const pb_port *port, size_t ports, size_t count,
                                  pb_electronics **out, pb_error *err) {
  bool any = false;
  for (size_t i = 0; i < ports; i++) any = any || port[i].has_electronics;
  if (!any) return PB_OK;
  *out = malloc(count * sizeof **out);
  if (!*out) return pb_fail_memory(err, "electronics");
  for (size_t i = 0; i < count; i++)
    (*out)[i] = i < ports && port[i].has_electronics ? port[i].electronics : pb_electronics_none();
  return PB_OK;
}

static pb_status fill_signals(const pb_system *s, pb_model *model, pb_error *err) {
  const pb_plant *p = s->plant;
  const size_t nu = p->input_count, ny = p->output_count;
  pb_status st = copy_signals(p->input, nu, s->nu, model->input, err);
  if (!st) st = copy_signals(p->output, ny, s->ny, model->output, err);
  if (!st) st = list_electronics(p->input, nu, s->nu, &model->input_electronics, err);
  if (!st) st = list_electronics(p->output, ny, s->ny, &model->output_electronics, err);
  return st;
}

static pb_status fill_header(const pb_system *s, const pb_modes *m, pb_model *model,
                             pb_error *err) {
  const pb_plant *p = s->plant;
  model->name = pb_text_copy(p->name);
  if (!model->name) return pb_fail_memory(err, "/name");
  model->sample_rate = p->sample_rate;
  model->dof = s->n;
  for (size_t j = 0; j < m->n; j++) {
    model->mode_hz[j] = m->omega[j] / two_pi;
    model->mode_damping[j] = m->omega[j] > 0 ? m->damping[j + j * m->n] / (2 * m->omega[j]) : 0;
  }
  fill_feedthrough(s, m, model->d);
  return fill_signals(s, model, err);
}

pb_status pb_model_compile(const pb_system *s, pb_warnings *warnings, pb_model **out,
                           pb_error *err) {
  *out = NULL;
  pb_modes modes = {0};
  pb_model_builder builder = {0};
  pb_status st = pb_modes_solve(s, warnings, &modes, err);
  if (!st) st = pb_model_builder_open(&builder, 2 * s->n, s->nu, s->ny, s->n, err);
  if (!st) st = fill_header(s, &modes, builder.model, err);
  if (!st) st = build_groups(&modes, &builder, err);
  if (!st && s->relaxations == 0)
    st = pb_model_builder_close(&builder, s->plant->max_frequency, out, err);
  else if (!st)
    st = pb_model_relax(s, &builder, out, err);
  pb_model_builder_discard(&builder);
  pb_modes_clear(&modes);
  return st;
}

pb_status pb_model_load(const char *path, pb_warnings *warnings, pb_model **out, pb_error *err) {
  *out = NULL;
  pb_plant *plant = NULL;
  pb_system *system = NULL;
  pb_status st = pb_plant_load(path, warnings, &plant, err);
  if (!st) st = pb_system_assemble(plant, warnings, &system, err);
  if (!st) st = pb_model_compile(system, warnings, out, err);
  pb_system_free(system);
  pb_plant_free(plant);
  return st;
}
