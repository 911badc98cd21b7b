// The report of plantbus-actuator characterize: tables, JSON, files, and the compliance plot
// (figure 2.3 of the report).
#include <math.h>
#include <stdlib.h>

#include "characterize.h"
#include "plot.h"

static pb_status print(const characterize_options *o, const characterize_result *r, pb_error *err) {
  if (!o->subject.result.json) {
    printf("%s\n\n", r->name);
    return figures_print(r->figure, r->figures, o->datasheet != NULL, err);
  }
  pb_jsonout j;
  pb_jsonout_begin(&j, stdout);
  pb_jsonout_object(&j, NULL);
  pb_jsonout_text(&j, "name", r->name);
  figures_json(&j, r->figure, r->figures);
  pb_jsonout_object_end(&j);
  pb_jsonout_end(&j);
  return PB_OK;
}

static pb_status save(const characterize_options *o, const characterize_result *r, pb_error *err) {
  const response compliance = {"compliance", "m/N", r->compliance};
  char path[1024];
  pb_matfile *mat;
  pb_status st = pb_result_path(&o->subject.result, "characterize.csv", path, sizeof path, err);
  if (!st)
    st = r->compliance ? responses_csv(path, r->hz, CHARACTERIZE_POINTS, &compliance, 1, err)
                       : figures_csv(path, r->figure, r->figures, err);
  if (!st) st = pb_result_path(&o->subject.result, "characterize.mat", path, sizeof path, err);
  if (!st) st = pb_matfile_open(path, &mat, err);
  if (st) return st;
  pb_matfile_text(mat, "name", r->name);
  figures_mat(mat, r->figure, r->figures);
  if (r->compliance) responses_mat(mat, r->hz, CHARACTERIZE_POINTS, &compliance, 1);
  return pb_matfile_close(mat, err);
}

// A constant compliance as a curve.
static double complex *level(double compliance) {
  double complex *h = malloc(CHARACTERIZE_POINTS * sizeof *h);
  for (size_t i = 0; h && i < CHARACTERIZE_POINTS; i++) h[i] = compliance;
  return h;
}

static pb_status plot(const characterize_options *o, const characterize_result *r, pb_error *err) {
  char path[1024], label[3][160];
  pb_status st = pb_result_path(&o->subject.result, "characterize.png", path, sizeof path, err);
  if (st) return st;
  const bool sheet = !isnan(r->sheet_stiffness);
  double complex *own = level(1 / r->stiffness), *data = level(1 / r->sheet_stiffness);
  if (own && data) {
    snprintf(label[0], sizeof label[0], "%s: y/F", r->name);
    snprintf(label[1], sizeof label[1], "1/k, k = %.3g N/µm", 1e-6 * r->stiffness);
    snprintf(label[2], sizeof label[2], "data sheet, k = %.3g N/µm", 1e-6 * r->sheet_stiffness);
    const pb_bode_curve curve[3] = {
        {label[0], PB_PLOT_LINE, 1, CHARACTERIZE_POINTS, r->hz, r->compliance, NULL},
        {label[1], PB_PLOT_DASHED, PB_PLOT_BLACK, CHARACTERIZE_POINTS, r->hz, own, NULL},
        {label[2], PB_PLOT_DASHED, 2, CHARACTERIZE_POINTS, r->hz, data, NULL},
    };
    const pb_bode_plot bode = {.title = "Axial compliance, bottom fixed",
                               .unit = "m/N",
                               .count = sheet ? 3 : 2,
                               .curve = curve};
    st = pb_plot_bode(path, &bode, err);
  } else {
    st = pb_fail_memory(err, path);
  }
  free(own);
  free(data);
  return st;
}

pb_status characterize_present(const characterize_options *o, const characterize_result *r,
                               pb_error *err) {
  pb_status st = print(o, r, err);
  if (!st && o->subject.result.dir) st = save(o, r, err);
  if (!st && o->subject.result.plot) st = plot(o, r, err);
  return st;
}
