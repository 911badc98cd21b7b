// Damped modes by refinement of clusters: see damped.h.
#include "model/damped.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/array.h"
#include "base/lapack.h"
#include "model/damped_internal.h"

static const double tolerance = 1e-13;  // of a residual against its eigenvalue; the step follows
static const double most_tilt = 0.7;    // below 1 the vectors stay independent
enum { MOST_SWEEPS = 30, MOST_STALLS = 3, BATCH = PB_DAMPED_BATCH };

// Columns of a batch where `count` are left: fewer than the most, so that a late sweep, too, can be
// shared; whatever the number of workers.
static size_t batch_size(size_t count) {
  const size_t quarter = (count / 4 + 15) / 16 * 16;
  return quarter < 16 ? 16 : quarter > BATCH ? BATCH : quarter;
}

void pb_damped_clear(pb_damped *d) {
  pb_clusters_clear(&d->cluster);
  for (int i = 0; i < 2; i++) {
    free(d->x[i]);
    free(d->p[i]);
  }
  *d = (pb_damped){0};
}

static void space_clear(pb_damped_space *s) {
  free(s->in);
  free(s->out);
  for (int i = 0; i < 2; i++) {
    free(s->r[i]);
    free(s->dx[i]);
    free(s->along[i]);
  }
  free(s->basis);
}

static void iteration_clear(pb_iteration *it) {
  for (size_t w = 0; it->space && w < pb_workers_count(it->workers); w++)
    space_clear(&it->space[w]);
  free(it->space);
  free(it->c);
  free(it->w2);
  free(it->list);
  free(it->residual);
  free(it->turned_by);
  free(it->basis);
  free(it->active);
  free(it->error);
  free(it->home);
  free(it->value);
  free(it->own);
  free(it->t);
  free(it->z);
  free(it->work);
  free(it->rwork);
  free(it->turned);
  free(it->pivot);
}

static bool result_new(pb_damped *d) {
  bool ok = true;
  for (int i = 0; i < 2; i++) {
    d->x[i] = pb_array_zero(d->n * d->columns, sizeof(double));
    d->p[i] = pb_array_new(d->n * d->columns, sizeof(double));
    ok = ok && d->x[i] && d->p[i];
  }
  return ok;
}

static bool space_new(size_t n, size_t batch, size_t wide, pb_damped_space *s) {
  bool ok = true;
  for (int i = 0; i < 2; i++) {
    s->r[i] = pb_array_new(n * batch, sizeof(double));
    s->dx[i] = pb_array_new(n * batch, sizeof(double));
    s->along[i] = pb_array_new(2 * BATCH * wide, sizeof(double));
    ok = ok && s->r[i] && s->dx[i] && s->along[i];
  }
  s->in = pb_array_new(n * batch, sizeof(double));
  s->out = pb_array_new(n * batch, sizeof(double));
  s->basis = pb_array_new(2 * wide * wide, sizeof(double));
  return ok && s->in && s->out && s->basis;
}

static bool spaces_new(size_t n, size_t wide, pb_iteration *it) {
  const size_t count = pb_workers_count(it->workers), batch = batch_size(it->d->columns);
  it->space = calloc(count, sizeof *it->space);
  bool ok = it->space != NULL;
  for (size_t w = 0; w < count && ok; w++) ok = space_new(n, batch, wide, &it->space[w]);
  return ok;
}

static bool iteration_new(pb_damped *d, const pb_workers *workers, pb_iteration *it) {
  const size_t n = d->n, count = d->cluster.count, wide = 2 * d->cluster.widest;
  *it = (pb_iteration){.d = d, .workers = workers, .widest = wide};
  bool ok = spaces_new(n, wide, it);
  it->c = pb_array_new(n * n, sizeof(double));
  it->w2 = malloc(n * sizeof(double));
  it->list = malloc(d->columns * sizeof *it->list);
  it->residual = malloc(d->columns * sizeof *it->residual);
  it->turned_by = malloc(d->columns * sizeof *it->turned_by);
  it->basis = pb_array_new(2 * wide * wide, sizeof(double));
  it->active = malloc(count * sizeof(bool));
  it->error = malloc(count * sizeof(double));
  it->home = malloc(d->columns * sizeof *it->home);
  it->value = malloc((count + 1) * sizeof *it->value);
  it->t = pb_array_new(wide * wide, sizeof *it->t);
  it->z = pb_array_new(wide * wide, sizeof *it->z);
  it->work = pb_array_new(4 * wide, sizeof *it->work);
  it->rwork = pb_array_new(2 * wide, sizeof(double));
  it->turned = pb_array_new(2 * n * wide, sizeof(double));
  it->pivot = malloc(wide * sizeof(int));
  ok = ok && it->c && it->w2 && it->list && it->residual && it->turned_by && it->basis &&
       it->active && it->error && it->home && it->value && it->t && it->z && it->work &&
       it->rwork && it->turned && it->pivot;
  if (!ok) return false;
  it->value[0] = 0;
  for (size_t c = 0; c < count; c++) {
    const size_t pairs = d->cluster.column[c + 1] - d->cluster.column[c];
    it->value[c + 1] = it->value[c] + pairs * pairs;
    it->active[c] = true;
    for (size_t k = d->cluster.column[c]; k < d->cluster.column[c + 1]; k++) it->home[k] = c;
  }
  it->own = calloc(it->value[count], sizeof *it->own);
  return it->own != NULL;
}

// Ĉ and ω² in the clusters' order; X = the clusters' own vectors.
static void begin(const double *omega, const double *damping, pb_iteration *it) {
  pb_damped *d = it->d;
  const pb_clusters *c = &d->cluster;
  const size_t n = d->n;
  for (size_t j = 0; j < n; j++) {
    it->w2[j] = omega[c->mode[j]] * omega[c->mode[j]];
    for (size_t i = 0; i < n; i++) it->c[i + j * n] = damping[c->mode[i] + c->mode[j] * n];
  }
  for (size_t k = 0; k < c->count; k++) {
    const size_t modes = c->start[k + 1] - c->start[k];
    const double complex *v = c->v + c->value[k];
    for (size_t j = c->column[k]; j < c->column[k + 1]; j++, v += modes)
      for (size_t i = 0; i < modes; i++) {
        d->x[0][c->start[k] + i + j * n] = creal(v[i]);
        d->x[1][c->start[k] + i + j * n] = cimag(v[i]);
      }
  }
}

// P = Ĉ X of clusters whose vectors are still their own: rows outside a cluster are zero.
static void multiply_first(pb_iteration *it) {
  pb_damped *d = it->d;
  const pb_clusters *c = &d->cluster;
  const double one = 1, zero = 0;
  const int n = (int)d->n;
  for (size_t k = 0; k < c->count; k++) {
    const int modes = (int)(c->start[k + 1] - c->start[k]);
    const int columns = (int)(c->column[k + 1] - c->column[k]);
    const size_t first = c->column[k] * d->n;
    for (int i = 0; i < 2; i++)
      dgemm_("N", "N", &n, &columns, &modes, &one, it->c + c->start[k] * d->n, &n,
             d->x[i] + c->start[k] + first, &n, &zero, d->p[i] + first, &n);
  }
}

// P = Ĉ X of the columns k[count].
static void multiply(const pb_iteration *it, pb_damped_space *s, const size_t *k, size_t count) {
  const size_t n = it->d->n;
  const int size = (int)n, columns = (int)count;
  const double one = 1, zero = 0;
  for (int part = 0; part < 2; part++) {
    for (size_t i = 0; i < count; i++)
      memcpy(s->in + i * n, it->d->x[part] + k[i] * n, n * sizeof(double));
    dgemm_("N", "N", &size, &columns, &size, &one, it->c, &size, s->in, &size, &zero, s->out,
           &size);
    for (size_t i = 0; i < count; i++)
      memcpy(it->d->p[part] + k[i] * n, s->out + i * n, n * sizeof(double));
  }
}

static void correct_first(void *context, size_t item, size_t worker) {
  const pb_iteration *it = context;
  const size_t batch = batch_size(it->count), first = item * batch;
  const size_t count = it->count - first < batch ? it->count - first : batch;
  pb_damped_correct(it, &it->space[worker], it->list + first, count);
}

static void correct_next(void *context, size_t item, size_t worker) {
  const pb_iteration *it = context;
  const size_t batch = batch_size(it->count), first = item * batch;
  const size_t count = it->count - first < batch ? it->count - first : batch;
  multiply(it, &it->space[worker], it->list + first, count);
  pb_damped_correct(it, &it->space[worker], it->list + first, count);
}

// Residuals and corrections of all active columns.
static void sweep(pb_iteration *it, bool first) {
  it->count = 0;
  it->tilt = 0;
  for (size_t k = 0; k < it->d->columns; k++)
    if (it->active[it->home[k]]) it->list[it->count++] = k;
  for (size_t i = 0; i < it->count; i++) it->error[it->home[it->list[i]]] = 0;
  if (first) multiply_first(it);
  const size_t batch = batch_size(it->count);
  pb_workers_run(it->workers, (it->count + batch - 1) / batch, first ? correct_first : correct_next,
                 it);
  for (size_t i = 0; i < it->count; i++) {
    const size_t k = it->list[i], home = it->home[k];
    it->error[home] = fmax(it->error[home], it->residual[k]);
    if (!(it->turned_by[k] <= it->tilt)) it->tilt = it->turned_by[k];  // NaN too
  }
}

static bool iterate(pb_iteration *it) {
  double before = INFINITY;
  for (int turn = 0, stalls = 0; turn < MOST_SWEEPS && stalls < MOST_STALLS; turn++) {
    double worst = 0;
    bool left = false;
    sweep(it, turn == 0);
    if (!(it->tilt < most_tilt)) return false;
    for (size_t c = 0; c < it->d->cluster.count; c++) {
      if (!it->active[c]) continue;
      if (!isfinite(it->error[c]) || !pb_damped_turn(it, c)) return false;
      it->active[c] = it->error[c] > tolerance;
      left = left || it->active[c];
      worst = fmax(worst, it->error[c]);
    }
    if (!left) return true;
    if (worst > 0.5 * before) stalls++;
    before = worst;
  }
  return false;
}

pb_status pb_damped_solve(size_t n, const double *omega, const double *damping,
                          const pb_workers *workers, pb_damped *out, bool *solved, pb_error *err) {
  pb_iteration it = {0};
  *out = (pb_damped){.n = n};
  pb_status st = pb_clusters_make(n, omega, damping, &out->cluster, solved, err);
  if (st || !*solved) return st;
  out->columns = out->cluster.column[out->cluster.count];
  workers = pb_workers_for(workers, 4.0 * (double)n * (double)n * (double)out->columns);
  if (!result_new(out) || !iteration_new(out, workers, &it)) st = pb_fail_memory(err, "");
  if (!st) {
    begin(omega, damping, &it);
    *solved = iterate(&it);
  }
  iteration_clear(&it);
  if (st || !*solved) pb_damped_clear(out);
  return st;
}
