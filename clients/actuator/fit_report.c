// The report of plantbus-actuator fit: tables, JSON, files, the model, and the plots of figure 2.5.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/json.h"
#include "fit.h"
#include "outfile.h"
#include "plot.h"
#include "table.h"

typedef struct parameter {
  const char *name, *unit;
  double scale;
  size_t offset;
} parameter;

#define PARAMETER(key, unit, scale) \
  { #key, unit, scale, offsetof(pb_apa_2dof, key) }
static const parameter parameters[] = {
    PARAMETER(k_1, "N/µm", 1e-6), PARAMETER(c_1, "Ns/m", 1),    PARAMETER(k_a, "N/µm", 1e-6),
    PARAMETER(c_a, "Ns/m", 1),    PARAMETER(k_e, "N/µm", 1e-6), PARAMETER(c_e, "Ns/m", 1),
    PARAMETER(g_a, "N/V", 1),     PARAMETER(g_s, "V/µm", 1e-6),
};
enum { PARAMETERS = sizeof parameters / sizeof *parameters };
static const char *const output_keys[PB_APA_OUTPUTS] = {"y", "Vs"};
static const char *const output_names[PB_APA_OUTPUTS] = {"V_a → y", "V_a → V_s"};
static const char *const output_units[PB_APA_OUTPUTS] = {"m/V", "V/V"};

static double value_of(const pb_apa_2dof *a, const parameter *p) {
  double value;
  memcpy(&value, (const char *)a + p->offset, sizeof value);
  return value;
}

cJSON *fit_model(const fit_result *r) {
  cJSON *file = cJSON_CreateObject();
  cJSON *models = file ? cJSON_AddObjectToObject(file, "models") : NULL;
  cJSON *m = models ? cJSON_AddObjectToObject(models, r->name) : NULL;
  bool ok = m && cJSON_AddStringToObject(m, "type", "apa_2dof");
  for (int i = 0; i < PARAMETERS; i++)
    ok = ok && cJSON_AddNumberToObject(m, parameters[i].name, value_of(&r->apa, &parameters[i]));
  ok = ok && cJSON_AddNumberToObject(m, "mass", r->mass) &&
       cJSON_AddNumberToObject(m, "intermediate_mass", r->apa.inner) &&
       cJSON_AddNumberToObject(m, "length", r->length) &&
       cJSON_AddNumberToObject(m, "radius", r->radius);
  if (ok) return file;
  cJSON_Delete(file);
  return NULL;
}

static pb_status write_model(const fit_result *r, const char *path, pb_error *err) {
  char *text = NULL;
  pb_outfile file = {0};
  cJSON *model = fit_model(r);
  pb_status st = model ? pb_json_print(model, &text, err) : pb_fail_memory(err, path);
  if (!st) st = pb_outfile_open(path, &file, err);
  if (!st) {
    fputs(text, file.stream);
    st = pb_outfile_close(&file, err);
  }
  free(text);
  cJSON_Delete(model);
  return st;
}

// ---- tables -------------------------------------------------------------------------------------

static pb_status print_parameters(const fit_result *r, pb_error *err) {
  const bool refined = r->refined.lines > 0;
  pb_table t = {0};
  pb_table_text_column(&t, "parameter");
  pb_table_number_column(&t, "in the report's order", NULL, 4);
  if (refined) pb_table_number_column(&t, "refined", NULL, 4);
  pb_table_text_column(&t, "unit");
  for (int i = 0; i < PARAMETERS; i++) {
    const parameter *p = &parameters[i];
    pb_table_text(&t, p->name);
    pb_table_number(&t, value_of(&r->by_order, p) * p->scale);
    if (refined) pb_table_number(&t, value_of(&r->apa, p) * p->scale);
    pb_table_text(&t, p->unit);
  }
  pb_status st = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  return st;
}

static pb_status print_match(const fit_options *o, const fit_result *r, pb_error *err) {
  pb_table t = {0};
  pb_table_text_column(&t, "channel");
  pb_table_number_column(&t, "worst error up to there", "%", 3);
  pb_table_number_column(&t, "ends at", "Hz", 4);
  for (int k = 0; k < PB_APA_OUTPUTS; k++) {
    pb_table_text(&t, output_names[k]);
    pb_table_number(&t, 100 * r->match.worst[k]);
    pb_table_number(&t, r->match.end[k]);
  }
  printf("\nThe match, by thirds of an octave; it ends beyond the pole where the error exceeds "
         "%g %%:\n",
         100 * o->tolerance);
  pb_status st = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  return st;
}

static pb_status print(const fit_options *o, const fit_result *r, pb_error *err) {
  const pb_apa_landmarks *l = &r->landmarks;
  printf("%s\n", r->subject);
  printf("moving mass %.5g kg; zero of V_a → V_s %.5g Hz (%.3g %%), pole of V_a → y %.5g Hz "
         "(%.3g %%)\n",
         r->apa.moving, l->zero_hz, 100 * l->zero_damping, l->pole_hz, 100 * l->pole_damping);
  printf("at 0 Hz: y/V_a %.4g µm/V, V_s/V_a %.4g V/V\n\n", 1e6 * l->gain_y, l->gain_vs);
  pb_status st = print_parameters(r, err);
  if (!st && r->refined.lines)
    printf("\nRefined over %g … %g Hz, %zu lines, %zu steps: rms of ln(H_model/H) from %.3g to "
           "%.3g\n",
           o->refine1, o->refine2, r->refined.lines, r->refined.iterations, r->refined.before,
           r->refined.after);
  return st ? st : print_match(o, r, err);
}

// ---- JSON ---------------------------------------------------------------------------------------

static void json_parameters(pb_jsonout *j, const char *key, const pb_apa_2dof *a) {
  pb_jsonout_object(j, key);
  for (int i = 0; i < PARAMETERS; i++)
    pb_jsonout_number(j, parameters[i].name, value_of(a, &parameters[i]));
  pb_jsonout_object_end(j);
}

static void json_match(pb_jsonout *j, const fit_result *r) {
  pb_jsonout_object(j, "match");
  for (int k = 0; k < PB_APA_OUTPUTS; k++) {
    pb_jsonout_object(j, output_keys[k]);
    pb_jsonout_number(j, "end_hz", r->match.end[k]);
    pb_jsonout_number(j, "worst", r->match.worst[k]);
    pb_jsonout_array(j, "bands");
    for (size_t b = 0; b < r->match.bands; b++) {
      const double row[3] = {r->match.band[b].low, r->match.band[b].high,
                             r->match.band[b].error[k]};
      pb_jsonout_numbers(j, NULL, row, 3);
    }
    pb_jsonout_array_end(j);
    pb_jsonout_object_end(j);
  }
  pb_jsonout_object_end(j);
}

static void print_json(const fit_result *r) {
  const pb_apa_landmarks *l = &r->landmarks;
  pb_jsonout j;
  pb_jsonout_begin(&j, stdout);
  pb_jsonout_object(&j, NULL);
  pb_jsonout_text(&j, "subject", r->subject);
  pb_jsonout_text(&j, "name", r->name);
  pb_jsonout_number(&j, "moving_mass", r->apa.moving);
  pb_jsonout_object(&j, "landmarks");
  pb_jsonout_number(&j, "zero_hz", l->zero_hz);
  pb_jsonout_number(&j, "zero_damping", l->zero_damping);
  pb_jsonout_number(&j, "pole_hz", l->pole_hz);
  pb_jsonout_number(&j, "pole_damping", l->pole_damping);
  pb_jsonout_number(&j, "gain_y", l->gain_y);
  pb_jsonout_number(&j, "gain_vs", l->gain_vs);
  pb_jsonout_object_end(&j);
  json_parameters(&j, "by_order", &r->by_order);
  json_parameters(&j, "parameters", &r->apa);
  if (r->refined.lines) {
    pb_jsonout_object(&j, "refined");
    pb_jsonout_integer(&j, "lines", r->refined.lines);
    pb_jsonout_integer(&j, "iterations", r->refined.iterations);
    pb_jsonout_number(&j, "before", r->refined.before);
    pb_jsonout_number(&j, "after", r->refined.after);
    pb_jsonout_object_end(&j);
  }
  json_match(&j, r);
  pb_jsonout_object_end(&j);
  pb_jsonout_end(&j);
}

// ---- files --------------------------------------------------------------------------------------

// One output's column out of [nf][2]; the caller's.
static double complex *column(const double complex *h, size_t nf, int output) {
  double complex *out = malloc(nf * sizeof *out);
  for (size_t f = 0; out && f < nf; f++) out[f] = h[f * PB_APA_OUTPUTS + (size_t)output];
  return out;
}

static pb_status save(const fit_options *o, const fit_result *r, const response *list,
                      pb_error *err) {
  const pb_frf *frf = &r->data.frf;
  char path[1024];
  pb_matfile *mat;
  pb_status st = pb_result_path(&o->subject.result, "fit.csv", path, sizeof path, err);
  if (!st) st = responses_csv(path, frf->frequency_hz, frf->nf, list, 4, err);
  if (!st) st = pb_result_path(&o->subject.result, "fit.mat", path, sizeof path, err);
  if (!st) st = pb_matfile_open(path, &mat, err);
  if (st) return st;
  responses_mat(mat, frf->frequency_hz, frf->nf, list, 4);
  for (int i = 0; i < PARAMETERS; i++)
    pb_matfile_scalar(mat, parameters[i].name, value_of(&r->apa, &parameters[i]));
  pb_matfile_scalar(mat, "moving_mass", r->apa.moving);
  pb_matfile_scalar(mat, "intermediate_mass", r->apa.inner);
  return pb_matfile_close(mat, err);
}

static pb_status plot(const fit_options *o, const fit_result *r, const response *list,
                      pb_error *err) {
  pb_status st = PB_OK;
  for (int k = 0; k < PB_APA_OUTPUTS && !st; k++) {
    char path[1024], file[32], title[256];
    const pb_frf *frf = &r->data.frf;
    const bool exact = !(r->data.sample_rate > 0);
    snprintf(file, sizeof file, "fit-%s.png", output_keys[k]);
    snprintf(title, sizeof title, "%s: %s", r->subject, output_names[k]);
    const pb_bode_curve curve[2] = {
        {exact ? "exact" : "measured", exact ? PB_PLOT_LINE : PB_PLOT_POINTS, 1, frf->nf,
         frf->frequency_hz, list[2 * k].h, NULL},
        {"2-DoF model", PB_PLOT_DASHED, PB_PLOT_BLACK, frf->nf, frf->frequency_hz,
         list[2 * k + 1].h, NULL},
    };
    const pb_bode_plot bode = {.title = title, .unit = output_units[k], .count = 2, .curve = curve};
    st = pb_result_path(&o->subject.result, file, path, sizeof path, err);
    if (!st) st = pb_plot_bode(path, &bode, err);
  }
  return st;
}

pb_status fit_present(const fit_options *o, const fit_result *r, pb_error *err) {
  double complex *h[4] = {0};
  static const char *const names[4] = {"y", "y model", "Vs", "Vs model"};
  response list[4];
  pb_status st = PB_OK;
  if (o->subject.result.json)
    print_json(r);
  else
    st = print(o, r, err);
  for (int i = 0; i < 4 && !st; i++) {
    h[i] = column(i % 2 ? r->model : r->data.frf.h, r->data.frf.nf, i / 2);
    list[i] = (response){names[i], output_units[i / 2], h[i]};
    if (!h[i]) st = pb_fail_memory(err, "fit");
  }
  if (!st && o->subject.result.dir) st = save(o, r, list, err);
  if (!st && o->subject.result.plot) st = plot(o, r, list, err);
  if (!st && o->write) st = write_model(r, o->write, err);
  for (int i = 0; i < 4; i++) free(h[i]);
  return st;
}
