// Spectra of the motions under the disturbance: measured from the samples, and predicted from the
// spectrum of what disturbed. See run.h.
//
//   S_i(f) = Σ_j |H_ij(f)|² S_j(f)
//
// with H the predicted response and S_j of the applied disturbances, which do not correlate: by
// chance, or, over the stages of orthogonal multisines, exactly.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "run.h"
#include "signal/psd.h"

// A record under way: the last `length` samples that follow one another.
typedef struct spectra {
  const run_result *r;
  pb_experiment_layout layout;
  size_t length, hop;  // of a segment; from one to the next
  size_t signals;      // disturbances, then motions
  pb_psd **psd;        // [signals]
  double *window;      // [length][signals] the segment under way
  size_t fill;
  double *row;  // [nu + ny]
} spectra;

static pb_status spectra_new(const run_result *r, const pb_experiment_layout *layout, size_t period,
                             spectra *s, pb_error *err) {
  const control_design *d = r->design;
  bool periodic = r->experiment.excitation != PB_EXCITE_NOISE;
  *s = (spectra){
      .r = r, .layout = *layout, .length = period, .signals = d->disturbances + d->motions};
  // Whole periods need no window and no overlap.
  s->hop = periodic ? s->length : s->length / 2;
  s->psd = calloc(s->signals, sizeof(pb_psd *));
  s->window = malloc(s->length * s->signals * sizeof *s->window);
  s->row = malloc((d->model->nu + d->model->ny) * sizeof *s->row);
  if (!s->psd || !s->window || !s->row) return pb_fail_memory(err, "spectra");
  pb_status status = PB_OK;
  for (size_t k = 0; k < s->signals && status == PB_OK; k++) {
    status = pb_psd_new(d->model->sample_rate, s->length,
                        periodic ? PB_WINDOW_RECTANGULAR : r->experiment.window, &s->psd[k], err);
  }
  return status;
}

static void spectra_clear(spectra *s) {
  for (size_t k = 0; s->psd && k < s->signals; k++) pb_psd_free(s->psd[k]);
  free(s->psd);
  free(s->window);
  free(s->row);
}

static void take(spectra *s) {
  const control_design *d = s->r->design;
  double *to = s->window + s->fill++ * s->signals;
  for (size_t j = 0; j < d->disturbances; j++) *to++ = s->row[d->disturbance[j]];
  for (size_t i = 0; i < d->motions; i++) *to++ = s->row[d->model->nu + d->motion[i]];
  if (s->fill < s->length) return;
  for (size_t k = 0; k < s->signals; k++) pb_psd_add(s->psd[k], s->window + k, s->signals);
  memmove(s->window, s->window + s->hop * s->signals,
          (s->length - s->hop) * s->signals * sizeof *s->window);
  s->fill = s->length - s->hop;
}

static void note_largest(const spectra *s, double *largest) {
  const control_design *d = s->r->design;
  for (size_t k = 0; k < d->n; k++)
    largest[k] = fmax(largest[k], fabs(s->row[d->channels.input[k]]));
}

static pb_status read_samples(spectra *s, FILE *samples, double *largest, pb_error *err) {
  const pb_model *m = s->r->design->model;
  size_t width = m->nu + m->ny, stage_length = s->layout.settle + s->layout.measure;
  uint64_t first = 0, step, expected = 0;
  bool any = false;
  rewind(samples);
  while (fread(&step, sizeof step, 1, samples) == 1) {
    if (fread(s->row, sizeof *s->row, width, samples) != width)
      return pb_fail(err, PB_ERR_IO, "samples", "the record ends within a sample");
    if (!any) first = step;
    size_t at = (size_t)((step - first) % stage_length);
    // A stage begins anew, and so does what follows a gap, at a whole period.
    bool gap = any && step != expected;
    if (at == s->layout.settle || gap) s->fill = 0;
    any = true;
    expected = step + 1;
    bool aligned = s->fill > 0 || (at - s->layout.settle) % s->length == 0;
    if (at >= s->layout.settle) note_largest(s, largest);
    if (at >= s->layout.settle && aligned) take(s);
  }
  return ferror(samples) ? pb_fail(err, PB_ERR_IO, "samples", "cannot be read") : PB_OK;
}

// Of the lines that were excited; 0 at the others.
static void predict(const run_result *r, const iff_measurement *m, const double *disturbance,
                    double *density) {
  const control_design *d = r->design;
  size_t nd = d->disturbances;
  memset(density, 0, d->motions * r->lines * sizeof *density);
  for (size_t f = 0; f < m->frf.nf; f++) {
    size_t line = (size_t)lround(m->frf.frequency_hz[f] / r->df);
    if (line >= r->lines) continue;
    for (size_t i = 0; i < d->motions; i++) {
      const double complex *h = m->expected + (f * m->frf.ny + d->motion[i]) * nd;
      for (size_t j = 0; j < nd; j++) {
        double size = cabs(h[j]);
        density[i * r->lines + line] += size * size * disturbance[j * r->lines + line];
      }
    }
  }
}

static pb_status evaluate(run_result *r, run_stage *stage, const spectra *s, pb_error *err) {
  const control_design *d = r->design;
  const pb_experiment_options *e = &r->experiment;
  size_t nd = d->disturbances, size = d->motions * r->lines + 1;
  double *disturbance = malloc((nd * r->lines + 1) * sizeof *disturbance);
  for (int k = 0; k < 2; k++) {
    stage->density[k] = malloc(size * sizeof(double));
    stage->amplitude[k] = malloc(size * sizeof(double));
  }
  if (!disturbance || !stage->density[0] || !stage->density[1] || !stage->amplitude[0] ||
      !stage->amplitude[1]) {
    free(disturbance);
    return pb_fail_memory(err, "spectra");
  }
  stage->segments = pb_psd_segments(s->psd[0]);
  for (size_t j = 0; j < nd; j++) pb_psd_density(s->psd[j], disturbance + j * r->lines);
  for (size_t i = 0; i < d->motions; i++)
    pb_psd_density(s->psd[nd + i], stage->density[0] + i * r->lines);
  predict(r, &stage->response, disturbance, stage->density[1]);
  for (size_t k = 0; k < 2 * d->motions; k++) {
    size_t at = k / 2 * r->lines;
    pb_cumulative_amplitude(stage->density[k % 2] + at, r->lines, r->df, e->f1, e->f2,
                            stage->amplitude[k % 2] + at);
  }
  free(disturbance);
  return PB_OK;
}

pb_status run_spectra(run_result *r, control_stage which, const pb_experiment_layout *layout,
                      size_t period, FILE *samples, pb_error *err) {
  run_stage *stage = &r->stage[which];
  spectra s;
  pb_status status = spectra_new(r, layout, period, &s, err);
  stage->largest = calloc(r->design->n, sizeof *stage->largest);
  if (status == PB_OK && !stage->largest) status = pb_fail_memory(err, "spectra");
  if (status == PB_OK) status = read_samples(&s, samples, stage->largest, err);
  if (status == PB_OK) {
    r->lines = pb_psd_lines(s.psd[0]);
    r->df = r->design->model->sample_rate / (double)s.length;
    status = evaluate(r, stage, &s, err);
  }
  spectra_clear(&s);
  return status;
}

double run_rms(const run_result *r, control_stage stage, size_t motion, int which) {
  const run_stage *s = &r->stage[stage];
  return s->done ? s->amplitude[which][motion * r->lines] : NAN;
}
