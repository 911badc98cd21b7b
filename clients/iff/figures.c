// Plots of an IFF experiment: root locus, damped against undamped plant.
#include <math.h>
#include <stdlib.h>

#include "frf_files.h"
#include "iff_tool.h"
#include "model/zeros.h"
#include "plot.h"

// Transmission zeros of the loops' channels up to twice the band; none where they cannot be found.
static void find_zeros(const iff_result *r, double complex **zero, size_t *count) {
  pb_error ignored;
  double complex *all = NULL;
  size_t found = 0;
  *zero = NULL;
  *count = 0;
  if (pb_model_zeros(r->model, r->loops.input, r->loops.output, r->loops.count, r->experiment.f2,
                     &all, &found, &ignored) != PB_OK) {
    return;
  }
  for (size_t k = 0; k < found; k++) {
    if (cimag(all[k]) >= 0) all[(*count)++] = all[k];
  }
  *zero = all;
}

typedef struct locus_points {
  double complex *branch, *open, *closed, *measured, *zero;
  size_t branches, measured_count, zeros;
} locus_points;

static void points_clear(locus_points *p) {
  free(p->branch);
  free(p->open);
  free(p->closed);
  free(p->measured);
  free(p->zero);
}

// Cuts a branch where it jumps: its pole has left the frequencies that are followed (twice the
// band), and what comes after it is another one.
static void cut_branch(double complex *point, size_t count) {
  bool cut = false;
  for (size_t k = 2; k < count; k++) {
    cut = cut || cabs(point[k] - point[k - 1]) > 0.7 * fmax(cabs(point[k]), cabs(point[k - 1]));
    if (cut) point[k] = CMPLX(NAN, NAN);
  }
}

static pb_status fill_points(const iff_result *r, locus_points *p, pb_error *err) {
  size_t branches = r->locus.branches, gains = r->locus.gains;
  double rate = r->model->sample_rate;
  *p = (locus_points){0};
  p->branch = malloc((branches * gains + 1) * sizeof *p->branch);
  p->open = malloc((branches + 1) * sizeof *p->open);
  p->closed = malloc((branches + 1) * sizeof *p->closed);
  p->measured = malloc((r->modes + 1) * sizeof *p->measured);
  if (!p->branch || !p->open || !p->closed || !p->measured)
    return pb_fail_memory(err, "root locus");
  for (size_t b = 0; b < branches; b++) {
    const pb_pole *from = r->locus.pole + b * gains;
    // Modes and the controller's real poles; not what lies above half the sample rate and shows
    // here.
    if (!r->locus.is_mode[b] && cimag(from->z) != 0) continue;
    double complex *to = p->branch + p->branches * gains;
    for (size_t k = 0; k < gains; k++) {
      to[k] = isnan(from[k].hz) ? CMPLX(NAN, NAN) : pb_pole_s(from[k].z, rate);
    }
    p->open[p->branches] = to[0];
    p->closed[p->branches++] = to[r->chosen];
    cut_branch(to, gains);
  }
  for (size_t k = 0; k < r->modes; k++) {
    if (isnan(r->mode[k].closed_measured.hz)) continue;
    p->measured[p->measured_count++] = pb_pole_s(r->mode[k].closed_measured.z, rate);
  }
  find_zeros(r, &p->zero, &p->zeros);
  return PB_OK;
}

static pb_status plot_locus(const iff_result *r, const char *dir, pb_error *err) {
  locus_points p;
  char path[1024], title[256], label[64];
  pb_status status = fill_points(r, &p, err);
  if (status == PB_OK) status = pb_output_path(dir, "iff-root-locus.png", path, sizeof path, err);
  if (status == PB_OK) {
    snprintf(title, sizeof title, "%s: integral force feedback, loops closed: %zu",
             r->bench->description->name, r->loops.count);
    snprintf(label, sizeof label, "g = %.4g", r->law.gain);
    double highest = 0;
    for (size_t k = 0; k < r->modes; k++) highest = fmax(highest, r->mode[k].open_exact.hz);
    pb_locus_plot plot = {.title = title,
                          .poles = p.branches,
                          .zeros = p.zeros,
                          .chosen = p.branches,
                          .pole = p.open,
                          .zero = p.zero,
                          .closed = p.closed,
                          .chosen_label = label,
                          .branches = p.branches,
                          .gains = r->locus.gains,
                          .branch = p.branch,
                          .measured = p.measured,
                          .measured_count = p.measured_count,
                          .max_imag = 1.25 * 2 * M_PI * highest};
    status = pb_plot_locus(path, &plot, err);
  }
  points_clear(&p);
  return status;
}

static void pick(const double complex *h, const pb_frf *m, size_t o, size_t i,
                 double complex *out) {
  for (size_t f = 0; f < m->nf; f++) out[f] = h[(f * m->ny + o) * m->nu + i];
}

// Undamped and damped response of output o to the input of loop i.
static pb_status plot_channel(const iff_result *r, size_t o, size_t i, const char *dir,
                              double complex *work, pb_error *err) {
  const pb_frf *closed = &r->closed.frf, *open = &r->open.frf;
  const char *input = r->model->input[r->channels.input[i]].name,
             *output = r->model->output[o].name;
  double complex *damped = work, *predicted = work + closed->nf, *undamped = work + 2 * closed->nf;
  char name[300], path[1024], title[300], unit[80];
  snprintf(name, sizeof name, "iff-%s-%s.png", input, output);
  for (char *c = name; *c; c++) {
    if (*c == '/') *c = '_';
  }
  snprintf(title, sizeof title, "%s: %s → %s, g = %.4g", r->bench->description->name, input, output,
           r->law.gain);
  pb_channel_unit(r->model, o, r->channels.input[i], unit, sizeof unit);
  pick(closed->h, closed, o, i, damped);
  pick(r->closed.expected, closed, o, i, predicted);
  size_t count = 0;
  pb_bode_curve curve[3];
  if (open->nf > 0) {
    pick(open->h, open, o, i, undamped);
    curve[count++] = (pb_bode_curve){"undamped, measured", PB_PLOT_LINE, PB_PLOT_GREY, open->nf,
                                     open->frequency_hz,   undamped,     NULL};
  }
  curve[count++] = (pb_bode_curve){"damped, measured",   PB_PLOT_POINTS, 1,   closed->nf,
                                   closed->frequency_hz, damped,         NULL};
  curve[count++] = (pb_bode_curve){"damped, predicted",  PB_PLOT_DASHED, PB_PLOT_BLACK, closed->nf,
                                   closed->frequency_hz, predicted,      NULL};
  pb_bode_plot plot = {.title = title, .unit = unit, .count = count, .curve = curve};
  pb_status status = pb_output_path(dir, name, path, sizeof path, err);
  return status == PB_OK ? pb_plot_bode(path, &plot, err) : status;
}

// The output other than the loops' own that an input moves most, next to what the others do to it.
static size_t best_witness(const iff_result *r, size_t i) {
  const pb_frf *m = &r->closed.frf;
  size_t best = m->ny;
  double largest = 0;
  for (size_t o = 0; o < m->ny; o++) {
    double own = 0, all = 0;
    bool sensor = false;
    for (size_t k = 0; k < r->loops.count; k++) sensor = sensor || r->loops.output[k] == o;
    for (size_t f = 0; f < m->nf && !sensor; f++) {
      for (size_t j = 0; j < m->nu; j++) {
        double size = cabs(m->h[(f * m->ny + o) * m->nu + j]);
        all += size;
        if (j == i) own += size;
      }
    }
    if (all > 0 && own / all > largest) largest = own / all, best = o;
  }
  return best;
}

pb_status iff_plot(const iff_result *r, const char *dir, pb_error *err) {
  size_t most = r->closed.frf.nf > r->open.frf.nf ? r->closed.frf.nf : r->open.frf.nf;
  double complex *work = malloc((3 * most + 1) * sizeof *work);
  pb_status status = work ? plot_locus(r, dir, err) : pb_fail_memory(err, "plot");
  bool measured = r->closed.frf.nf > 0;
  for (size_t k = 0; measured && k < r->loops.count && k < 6 && status == PB_OK; k++) {
    status = plot_channel(r, r->loops.output[k], k, dir, work, err);
  }
  if (status == PB_OK && measured) {
    size_t witness = best_witness(r, 0);
    if (witness < r->closed.frf.ny) status = plot_channel(r, witness, 0, dir, work, err);
  }
  free(work);
  return status;
}
