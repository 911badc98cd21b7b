// How long from a plant file to a running model, phase by phase, and what does LAPACK need for the
// modes alone?
//
// Baseline: the undamped modes by dsygvd of the plant's own K and M, and the damped ones with their
// vectors by dgeev of [[0, I], [−M⁻¹K, −M⁻¹C]]: what a general program does with the same
// matrices, without reading, assembling, outputs or discretisation. All with one BLAS thread, as in
// the daemon.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "assembly/system.h"
#include "base/json.h"
#include "base/lapack.h"
#include "base/text.h"
#include "bench.h"
#include "model/transfer.h"
#include "plants.h"
#include "pool.h"

// ---- ours: time by phase ------------------------------------------------------------------------

typedef struct stopwatch {
  double seconds[PB_PHASES], since;
  int phase;  // −1: none yet
} stopwatch;

static void stop(stopwatch *w) {
  const double now = bench_now();
  if (w->phase >= 0) w->seconds[w->phase] += now - w->since;
  w->since = now;
}

static void begin_phase(void *context, pb_phase phase) {
  stopwatch *w = context;
  stop(w);
  w->phase = (int)phase;
}

// One load; seconds by phase. workers NULL: this thread only.
static void load_once(const char *path, const pb_workers *workers, double seconds[PB_PHASES]) {
  stopwatch w = {.phase = -1};
  const pb_observer observer = {begin_phase, &w};
  const pb_means means = {.observer = &observer, .workers = workers};
  pb_model *model = NULL;
  pb_error err = {0};
  bench_check(pb_model_load_with(path, &means, NULL, &model, &err), &err);
  stop(&w);
  pb_model_free(model);
  memcpy(seconds, w.seconds, sizeof w.seconds);
}

static double total(const double seconds[PB_PHASES]) {
  double sum = 0;
  for (int k = 0; k < PB_PHASES; k++) sum += seconds[k];
  return sum;
}

// ---- the baseline -------------------------------------------------------------------------------

typedef struct dense {
  pb_plant *plant;
  pb_system *system;
  int n;
} dense;

static dense dense_open(const char *path) {
  dense d = {0};
  pb_error err = {0};
  bench_check(pb_plant_load(path, NULL, &d.plant, &err), &err);
  bench_check(pb_system_assemble(d.plant, NULL, &d.system, &err), &err);
  d.n = (int)d.system->n;
  return d;
}

static void dense_close(dense *d) {
  pb_system_free(d->system);
  pb_plant_free(d->plant);
}

static void undamped(const dense *d) {
  const size_t n = d->system->n;
  int size = d->n, type = 1, info, lwork = 1 + 6 * size + 2 * size * size, liwork = 3 + 5 * size;
  double *k = bench_memory(n * n, sizeof *k), *m = bench_memory(n * n, sizeof *m);
  double *w = bench_memory(n, sizeof *w), *work = bench_memory((size_t)lwork, sizeof *work);
  int *iwork = bench_memory((size_t)liwork, sizeof *iwork);
  memcpy(k, d->system->k, n * n * sizeof *k);
  memcpy(m, d->system->m, n * n * sizeof *m);
  dsygvd_(&type, "V", "U", &size, k, &size, m, &size, w, work, &lwork, iwork, &liwork, &info);
  if (info) bench_fail("dsygvd: %d", info);
  free(k);
  free(m);
  free(w);
  free(work);
  free(iwork);
}

static void damped(const dense *d) {
  const size_t n = d->system->n, nx = 2 * n;
  int size = d->n, states = 2 * size, info, lwork = 64 * states, one = 1;
  double *m = bench_memory(n * n, sizeof *m), *a = bench_memory(nx * nx, sizeof *a);
  double *v = bench_memory(nx * nx, sizeof *v), *w = bench_memory(2 * nx, sizeof *w);
  double *work = bench_memory((size_t)lwork, sizeof *work), none;
  memcpy(m, d->system->m, n * n * sizeof *m);
  for (size_t j = 0; j < n; j++) {
    a[j + (n + j) * nx] = 1;
    for (size_t i = 0; i < n; i++) {
      a[n + i + j * nx] = -d->system->k[i + j * n];
      a[n + i + (n + j) * nx] = -d->system->c[i + j * n];
    }
  }
  dpotrf_("U", &size, m, &size, &info);
  if (!info) dpotrs_("U", &size, &states, m, &size, a + n, &states, &info);
  if (!info)
    dgeev_("N", "V", &states, a, &states, w, w + nx, &none, &one, v, &states, work, &lwork, &info);
  if (info) bench_fail("dgeev: %d", info);
  free(m);
  free(a);
  free(v);
  free(w);
  free(work);
}

static double solve_dense(const dense *d) {
  const double since = bench_now();
  undamped(d);
  damped(d);
  return bench_now() - since;
}

// ---- turn by turn -------------------------------------------------------------------------------

typedef struct run {
  double phase[PB_PHASES], total, shared, dense, ratio;  // medians; shared: by all processors
} run;

static double median(double *value, size_t count) {
  return bench_stats_of(value, count).median;
}

static run measure(bench *b, const char *path, size_t states) {
  enum { MOST = 41 };
  const size_t repeats = states > 1000 ? 3 : bench_quick(b) ? 7 : MOST;
  double phase[PB_PHASES][MOST], sum[MOST], shared[MOST], base[MOST], ratio[MOST];
  double seconds[PB_PHASES];
  dense d = dense_open(path);
  pb_pool pool;
  run out;
  pb_pool_open(&pool);
  load_once(path, NULL, seconds);  // the first one fills caches of the C library and of BLAS
  for (size_t k = 0; k < repeats; k++) {
    load_once(path, &pool.workers, seconds);
    shared[k] = total(seconds);
    load_once(path, NULL, seconds);
    for (int p = 0; p < PB_PHASES; p++) phase[p][k] = seconds[p];
    sum[k] = total(seconds);
    base[k] = k > 0 && states > 1000 ? base[0] : solve_dense(&d);  // seconds long: once is enough
    ratio[k] = base[k] / sum[k];
  }
  for (int p = 0; p < PB_PHASES; p++) out.phase[p] = median(phase[p], repeats);
  out.total = median(sum, repeats);
  out.shared = median(shared, repeats);
  out.dense = median(base, repeats);
  out.ratio = median(ratio, repeats);
  dense_close(&d);
  pb_pool_close(&pool);
  return out;
}

// ---- a change of a running plant, as the daemon makes it ----------------------------------------

// The first mass of the file (its platform, payload or a body) a per cent larger.
static bool mass_change(cJSON *json) {
  cJSON *item;
  cJSON_ArrayForEach(item, json) {
    if (item->string && !strcmp(item->string, "mass") && cJSON_IsNumber(item)) {
      cJSON_SetNumberValue(item, 1.01 * item->valuedouble);
      return true;
    }
    if (mass_change(item)) return true;
  }
  return false;
}

static char *changed_text(const char *path) {
  cJSON *json = NULL;
  char *text = NULL;
  pb_error err = {0};
  bench_check(pb_json_read(path, &json, NULL, &err), &err);
  if (!mass_change(json)) bench_fail("%s: has no mass", path);
  bench_check(pb_json_print(json, &text, &err), &err);
  cJSON_Delete(json);
  return text;
}

// With the map and the transfer that carry a running plant's motion over, its elements and modes
// being those that run, shared among the processors.
typedef struct changed {
  double mass, signal;  // s, medians: everything is solved for anew; no mode is
} changed;

typedef struct running {
  char *directory, *text[2];  // the plant's file, and with another mass
  pb_element_store elements;
  pb_mode_store modes;
  pb_pool pool;
  pb_model *model;
  pb_motion_map *map;
} running;

static void compile_running(running *r, int which, pb_model **model, pb_motion_map **map) {
  pb_error err = {0};
  const pb_means means = {
      .workers = &r->pool.workers, .elements = &r->elements, .modes = which ? NULL : &r->modes};
  bench_check(pb_model_parse_with(r->text[which], strlen(r->text[which]), r->directory, &means,
                                  NULL, model, map, NULL, &err),
              &err);
}

// From what runs, the file as it is, to `which` text.
static double change_once(running *r, int which) {
  pb_model *model = NULL;
  pb_motion_map *map = NULL;
  pb_transfer *transfer = NULL;
  pb_error err = {0};
  const double since = bench_now();
  compile_running(r, which, &model, &map);
  bench_check(pb_transfer_new(r->model, r->map, model, map, &r->pool.workers, &transfer, &err),
              &err);
  const double seconds = bench_now() - since;
  pb_transfer_free(transfer);
  pb_model_free(model);
  pb_motion_map_free(map);
  return seconds;
}

static changed measure_changed(const char *path, size_t states) {
  running r = {.directory = strdup(path), .text = {NULL, changed_text(path)}};
  size_t length;
  pb_error err = {0};
  if (!r.directory) bench_fail("out of memory");
  *strrchr(r.directory, '/') = '\0';
  bench_check(pb_text_read(path, &r.text[0], &length, &err), &err);
  pb_pool_open(&r.pool);
  compile_running(&r, 0, &r.model, &r.map);
  double seconds[2][11];
  const size_t repeats = states > 1000 ? 3 : 11;
  for (size_t k = 0; k < repeats; k++) {
    seconds[0][k] = change_once(&r, 1);
    seconds[1][k] = change_once(&r, 0);
  }
  pb_model_free(r.model);
  pb_motion_map_free(r.map);
  pb_pool_close(&r.pool);
  pb_mode_store_clear(&r.modes);
  pb_element_store_clear(&r.elements);
  free(r.text[0]);
  free(r.text[1]);
  free(r.directory);
  return (changed){median(seconds[0], repeats), median(seconds[1], repeats)};
}

static const bench_column columns[] = {
    {"states", "states", NULL, 4},
    {"read", "read", "ms", 3},
    {"assemble", "assemble", "ms", 3},
    {"eliminate", "eliminate", "ms", 3},
    {"modes", "modes", "ms", 3},
    {"damp", "damped modes", "ms", 3},
    {"discretize", "discretise", "ms", 3},
    {"total", "file to model", "ms", 4},
    {"shared", "on all processors", "ms", 4},
    {"mass", "a mass changed", "ms", 4},
    {"signal", "a gain changed", "ms", 4},
    {"dense", "dsygvd and dgeev", "ms", 4},
    {"ratio", "ratio", NULL, 3},
};

static const struct {
  size_t states;
  double seconds;  // the goal, told and not judged
  double ratio;    // a fifth below what was measured, so that a regression is seen
} goals[] = {{48, 5e-3, 0.4}, {252, 0.1, 1.3}, {2100, 3, 2.8}};

static void judge(bench *b, const bench_plant *plant, const run *r, const changed *c) {
  for (size_t k = 0; k < sizeof goals / sizeof goals[0]; k++) {
    char what[160];
    if (plant->model->nx != goals[k].states) continue;
    snprintf(what, sizeof what, "%zu states: file to model beside dsygvd and dgeev alone",
             goals[k].states);
    bench_goal(b, what, r->ratio, BENCH_AT_LEAST, goals[k].ratio);
    snprintf(what, sizeof what, "%zu states: file to model", goals[k].states);
    bench_target(b, what, 1e3 * r->shared, "ms", BENCH_AT_MOST, 1e3 * goals[k].seconds);
    snprintf(what, sizeof what, "%zu states: a mass changed while it runs", goals[k].states);
    bench_target(b, what, 1e3 * c->mass, "ms", BENCH_AT_MOST, 1e3 * goals[k].seconds);
    snprintf(what, sizeof what, "%zu states: a gain changed while it runs", goals[k].states);
    bench_target(b, what, 1e3 * c->signal, "ms", BENCH_AT_MOST, 1e3 * goals[k].seconds);
  }
}

int main(int argc, char **argv) {
  bench *b = bench_begin(argc, argv, "compile", "How long from a plant file to a running model?");
  bench_blas_threads(1);
  bench_plants plants = bench_plants_load(bench_quick(b) ? 1000 : 0);
  bench_table *t = bench_table_add(b, "compile", "From plant file to model", "plant",
                                   sizeof columns / sizeof columns[0], columns);
  for (size_t k = 0; k < plants.count; k++) {
    const bench_plant *p = &plants.item[k];
    const size_t nx = p->model->nx;
    const run r = measure(b, p->path, nx);
    const changed c = measure_changed(p->path, nx);
    double row[] = {(double)nx, r.phase[0], r.phase[1],    r.phase[2], r.phase[3],
                    r.phase[4], r.phase[5], r.total,       r.shared,   c.mass,
                    c.signal,   r.dense,    1e-3 * r.ratio};
    for (size_t i = 1; i < sizeof row / sizeof row[0]; i++) row[i] *= 1e3;
    bench_row(t, p->name, row);
    judge(b, p, &r, &c);
  }
  bench_growth(b, t, "states", "total", 100);
  bench_growth(b, t, "states", "dense", 100);
  bench_note(b,
             "phases and ratio: one thread; changed: as the daemon makes it, with the map and the "
             "transfer of the motion, elements and modes kept from the plant that runs");
  if (bench_quick(b)) bench_note(b, "quick: without plants above 1000 states");
  bench_plants_free(&plants);
  return bench_end(b);
}
