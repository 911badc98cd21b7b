// Fixed-interface modes by block Lanczos (reduce_lanczos.h): until those that are wanted have
// converged, and the proof that none is missing.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "part/reduce_lanczos.h"

static const double two_pi = 6.283185307179586476925286766559;
static const double tolerance = 1e-10;      // of the residual, relative to θ
static const double next_tolerance = 1e-5;  // of the first mode that is not kept
static const double rounding = 1e-14;       // of θ, relative to the largest
static const double distinct = 1e-5;        // of two frequencies, to count between them

// ---- how many -----------------------------------------------------------------------------------

// What rounding leaves of θ = 0 is no mode: the last block reaches beyond the space.
static bool is_mode(const lanczos *z, size_t i) {
  return i < z->ritz && i < z->limit && lanczos_omega2(z, i) > 0 &&
         lanczos_omega2(z, i) < lanczos_omega2(z, 0) / rounding;
}

// How many modes the present Ritz values promise: by count, or all up to max_hz.
static size_t wanted(const lanczos *z) {
  const pb_reduce_options *o = z->w->options;
  if (!(o->max_hz > 0)) return o->modes;
  double top = two_pi * o->max_hz;
  size_t count = 0;
  while (is_mode(z, count) && lanczos_omega2(z, count) <= top * top) count++;
  return o->modes && o->modes < count ? o->modes : count;
}

// The first mode beyond is needed too, roughly: it says that there are no more, and between it and
// the last one is the place to count.
// used_up: the basis holds all that M moves.
static bool is_done(const lanczos *z, bool used_up, size_t *converged) {
  size_t p = wanted(z);
  *converged = 0;
  while (*converged < p && *converged < z->ritz && lanczos_residual(z, *converged) <= tolerance)
    ++*converged;
  if (*converged < p) return false;
  bool proven = z->w->options->max_hz > 0 || z->w->options->prove;
  return used_up || !proven || (is_mode(z, p) && lanczos_residual(z, p) <= next_tolerance);
}

static pb_status fail_missing(const lanczos *z, pb_error *err) {
  return pb_fail(err, PB_ERR_ARGUMENT, z->w->fem->name,
                 "%zu fixed-interface modes are asked for; the model has %zu", z->w->options->modes,
                 z->ritz);
}

static pb_status iterate(lanczos *z, pb_error *err) {
  pb_status st = PB_OK;
  size_t checked = 0, converged = 0;
  bool done = false;
  while (!st && !done) {
    if (!z->block) st = lanczos_append_random(z, err);
    bool dry = !z->block;
    if (!st && !dry) st = lanczos_extend(z, err);
    size_t n = z->k - z->block;
    bool check = dry || !z->block || n >= checked + BLOCK + n / 32;
    if (st || (!dry && (!check || n < z->w->options->modes))) continue;
    st = lanczos_decompose(z, err);
    if (st) break;
    checked = n;
    done = is_done(z, dry || n >= z->limit, &converged);
    if (!done && dry) return fail_missing(z, err);
    st = reduce_progress(z->w, PB_REDUCE_MODES, (double)converged,
                         z->w->options->max_hz > 0 ? 0 : (double)z->w->options->modes, err);
  }
  return st;
}

// Phi = Q S of the first p.
static pb_status extract(lanczos *z, size_t p, pb_error *err) {
  reduce_work *w = z->w;
  double *phi = malloc((z->full * p + 1) * sizeof *phi);
  double *omega2 = malloc((p + 1) * sizeof *omega2);
  pb_status st = phi && omega2 ? PB_OK : pb_fail_memory(err, w->fem->name);
  if (!st) st = lanczos_vectors(z, p, phi, err);
  if (st) {
    free(phi);
    free(omega2);
    return st;
  }
  for (size_t i = 0; i < p; i++) omega2[i] = lanczos_omega2(z, i);
  free(w->phi);
  free(w->omega2);
  w->phi = phi;
  w->omega2 = omega2;
  w->modes = p;
  w->next_omega2 = is_mode(z, p) ? lanczos_omega2(z, p) : INFINITY;
  return PB_OK;
}

// Starts again beside the modes found: A Φ = Φ Θ, so nothing leads out of them.
static void lock(lanczos *z) {
  size_t p = z->w->modes;
  if (p) memcpy(z->q, z->w->phi, p * z->full * sizeof *z->q);
  if (z->room) memset(z->h, 0, z->room * z->room * sizeof *z->h);
  for (size_t i = 0; i < p; i++) z->h[i + i * z->room] = 1 / z->w->omega2[i];
  z->k = p;
  z->block = 0;
}

// Where to count, and how many are below: between two modes that are apart, at the cut or beneath
// it. A cut through equal frequencies is no such place.
static size_t place_of_count(const reduce_work *w, double *hz) {
  size_t count = w->modes;
  double last = count ? sqrt(w->omega2[count - 1]) : 0;
  double above = isfinite(w->next_omega2) ? sqrt(w->next_omega2) : 1.5 * last;
  while (count && above - last < distinct * above) {
    above = last;
    last = --count ? sqrt(w->omega2[count - 1]) : 0;
  }
  *hz = (last + above) / 2 / two_pi;
  return count;
}

// Sylvester's law of inertia: as many negative pivots of K − σM under the constraints as modes
// below σ. Where modes are missing (more of one frequency than a block has vectors) they are looked
// for beside those found.
static pb_status prove(lanczos *z, pb_error *err) {
  reduce_work *w = z->w;
  pb_status st = PB_OK;
  for (size_t missing = SIZE_MAX; !st;) {
    double hz;
    size_t below = 0, free_below = 0, found = place_of_count(w, &hz);
    if (!(hz > 0)) break;  // the model has no modes at all
    st = reduce_count(w, hz, &below, &free_below, err);
    if (st) break;
    w->out->proven_hz = hz;
    if (below == found) break;
    if (below < found || below - found >= missing)
      return pb_fail(err, PB_ERR_NUMERIC, w->fem->name,
                     "%zu modes were found below %.6g Hz where the model has %zu", found, hz,
                     below);
    missing = below - found;
    lock(z);
    st = iterate(z, err);
    if (!st) st = extract(z, wanted(z), err);
  }
  return st;
}

static pb_status run(lanczos *z, pb_error *err) {
  const pb_reduce_options *o = z->w->options;
  if (!(o->max_hz > 0) && o->modes > z->limit) {
    z->ritz = z->limit;
    return fail_missing(z, err);
  }
  if (!(o->max_hz > 0) && !o->modes) return extract(z, 0, err);
  pb_status st = iterate(z, err);
  if (!st) st = extract(z, wanted(z), err);
  if (!st && (o->max_hz > 0 || o->prove)) st = prove(z, err);
  return st;
}

pb_status reduce_modes(reduce_work *w, pb_error *err) {
  pb_status st = reduce_begin(w, PB_REDUCE_MODES, err);
  lanczos z = {.w = w, .full = w->full};
  size_t free_rows = w->factor.n + w->pins;
  z.limit = free_rows > 6 * w->averaged ? free_rows - 6 * w->averaged : 0;
  if (!st) st = lanczos_begin(&z, err);
  if (!st) st = run(&z, err);
  lanczos_clear(&z);
  return st;
}
