// The report of plantbus-joint characterize: tables, JSON, files, and the compliances.
#include <math.h>
#include <stdlib.h>

#include "joint.h"
#include "plot.h"
#include "print.h"
#include "table.h"

// ---- telling ------------------------------------------------------------------------------------

static const char *verdict_text(const joint_result *r, int q) {
  if (!r->limit[q]) return "";
  return r->verdict[q] == PB_MET ? "pass" : r->verdict[q] == PB_MISSED ? "miss" : "unknown";
}

static void margin_text(const joint_result *r, int q, char *text, size_t size) {
  if (!r->limit[q] || isnan(r->margin[q]))
    snprintf(text, size, "–");
  else if (isinf(r->margin[q]))
    snprintf(text, size, "%s", r->margin[q] > 0 ? "locked" : "miss: locked");
  else if (r->verdict[q] == PB_MISSED)
    snprintf(text, size, "miss by %.2g %%", fabs(100 * r->margin[q]));
  else
    snprintf(text, size, "%.3g %%", 100 * r->margin[q]);
}

static pb_status print_limits(const joint_result *r, pb_error *err) {
  pb_table t = {0};
  char text[96];
  printf("\n%s:\n", r->limits.name);
  pb_table_text_column(&t, "quantity");
  pb_table_number_column(&t, "value", NULL, 4);
  pb_table_text_column(&t, "unit");
  pb_table_text_column(&t, "limit");
  pb_table_text_column(&t, "verdict");
  pb_table_text_column(&t, "margin");
  for (int q = 0; q < JOINT_QUANTITIES; q++) {
    const pb_quantity *quantity = pb_quantity_find(joint_quantities[q]);
    if (!r->limit[q]) continue;
    pb_table_text(&t, quantity->name);
    pb_table_number(&t, r->value[q] * quantity->scale);
    pb_table_text(&t, quantity->unit);
    pb_limit_text(r->limit[q], text, sizeof text);
    pb_table_text(&t, text);
    pb_table_text(&t, verdict_text(r, q));
    margin_text(r, q, text, sizeof text);
    pb_table_text(&t, text);
  }
  pb_status st = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  return st;
}

static const char *const directions[6] = {"x", "y", "z", "rx", "ry", "rz"};

static pb_status print(const joint_result *r, pb_error *err) {
  static const char *const names[6] = {"shear k_s, x",   "shear k_s, y",   "axial k_a",
                                       "bending k_f, x", "bending k_f, y", "torsion k_t"};
  const pb_joint_character *c = &r->character;
  pb_table t = {0};
  printf("%s\n\n", r->name);
  pb_table_text_column(&t, "stiffness");
  pb_table_number_column(&t, "value", NULL, 5);
  pb_table_text_column(&t, "unit");
  for (int i = 0; i < 6; i++) {
    pb_table_text(&t, names[i]);
    pb_table_number(&t, i < 3 ? 1e-6 * c->k[i] : c->k[i]);
    pb_table_text(&t, isinf(c->k[i]) ? "locked" : i < 3 ? "N/µm" : "Nm/rad");
  }
  pb_status st = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  if (c->mass > 0)
    printf(
        "\nmass %.4g g; first mode with one frame fixed %.5g Hz; largest coupling between the six "
        "%.2g\n",
        1e3 * c->mass, c->resonance, c->coupling);
  return st ? st : print_limits(r, err);
}

static void print_json(const joint_result *r) {
  pb_jsonout j;
  pb_jsonout_begin(&j, stdout);
  pb_jsonout_object(&j, NULL);
  pb_jsonout_text(&j, "name", r->name);
  pb_jsonout_object(&j, "stiffness");
  for (int i = 0; i < 6; i++) pb_jsonout_number(&j, directions[i], r->character.k[i]);
  pb_jsonout_object_end(&j);
  pb_jsonout_number(&j, "mass", r->character.mass > 0 ? r->character.mass : NAN);
  pb_jsonout_number(&j, "resonance_hz", r->character.resonance);
  pb_jsonout_number(&j, "coupling", r->character.coupling);
  pb_jsonout_text(&j, "specification", r->limits.name);
  pb_jsonout_boolean(&j, "pass", r->missed == 0);
  pb_jsonout_object(&j, "limits");
  for (int q = 0; q < JOINT_QUANTITIES; q++) {
    if (!r->limit[q]) continue;
    pb_jsonout_object(&j, joint_quantities[q]);
    pb_jsonout_number(&j, "value", r->value[q]);
    pb_jsonout_text(&j, "verdict", verdict_text(r, q));
    pb_jsonout_number(&j, "margin", r->margin[q]);
    pb_jsonout_object_end(&j);
  }
  pb_jsonout_object_end(&j);
  pb_jsonout_object_end(&j);
  pb_jsonout_end(&j);
}

// ---- files --------------------------------------------------------------------------------------

static pb_status save(const joint_options *o, const joint_result *r, pb_error *err) {
  response list[6];
  char path[1024];
  pb_matfile *mat;
  for (int i = 0; i < 6; i++)
    list[i] = (response){directions[i], i < 3 ? "m/N" : "rad/(Nm)", r->compliance[i]};
  pb_status st = pb_result_path(&o->result, "joint.csv", path, sizeof path, err);
  if (!st) st = responses_csv(path, r->hz, JOINT_POINTS, list, 6, err);
  if (!st) st = pb_result_path(&o->result, "joint.mat", path, sizeof path, err);
  if (!st) st = pb_matfile_open(path, &mat, err);
  if (st) return st;
  pb_matfile_text(mat, "name", r->name);
  pb_matfile_real(mat, "k", 6, 1, r->character.k);
  pb_matfile_scalar(mat, "mass", r->character.mass);
  responses_mat(mat, r->hz, JOINT_POINTS, list, 6);
  return pb_matfile_close(mat, err);
}

// The compliances, translations over rotations, each with one over its stiffness dashed.
static pb_status plot(const joint_options *o, const joint_result *r, pb_error *err) {
  static const char *const labels[6] = {"x, shear",    "y, shear",    "z, axial",
                                        "rx, bending", "ry, bending", "rz, torsion"};
  char path[1024];
  double *magnitude = malloc(6 * JOINT_POINTS * sizeof *magnitude), level[6][2];
  const double ends[2] = {o->f1, o->f2};
  pb_plot_curve curve[2][6];
  size_t count[2] = {0};
  if (!magnitude) return pb_fail_memory(err, "plot");
  for (int i = 0; i < 6; i++) {
    const int panel = i / 3;
    if (!(r->character.k[i] > 0) || isinf(r->character.k[i])) continue;
    for (int f = 0; f < JOINT_POINTS; f++)
      magnitude[i * JOINT_POINTS + f] = cabs(r->compliance[i][f]);
    level[i][0] = level[i][1] = 1 / r->character.k[i];
    curve[panel][count[panel]++] = (pb_plot_curve){
        labels[i], PB_PLOT_LINE, i + 1, JOINT_POINTS, r->hz, magnitude + i * JOINT_POINTS};
    curve[panel][count[panel]++] =
        (pb_plot_curve){"1/k", PB_PLOT_DASHED, PB_PLOT_BLACK, 2, ends, level[i]};
  }
  const pb_plot_panel panel[2] = {{.x = {.log = true},
                                   .y = {.label = "Compliance (m/N)", .log = true},
                                   .count = count[0],
                                   .curve = curve[0]},
                                  {.x = {.label = "Frequency (Hz)", .log = true},
                                   .y = {.label = "Compliance (rad/(Nm))", .log = true},
                                   .count = count[1],
                                   .curve = curve[1]}};
  const size_t first = count[0] ? 0 : 1;
  const pb_plot_figure figure = {.title = r->name,
                                 .shared_x = true,
                                 .count = (size_t)((count[0] > 0) + (count[1] > 0)),
                                 .panel = panel + first};
  pb_status st = pb_result_path(&o->result, "joint.png", path, sizeof path, err);
  if (!st && figure.count == 0)
    st = pb_fail(err, PB_ERR_ARGUMENT, "--plot", "the joint gives way in no direction");
  if (!st) st = pb_plot(path, &figure, err);
  free(magnitude);
  return st;
}

pb_status joint_present(const joint_options *o, const joint_result *r, pb_error *err) {
  pb_status st = PB_OK;
  if (o->result.json)
    print_json(r);
  else
    st = print(r, err);
  if (!st && o->result.dir) st = save(o, r, err);
  if (!st && o->result.plot) st = plot(o, r, err);
  return st;
}
