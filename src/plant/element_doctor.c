// What is wrong with an element's matrices: see element_doctor.h.
//
// One walk through a working copy: each step looks, notes what it finds and cures the copy, so that
// the next step sees what a repaired element would show.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "plant/element_doctor_internal.h"

// ---- working copy -------------------------------------------------------------------------------

static pb_status copy_data(const char *name, const pb_element_data *from, pb_element_data *to,
                           pb_error *err) {
  size_t bytes = from->size * from->size * sizeof(double),
         places = 3 * from->frames * sizeof(double);
  *to = (pb_element_data){.frames = from->frames, .size = from->size};
  to->position = malloc(places);
  to->k = malloc(bytes);
  to->m = malloc(bytes);
  if (!to->position || !to->k || !to->m) {
    pb_element_data_clear(to);
    return pb_fail_memory(err, name);
  }
  memcpy(to->position, from->position, places);
  memcpy(to->k, from->k, bytes);
  memcpy(to->m, from->m, bytes);
  return PB_OK;
}

static bool all_finite(const double *x, size_t count) {
  for (size_t i = 0; i < count; i++)
    if (!(fabs(x[i]) <= 1e30)) return false;
  return true;
}

// ---- single matrices ----------------------------------------------------------------------------

static bool check_numbers(const pb_element_data *w, pb_diagnosis *d) {
  size_t n = w->size;
  bool k = all_finite(w->k, n * n), m = all_finite(w->m, n * n);
  bool p = all_finite(w->position, 3 * w->frames);
  if (k && m && p) return true;
  pb_finding *f = pb_doctor_note(d, PB_FINDING_NOT_FINITE, false);
  snprintf(f->saw, sizeof f->saw, "%s has entries that are not finite or above 1e30",
           !k   ? "K"
           : !m ? "M"
                : "int_xyz");
  snprintf(f->would, sizeof f->would, "not curable here: export the part again");
  return false;
}

static void treat_half(double *x, size_t n, const char *which, pb_diagnosis *d) {
  char half = pb_measure_half(x, n);
  if (!half) return;
  pb_finding *f = pb_doctor_note(d, PB_FINDING_HALF_STORED, true);
  snprintf(f->saw, sizeof f->saw, "%s is stored by its %s triangle only", which,
           half == 'u' ? "upper" : "lower");
  snprintf(f->would, sizeof f->would, "mirrors it");
  pb_cure_mirror(x, n, half);
}

// Rounding of printed digits differs by one in the last place; beyond that K is another matrix.
static void treat_asymmetry(double *x, size_t n, const char *which, int digits, pb_diagnosis *d) {
  double asymmetry = pb_measure_asymmetry(x, n), allowed = fmax(1e-3, 2 * pow(10, 1 - digits));
  if (asymmetry > 1e-9) {
    pb_finding *f = pb_doctor_note(d, PB_FINDING_ASYMMETRIC, asymmetry <= allowed);
    snprintf(f->saw, sizeof f->saw, "%s differs from its transpose by %.1e of its diagonal", which,
             asymmetry);
    snprintf(f->would, sizeof f->would, "%s",
             asymmetry <= allowed
                 ? "takes the mean with the transpose"
                 : "not curable here: this is more than rounding; export the part again");
  }
  pb_cure_mean(x, n);
}

static pb_status treat_mass(const char *name, pb_element_data *w, pb_diagnosis *d, pb_error *err) {
  pb_status st = pb_measure_mass(name, w, &d->mass_smallest, err);
  if (st || d->mass_smallest > 0) return st;
  double rounding = (double)w->size * pow(10, 1 - d->digits_m);
  bool curable = isfinite(d->mass_smallest) && -d->mass_smallest < fmin(rounding, 0.05);
  pb_finding *f = pb_doctor_note(d, PB_FINDING_INDEFINITE_MASS, curable);
  if (isfinite(d->mass_smallest))
    snprintf(f->saw, sizeof f->saw,
             "M is not positive definite: with unit diagonal its smallest eigenvalue is %.2g",
             d->mass_smallest);
  else
    snprintf(f->saw, sizeof f->saw, "M has a diagonal entry that is not positive");
  snprintf(f->would, sizeof f->would, "%s",
           curable ? "lifts the eigenvalue to what rounding leaves uncertain"
                   : "not curable here: rounding does not explain it; export the part again");
  return curable ? pb_cure_mass(name, w, fmax(-d->mass_smallest, 1e-9), err) : PB_OK;
}

// Few digits show in the rigid motions first; numbers that are merely round harm nobody.
static bool digits_lost(const pb_diagnosis *d, double rigid, double flexible) {
  return (d->digits_k <= 8 || d->digits_m <= 8) && fabs(rigid) > 1e-4 * fabs(flexible);
}

static void note_digits(pb_diagnosis *d) {
  pb_finding *f = pb_doctor_note(d, PB_FINDING_FEW_DIGITS, true);
  snprintf(f->saw, sizeof f->saw, "K has %d and M %d significant digits", d->digits_k, d->digits_m);
  snprintf(f->would, sizeof f->would,
           "projects K on the complement of the rigid motions, which are lost first; an export "
           "with more digits is better");
}

// ---- the body -----------------------------------------------------------------------------------

static double rounding_of(const pb_diagnosis *d) {
  return fmax(1e-5, 20 * pow(10, -d->digits_k));
}

static void measure_body(const pb_element_data *w, pb_diagnosis *d) {
  d->mass = d->extent = 0;
  for (size_t g = 0; g < w->frames; g++) {
    for (size_t f = 0; f < w->frames; f++) {
      double apart = 0;
      for (size_t a = 0; a < 3; a++) {
        d->mass += w->m[6 * f + a + (6 * g + a) * w->size] / 3;
        apart += pow(w->position[3 * f + a] - w->position[3 * g + a], 2);
      }
      d->extent = fmax(d->extent, sqrt(apart));
    }
  }
}

// Mass per cube of the frames' extent: of aluminium foam to tungsten blocks, with room on either
// side for parts that are long or stick out of their frames.
static void treat_units(pb_element_data *w, const pb_doctor_options *options, pb_diagnosis *d) {
  measure_body(w, d);
  if (!(d->extent > 0) || !(d->mass > 0) || options->trust_units) return;
  double density = d->mass / pow(d->extent, 3);
  if (density > 1e-4 || density * 1e12 < 1 || density * 1e12 > 1e6) return;
  pb_finding *f = pb_doctor_note(d, PB_FINDING_UNITS, true);
  snprintf(f->saw, sizeof f->saw,
           "in SI this is %.3g kg over %.3g m, lighter than air; in mm, t, N, s it is %.3g kg over "
           "%.3g mm",
           d->mass, d->extent, 1e3 * d->mass, d->extent);
  snprintf(f->would, sizeof f->would, "converts coordinates, K and M from mm, t, N, s to SI");
  pb_element_convert(w, 1e-3, 1, 1);
  measure_body(w, d);
}

static int magnitude_order(const void *a, const void *b) {
  double x = fabs(*(const double *)a), y = fabs(*(const double *)b);
  return (x > y) - (x < y);
}

// rigid [6] and the first flexible frequency; NaN where M is not definite, which was judged before.
static pb_status measure_rigid_hz(const char *name, const pb_element_data *w, const double *omega2,
                                  double *rigid, double *flexible, pb_error *err) {
  double *hz = malloc(w->size * sizeof *hz);
  if (!hz) return pb_fail_memory(err, name);
  pb_status st = omega2 ? PB_OK : pb_measure_modes(name, w->size, w->k, w->m, hz, NULL, err);
  for (size_t i = 0; omega2 && i < w->size; i++) hz[i] = pb_signed_hz(omega2[i]);
  if (!st) qsort(hz, w->size, sizeof *hz, magnitude_order);
  for (int k = 0; k < 6; k++) rigid[k] = st ? NAN : hz[k];
  *flexible = st ? NAN : w->size > 6 ? hz[6] : INFINITY;
  free(hz);
  return st == PB_ERR_ELEMENT ? PB_OK : st;
}

// Same bounds as the loader's warning.
static bool moves_freely(const double *rigid, double flexible) {
  double worst = fabs(rigid[5]);
  return worst <= 1e-2 * fabs(flexible) && worst <= 10;
}

// The eigenvalues know nothing of coordinates: it is K R that tells whether they fit.
static pb_status treat_frames(const char *name, pb_element_data *w, pb_diagnosis *d,
                              pb_error *err) {
  double tolerance = rounding_of(d), *r = malloc(6 * w->size * sizeof *r);
  if (!r) return pb_fail_memory(err, name);
  pb_rigid_motions(w, r);
  pb_measure_rigid(w, r, &d->translation_residual, &d->rotation_residual);
  free(r);
  if (d->translation_residual <= tolerance && d->rotation_residual <= tolerance) return PB_OK;
  return pb_doctor_place(name, w, tolerance, d, err);
}

static bool curable(const pb_diagnosis *d) {
  for (size_t k = 0; k < d->findings; k++)
    if (!d->finding[k].curable) return false;
  return true;
}

static pb_status treat_rigid(const char *name, pb_element_data *w, const double *omega2,
                             const pb_doctor_options *options, pb_diagnosis *d, pb_error *err) {
  double rigid[6], flexible;
  if (!curable(d)) return PB_OK;
  const double *known = d->findings ? NULL : omega2;  // what was found was cured: w is another
  pb_status st = measure_rigid_hz(name, w, known, rigid, &flexible, err);
  if (st) return st;
  const bool bad = !moves_freely(rigid, flexible), lost = digits_lost(d, rigid[5], flexible);
  if (!bad && !lost) return PB_OK;
  if (lost) note_digits(d);
  st = pb_cure_rigid(name, w, options->weighted, &d->change, err);
  if (st || !bad) return st;
  pb_finding *f = pb_doctor_note(d, PB_FINDING_RIGID_MOTIONS, d->change < 0.02);
  snprintf(f->saw, sizeof f->saw,
           "rigid motions of the free part have up to %.4g Hz instead of 0 (first flexible mode "
           "%.5g Hz)",
           rigid[5], flexible);
  snprintf(f->would, sizeof f->would, "%s (a change of K by %.1e)",
           f->curable ? "projects K on the complement of the rigid motions"
                      : "not curable here: the projection would change K by more than rounding can",
           d->change);
  return st;
}

// omega2: the free eigenvalues where they are known, and with them that M is positive definite.
static pb_status walk(const char *name, pb_element_data *w, const double *omega2,
                      const pb_doctor_options *options, pb_diagnosis *d, pb_error *err) {
  size_t n = w->size;
  if (!check_numbers(w, d)) return PB_OK;
  d->digits_k = pb_measure_digits(w->k, n);
  d->digits_m = pb_measure_digits(w->m, n);
  d->asymmetry_k = pb_measure_asymmetry(w->k, n);
  d->asymmetry_m = pb_measure_asymmetry(w->m, n);
  treat_half(w->k, n, "K", d);
  treat_half(w->m, n, "M", d);
  treat_asymmetry(w->k, n, "K", d->digits_k, d);
  treat_asymmetry(w->m, n, "M", d->digits_m, d);
  pb_status st = omega2 ? PB_OK : treat_mass(name, w, d, err);
  if (!st) st = measure_rigid_hz(name, w, omega2, d->rigid_hz, &d->flexible_hz, err);
  if (!st) st = treat_frames(name, w, d, err);
  if (!st) treat_units(w, options, d);
  if (!st) st = treat_rigid(name, w, omega2, options, d, err);
  return st;
}

static pb_status diagnose(const char *name, const pb_element_data *data, const double *omega2,
                          const pb_doctor_options *options, pb_diagnosis *out,
                          pb_element_data *cured, pb_error *err) {
  static const pb_doctor_options none;
  pb_element_data w;
  *out = (pb_diagnosis){.frames = data->frames, .size = data->size, .mass_smallest = NAN};
  for (int k = 0; k < 6; k++) out->rigid_hz[k] = NAN;
  out->flexible_hz = NAN;
  if (cured) *cured = (pb_element_data){0};
  pb_status st = copy_data(name, data, &w, err);
  if (st) return st;
  st = walk(name, &w, omega2, options ? options : &none, out, err);
  for (size_t k = 0; !st && cured && k < out->findings; k++)
    if (!out->finding[k].curable)
      st = pb_fail(err, PB_ERR_ELEMENT, name, "cannot be repaired: %s", out->finding[k].saw);
  if (!st && cured) {
    *cured = w;
    w = (pb_element_data){0};
  }
  pb_element_data_clear(&w);
  return st;
}

pb_status pb_element_diagnose(const char *name, const pb_element_data *data,
                              const pb_doctor_options *options, pb_diagnosis *out,
                              pb_element_data *cured, pb_error *err) {
  return diagnose(name, data, NULL, options, out, cured, err);
}

pb_status pb_element_check(const pb_element *element, pb_diagnosis *out, pb_error *err) {
  const pb_element_data view = {.frames = element->frames,
                                .size = element->size,
                                .position = element->position,
                                .k = element->k,
                                .m = element->m};
  return diagnose(element->file, &view, element->omega2, NULL, out, NULL, err);
}
