// From an assembled plant to its modal state space: pb_model_compile.
//
// Each mode has the states [s η, η̇] with s = ω (1 rad/s for a rigid-body mode), so that both weigh
// alike:  A = [[0, s], [−ω²/s, −Ĉ]].  Modes that Ĉ does not couple are 2 × 2 blocks as they are.
// Modes that it couples (non-proportional damping) form a group whose matrix is block-diagonalised
// by its complex eigenvectors, in real form (group.h).
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "assembly/system.h"
#include "base/lapack.h"
#include "base/text.h"
#include "model/build.h"
#include "model/cluster.h"
#include "model/group.h"
#include "model/modes.h"
#include "model/relax.h"

static const double two_pi = 6.283185307179586476925286766559;

// Two modes count as coupled above 1e-12 of the geometric mean of their frequencies: what is
// dropped changes a damping ratio of 1e-3 by less than 1e-9 of itself.
static bool coupled(const pb_modes *m, size_t i, size_t j) {
  double size = sqrt(pb_mode_scale(m->omega[i]) * pb_mode_scale(m->omega[j]));
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

static pb_status build_groups(const pb_modes *m, const pb_means *means, pb_model_builder *builder,
                              pb_error *err) {
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
    st = pb_group_build(m, list, count, means, builder, err);
  }
done:
  free(parent);
  free(group);
  free(list);
  return st;
}

// Those beyond the plant's own, of stacked coordinates that are followed, have no name.
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
// ld: rows of d. Stacked coordinates that are followed have what inputs hold of them statically.
static void fill_feedthrough(const pb_system *s, const pb_modes *m, double *d, size_t ld) {
  int ny = (int)m->ny, nu = (int)m->nu, n = (int)m->n, rows = (int)ld;
  double one = 1;
  for (size_t i = 0; i < m->nu; i++) {
    memcpy(d + i * ld, s->d + i * m->ny, m->ny * sizeof *d);
    if (m->stacked)
      memcpy(d + m->ny + i * ld, s->expand_u + i * m->stacked, m->stacked * sizeof *d);
  }
  if (ny && nu)
    dgemm_("N", "N", &ny, &nu, &n, &one, m->output[2], &ny, m->force, &n, &one, d, &rows);
}

// Static responses of accelerations, ny × nu: what forces do to rigid-body modes; what is held
// rests. *known false: damping couples rigid-body modes to others.
static pb_status rest_make(const pb_modes *m, double **out, bool *known, pb_error *err) {
  const size_t ny = m->ny, nu = m->nu;
  double *rest = *out = calloc(ny * nu + 1, sizeof *rest);
  *known = true;
  if (!rest) return pb_fail_memory(err, "/outputs");
  for (size_t j = 0; j < m->rigid; j++) {
    for (size_t k = m->rigid; k < m->n; k++)
      *known = *known && !coupled(m, j, k) && !coupled(m, k, j);
    for (size_t i = 0; i < nu; i++)
      for (size_t o = 0; o < ny; o++)
        rest[o + i * ny] += m->output[2][o + j * ny] * m->force[j + i * m->n];
  }
  return PB_OK;
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
  pb_status st = copy_signals(p->input, nu, model->nu, model->input, err);
  if (!st) st = copy_signals(p->output, ny, model->ny, model->output, err);
  if (!st) st = list_electronics(p->input, nu, model->nu, &model->input_electronics, err);
  if (!st) st = list_electronics(p->output, ny, model->ny, &model->output_electronics, err);
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
  fill_feedthrough(s, m, model->d, model->ny);
  return fill_signals(s, model, err);
}

pb_status pb_model_compile_with(const pb_system *s, const pb_means *lent, pb_warnings *warnings,
                                pb_model **out, pb_error *err) {
  const pb_means means = pb_means_of(lent);
  *out = NULL;
  pb_modes modes = {0};
  pb_model_builder builder = {0};
  double *rest = NULL;
  bool known = false;
  const size_t nu = s->nu + 2 * s->stacked, ny = s->ny + 2 * s->stacked;
  pb_mode_store_begin(means.modes);
  pb_phase_begin(means.observer, PB_PHASE_MODES);
  pb_status st = pb_modes_solve(s, &means, warnings, &modes, err);
  pb_phase_begin(means.observer, PB_PHASE_DAMP);
  if (!st) st = pb_model_builder_open(&builder, 2 * s->n, nu, ny, s->n, err);
  builder.plain = s->stacked > 0;
  builder.direct = s->nu;
  if (!st) st = fill_header(s, &modes, builder.model, err);
  if (!st) st = build_groups(&modes, &means, &builder, err);
  if (!st) st = rest_make(&modes, &rest, &known, err);
  if (!st && known) builder.rest = rest, builder.rest_rows = s->ny;
  pb_modes_clear(&modes);
  pb_phase_begin(means.observer, PB_PHASE_DISCRETIZE);
  if (!st && s->relaxations == 0)
    st = pb_model_builder_close(&builder, s->plant->max_frequency, out, err);
  else if (!st)
    st = pb_model_relax(s, &builder, out, err);
  pb_model_builder_discard(&builder);
  free(rest);
  return st;
}

pb_status pb_model_compile(const pb_system *s, pb_warnings *warnings, pb_model **out,
                           pb_error *err) {
  return pb_model_compile_with(s, NULL, warnings, out, err);
}

pb_status pb_model_load_with(const char *path, const pb_means *lent, pb_warnings *warnings,
                             pb_model **out, pb_error *err) {
  const pb_means means = pb_means_of(lent);
  *out = NULL;
  pb_plant *plant = NULL;
  pb_system *system = NULL;
  pb_phase_begin(means.observer, PB_PHASE_READ);
  pb_status st = pb_plant_load(path, warnings, &plant, err);
  if (!st) st = pb_system_assemble_observed(plant, means.observer, warnings, &system, NULL, err);
  if (!st) st = pb_model_compile_with(system, &means, warnings, out, err);
  pb_system_free(system);
  pb_plant_free(plant);
  return st;
}

pb_status pb_model_load(const char *path, pb_warnings *warnings, pb_model **out, pb_error *err) {
  return pb_model_load_with(path, NULL, warnings, out, err);
}
