// Putting a pb_model together: see build.h.
#include "model/build.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/array.h"
#include "base/lapack.h"
#include "base/text.h"
#include "model/block.h"
#include "model/rates.h"
#include "model/step_kernel.h"

static const double two_pi = 6.283185307179586476925286766559;

static void *array(size_t count, size_t size) {
  return pb_array_zero(count ? count : 1, size);
}

pb_model *pb_model_allocate(size_t nx, size_t nu, size_t ny, size_t modes, size_t blocks,
                            size_t values) {
  pb_model *m = calloc(1, sizeof *m);
  if (!m) return NULL;
  m->nx = nx, m->nu = nu, m->ny = ny, m->modes = m->dof = modes, m->blocks = blocks;
  m->input = array(nu, sizeof *m->input);
  m->output = array(ny, sizeof *m->output);
  m->mode_hz = array(modes, sizeof(double));
  m->mode_damping = array(modes, sizeof(double));
  m->block_start = array(blocks + 1, sizeof(size_t));
  m->block_value = array(blocks + 1, sizeof(size_t));
  m->a = array(values, sizeof(double));
  m->ad = array(values, sizeof(double));
  m->b = pb_array_new(nx * nu, sizeof(double));
  m->bd = pb_array_new(nx * nu, sizeof(double));
  m->c = pb_array_new(ny * nx, sizeof(double));
  m->d = calloc(ny * nu + 1, sizeof(double));  // with a motion map mostly zero and never touched
  if (m->input && m->output && m->mode_hz && m->mode_damping && m->block_start && m->block_value &&
      m->a && m->ad && m->b && m->bd && m->c && m->d)
    return m;
  pb_model_free(m);
  return NULL;
}

static void free_signals(pb_signal *signal, size_t count) {
  for (size_t i = 0; signal && i < count; i++) {
    free(signal[i].name);
    free(signal[i].unit);
  }
  free(signal);
}

void pb_model_free(pb_model *m) {
  if (!m) return;
  free_signals(m->input, m->nu);
  free_signals(m->output, m->ny);
  free(m->name);
  free(m->mode_hz);
  free(m->mode_damping);
  free(m->block_start);
  free(m->block_value);
  free(m->a);
  free(m->ad);
  free(m->b);
  free(m->bd);
  free(m->c);
  free(m->d);
  free(m->input_electronics);
  free(m->output_electronics);
  pb_step_pack_free(m->step);
  free(m);
}

double pb_block_frequency(const double *a, size_t size) {
  if (size == 1) return fabs(a[0]);
  if (size == 2) return sqrt(fabs(a[0] * a[3] - a[1] * a[2]));
  double sum = 0;
  for (size_t i = 0; i < size * size; i++) sum += a[i] * a[i];
  return sqrt(sum / (double)size);
}

pb_status pb_model_builder_open(pb_model_builder *b, size_t nx, size_t nu, size_t ny, size_t modes,
                                pb_error *err) {
  b->capacity = 2 * nx;
  b->plain = false;
  b->direct = nu;
  b->rest = NULL;
  b->model = pb_model_allocate(nx, nu, ny, modes, nx, b->capacity);  // at most nx blocks
  if (!b->model) return pb_fail_memory(err, "");
  b->model->blocks = 0;
  return PB_OK;
}

void pb_model_builder_discard(pb_model_builder *b) {
  pb_model_free(b->model);
  *b = (pb_model_builder){0};
}

static void add_block(pb_model *m, size_t size) {
  m->blocks++;
  m->block_start[m->blocks] = m->block_start[m->blocks - 1] + size;
  m->block_value[m->blocks] = m->block_value[m->blocks - 1] + size * size;
}

// Copies a block into model m at its end; its arrays are large enough.
static void append(pb_model *m, const pb_model_part *p) {
  size_t start = m->block_start[m->blocks], value = m->block_value[m->blocks];
  for (size_t j = 0; j < p->size; j++)
    memcpy(m->a + value + j * p->size, p->a + j * p->lda, p->size * sizeof(double));
  for (size_t i = 0; i < m->nu; i++)
    memcpy(m->b + start + i * m->nx, p->b + i * p->ldb, p->size * sizeof(double));
  for (size_t j = 0; j < p->size; j++)
    memcpy(m->c + (start + j) * m->ny, p->c + j * p->ldc, m->ny * sizeof(double));
  add_block(m, p->size);
}

// So that the state matrix may have this many entries.
static pb_status grow(pb_model_builder *b, size_t needed, pb_error *err) {
  if (needed <= b->capacity) return PB_OK;
  const size_t capacity = 2 * b->capacity > needed ? 2 * b->capacity : needed;
  double *a = realloc(b->model->a, capacity * sizeof *a);
  if (a) b->model->a = a;
  double *ad = a ? realloc(b->model->ad, capacity * sizeof *ad) : NULL;
  if (!ad) return pb_fail_memory(err, "");
  b->model->ad = ad;
  b->capacity = capacity;
  return PB_OK;
}

pb_status pb_model_builder_add(pb_model_builder *b, const pb_model_part *part, pb_error *err) {
  pb_model *m = b->model;
  pb_status st = grow(b, m->block_value[m->blocks] + part->size * part->size, err);
  if (!st) append(m, part);
  return st;
}

pb_status pb_model_builder_reserve(pb_model_builder *b, const size_t *size, size_t count,
                                   size_t *first, pb_error *err) {
  pb_model *m = b->model;
  size_t needed = m->block_value[m->blocks];
  for (size_t k = 0; k < count; k++) needed += size[k] * size[k];
  pb_status st = grow(b, needed, err);
  *first = m->blocks;
  for (size_t k = 0; k < count && !st; k++) add_block(m, size[k]);
  return st;
}

static pb_model_part part_of(const pb_model *m, size_t block) {
  size_t start = m->block_start[block], size = m->block_start[block + 1] - start;
  return (pb_model_part){.size = size,
                         .a = m->a + m->block_value[block],
                         .lda = size,
                         .b = m->b + start,
                         .ldb = m->nx,
                         .c = m->c + start * m->ny,
                         .ldc = m->ny};
}

// D += −C A⁻¹ B of one block, for the first `direct` inputs.
static pb_status add_static(pb_model *m, const pb_model_part *p, size_t direct, pb_error *err) {
  size_t n = p->size;
  int size = (int)n, nu = (int)direct, info = 0;
  double *a = pb_array_new(n * n, sizeof *a), *x = pb_array_new(n * direct, sizeof *x);
  int *pivot = malloc(n * sizeof *pivot);
  pb_status st = PB_OK;
  if (!a || !x || !pivot) {
    st = pb_fail_memory(err, "/max_frequency");
    goto done;
  }
  memcpy(a, p->a, n * n * sizeof *a);
  for (size_t i = 0; i < direct; i++) memcpy(x + i * n, p->b + i * p->ldb, n * sizeof *x);
  dgesv_(&size, &nu, a, &size, pivot, x, &size, &info);
  if (info) {
    st = pb_fail(err, PB_ERR_NUMERIC, "/max_frequency", "a mode above it has no static response");
    goto done;
  }
  for (size_t i = 0; i < direct; i++)
    for (size_t o = 0; o < m->ny; o++)
      for (size_t j = 0; j < n; j++) m->d[o + i * m->ny] -= p->c[o + j * p->ldc] * x[j + i * n];
done:
  free(a);
  free(x);
  free(pivot);
  return st;
}

// Magnitude of the slowest eigenvalue of a block: an overdamped pair has a slow and a fast one.
static double slowest(const pb_model_part *p) {
  double natural = pb_block_frequency(p->a, p->size);
  if (p->size != 2) return natural;
  double mean = 0.5 * (p->a[0] + p->a[1 + p->lda]), half = 0.5 * (p->a[0] - p->a[1 + p->lda]);
  double discriminant = half * half + p->a[1] * p->a[p->lda];
  if (discriminant <= 0) return natural;
  return natural * (natural / (fabs(mean) + sqrt(discriminant)));
}

typedef struct rank {
  size_t block;
  bool odd;   // not 2 × 2: last
  bool fast;  // every eigenvalue above the limit: replaced by its static contribution
  double frequency;
} rank;

static int rank_order(const void *a, const void *b) {
  const rank *x = a, *y = b;
  if (x->odd != y->odd) return x->odd ? 1 : -1;
  if (x->frequency != y->frequency) return x->frequency < y->frequency ? -1 : 1;
  return (x->block > y->block) - (x->block < y->block);
}

static void copy_header(const pb_model *from, size_t direct, pb_model *to) {
  to->sample_rate = from->sample_rate;
  to->dof = from->dof;
  memcpy(to->mode_hz, from->mode_hz, from->modes * sizeof(double));
  memcpy(to->mode_damping, from->mode_damping, from->modes * sizeof(double));
  memcpy(to->d, from->d, from->ny * direct * sizeof(double));
}

static pb_status copy_signals(const pb_model *from, pb_model *to, pb_error *err) {
  to->name = from->name ? pb_text_copy(from->name) : NULL;
  bool ok = !from->name || to->name;
  for (size_t i = 0; i < to->nu + to->ny && ok; i++) {
    const pb_signal *s = i < to->nu ? &from->input[i] : &from->output[i - to->nu];
    pb_signal *t = i < to->nu ? &to->input[i] : &to->output[i - to->nu];
    t->name = pb_text_copy(s->name);
    t->unit = pb_text_copy(s->unit);
    ok = t->name && t->unit;
  }
  if (!ok) return pb_fail_memory(err, "");
  return pb_electronics_attach(to, from->input_electronics, from->output_electronics, err);
}

pb_status pb_model_copy_header(const pb_model *from, pb_model *to, pb_error *err) {
  to->sample_rate = from->sample_rate;
  to->dof = from->dof;
  memcpy(to->mode_hz, from->mode_hz, from->modes * sizeof(double));
  memcpy(to->mode_damping, from->mode_damping, from->modes * sizeof(double));
  return copy_signals(from, to, err);
}

// Numbers that are each fine may still overflow in products.
static pb_status check_finite(const pb_model *m, pb_error *err) {
  size_t values = m->block_value[m->blocks];
  if (!pb_all_finite(m->a, values) || !pb_all_finite(m->ad, values))
    return pb_fail(
        err, PB_ERR_NUMERIC, "/components",
        "masses, stiffnesses and dampings are too far apart: the state matrix overflows");
  for (size_t i = 0; i < m->nu; i++)
    if (!pb_all_finite(m->b + i * m->nx, m->nx) || !pb_all_finite(m->bd + i * m->nx, m->nx))
      return pb_fail(err, PB_ERR_NUMERIC, "/inputs", "what %s does to the plant overflows",
                     m->input[i].name);
  for (size_t at = 0; at < m->ny * (m->nx + m->nu); at++) {
    double value = at < m->ny * m->nx ? m->c[at] : m->d[at - m->ny * m->nx];
    if (!isfinite(value))
      return pb_fail(err, PB_ERR_NUMERIC, "/outputs", "what %s sees of the plant overflows",
                     m->output[at % m->ny].name);
  }
  return PB_OK;
}

// What stepping needs besides.
static pb_status make_steps(pb_model *m, pb_error *err) {
  pb_status st = pb_model_discretize(m, err);
  if (!st) st = check_finite(m, err);
  return st ? st : pb_step_pack_model(m, err);
}

// The order of m's blocks; NULL: out of memory.
static rank *rank_blocks(const pb_model *m, double hz) {
  const double limit = hz > 0 ? two_pi * hz : INFINITY;
  rank *order = malloc((m->blocks + 1) * sizeof *order);
  if (!order) return NULL;
  for (size_t k = 0; k < m->blocks; k++) {
    pb_model_part p = part_of(m, k);
    order[k] = (rank){k, p.size != 2, slowest(&p) > limit, pb_block_frequency(p.a, p.size)};
  }
  qsort(order, m->blocks, sizeof *order, rank_order);
  return order;
}

// All are kept, where they are.
static bool nothing_moves(const pb_model *m, const rank *order) {
  for (size_t k = 0; k < m->blocks; k++)
    if (order[k].block != k || order[k].fast) return false;
  return true;
}

// What truncation keeps, and what velocities and accelerations see of the rest.
typedef struct cut {
  const pb_model *m;
  const rank *order;
  size_t direct;         // leading inputs whose columns of d count
  bool pairs;            // with residual pairs
  size_t kept, fast;     // blocks
  size_t nx, values;     // of the blocks that are kept
  pb_residual residual;  // of the others
} cut;

static pb_status cut_make(cut *c, double hz, pb_error *err) {
  pb_status st = pb_residual_open(c->m, c->pairs ? c->direct : 0, two_pi * hz, &c->residual, err);
  for (size_t k = 0; k < c->m->blocks && !st; k++) {
    const pb_model_part p = part_of(c->m, c->order[k].block);
    if (c->order[k].fast)
      c->fast++, st = pb_residual_add(&c->residual, c->m, c->order[k].block, err);
    else
      c->kept++, c->nx += p.size, c->values += p.size * p.size;
  }
  const size_t pairs = st ? 0 : pb_residual_count(&c->residual);
  c->kept += pairs, c->nx += 2 * pairs, c->values += 4 * pairs;
  return st;
}

static pb_status append_residual(const pb_residual *r, pb_model *m, pb_error *err) {
  double a[4], *b = calloc(2 * m->nu + 1, sizeof *b), *c = malloc((3 * m->ny + 1) * sizeof *c);
  pb_status st = b && c ? PB_OK : pb_fail_memory(err, "/max_frequency");
  for (size_t i = 0; i < r->direct && !st; i++) {
    if (!pb_residual_needs(r, i)) continue;
    double *d = c + 2 * m->ny;
    pb_residual_pair(r, i, a, b + 2 * i, c, d);
    append(m,
           &(pb_model_part){.size = 2, .a = a, .lda = 2, .b = b, .ldb = 2, .c = c, .ldc = m->ny});
    for (size_t o = 0; o < m->ny; o++) m->d[o + i * m->ny] += d[o];
    b[2 * i] = b[2 * i + 1] = 0;
  }
  free(b);
  free(c);
  return st;
}

// Blocks of other sizes stay last.
static pb_status fill(const cut *c, pb_model *copy, pb_error *err) {
  bool residual = false;
  pb_status st = PB_OK;
  for (size_t k = 0; k < c->m->blocks && !st; k++) {
    const pb_model_part p = part_of(c->m, c->order[k].block);
    if (c->order[k].odd && !residual) {
      residual = true;
      st = append_residual(&c->residual, copy, err);
    }
    if (st) break;
    if (c->order[k].fast)
      st = add_static(copy, &p, c->direct, err);
    else
      append(copy, &p);
  }
  if (!st && !residual) st = append_residual(&c->residual, copy, err);
  return st;
}

// Accelerations of a copy rest as those of m do.
static pb_status settle_like(const pb_model *m, size_t direct, pb_model *copy, pb_error *err) {
  double *rest = malloc((m->ny * direct + 1) * sizeof *rest);
  pb_status st = rest ? pb_rates_rest(m, direct, rest, err) : pb_fail_memory(err, "/outputs");
  if (!st) st = pb_rates_settle(copy, rest, m->ny, direct, err);
  free(rest);
  return st;
}

// The blocks of m in this order, those above hz (0: none) gone into the first columns of d and,
// where these are wanted, into residual pairs.
static pb_status rebuild(const pb_model *m, const rank *order, double hz, size_t direct, bool pairs,
                         bool steps, pb_model **out, pb_error *err) {
  cut c = {.m = m, .order = order, .direct = direct, .pairs = pairs};
  pb_model *copy = NULL;
  pb_status st = cut_make(&c, hz, err);
  if (!st) copy = pb_model_allocate(c.nx, m->nu, m->ny, m->modes, c.kept, c.values);
  if (!st) st = copy ? copy_signals(m, copy, err) : pb_fail_memory(err, "");
  if (!st) {
    copy_header(m, direct, copy);
    copy->max_frequency = hz;
    copy->blocks = 0;
    st = fill(&c, copy, err);
  }
  if (!st && c.fast) st = settle_like(m, direct, copy, err);
  if (!st && steps) st = make_steps(copy, err);
  pb_residual_close(&c.residual);
  if (st) {
    pb_model_free(copy);
  } else {
    *out = copy;
  }
  return st;
}

pb_status pb_model_narrow(const pb_model *m, size_t nu, size_t ny, pb_model **out, pb_error *err) {
  const size_t values = m->block_value[m->blocks];
  pb_model *n = pb_model_allocate(m->nx, nu, ny, m->modes, m->blocks, values);
  *out = NULL;
  if (!n) return pb_fail_memory(err, "");
  n->sample_rate = m->sample_rate;
  n->max_frequency = m->max_frequency;
  n->dof = m->dof;
  memcpy(n->mode_hz, m->mode_hz, m->modes * sizeof(double));
  memcpy(n->mode_damping, m->mode_damping, m->modes * sizeof(double));
  memcpy(n->block_start, m->block_start, (m->blocks + 1) * sizeof(size_t));
  memcpy(n->block_value, m->block_value, (m->blocks + 1) * sizeof(size_t));
  memcpy(n->a, m->a, values * sizeof(double));
  memcpy(n->b, m->b, m->nx * nu * sizeof(double));
  for (size_t j = 0; j < m->nx; j++) memcpy(n->c + j * ny, m->c + j * m->ny, ny * sizeof(double));
  for (size_t i = 0; i < nu; i++) memcpy(n->d + i * ny, m->d + i * m->ny, ny * sizeof(double));
  pb_status st = copy_signals(m, n, err);
  if (!st) st = make_steps(n, err);
  if (st)
    pb_model_free(n);
  else
    *out = n;
  return st;
}

pb_status pb_model_builder_close(pb_model_builder *b, double max_frequency, pb_model **out,
                                 pb_error *err) {
  pb_status st = PB_OK;
  if (b->rest) st = pb_rates_settle(b->model, b->rest, b->rest_rows, b->direct, err);
  rank *order = st ? NULL : rank_blocks(b->model, max_frequency);
  if (!order) {
    if (!st) st = pb_fail_memory(err, "");
  } else if (nothing_moves(b->model, order) &&
             b->model->block_start[b->model->blocks] == b->model->nx) {
    b->model->max_frequency = max_frequency;
    if (!b->plain) st = make_steps(b->model, err);
    if (!st) {
      *out = b->model;
      b->model = NULL;
    }
  } else {
    st = rebuild(b->model, order, max_frequency, b->direct, true, !b->plain, out, err);
  }
  free(order);
  pb_model_builder_discard(b);
  return st;
}

pb_status pb_model_truncate(const pb_model *model, double hz, pb_model **out, pb_error *err) {
  *out = NULL;
  if (!(hz > 0)) return pb_fail(err, PB_ERR_ARGUMENT, "max_frequency", "expected a number > 0");
  rank *order = rank_blocks(model, hz);
  if (!order) return pb_fail_memory(err, "max_frequency");
  pb_status st = rebuild(model, order, hz, model->nu, false, true, out, err);
  free(order);
  return st;
}

pb_status pb_model_discretize(pb_model *m, pb_error *err) {
  m->pairs = m->widest = 0;
  for (size_t k = 0; k < m->blocks; k++) {
    size_t size = m->block_start[k + 1] - m->block_start[k];
    if (size > m->widest) m->widest = size;
    if (size == 2 && m->pairs == k) m->pairs++;
  }
  double *gd = pb_array_new(m->widest * m->widest + 1, sizeof *gd);
  if (!gd) return pb_fail_memory(err, "");
  pb_status st = PB_OK;
  for (size_t k = 0; k < m->blocks && !st; k++) {
    size_t start = m->block_start[k], n = m->block_start[k + 1] - start, at = m->block_value[k];
    st = pb_block_discretize(n, m->a + at, 1 / m->sample_rate, m->ad + at, gd, err);
    for (size_t i = 0; i < m->nu && !st; i++) {
      const double *b = m->b + start + i * m->nx;
      double *bd = m->bd + start + i * m->nx;
      for (size_t r = 0; r < n; r++) {
        bd[r] = 0;
        for (size_t c = 0; c < n; c++) bd[r] += gd[r + c * n] * b[c];
      }
    }
  }
  free(gd);
  return st;
}
