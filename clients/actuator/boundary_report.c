// The report of plantbus-actuator boundary: table, JSON, files, and the plots (figure 2.6).
#include <math.h>
#include <stdlib.h>

#include "boundary.h"
#include "csv.h"
#include "plot.h"
#include "table.h"

static double shift(const boundary_result *r, size_t i) {
  return 100 * (r->row[i].hz / r->row[0].hz - 1);
}

static pb_status print(const boundary_result *r, pb_error *err) {
  const pb_boundary *b = &r->row[0].boundary;
  pb_table t = {0};
  printf("%s; k_33 %.4g, capacitance %.4g µF\n\n", r->subject, b->coupling, 1e6 * b->capacitance);
  pb_table_text_column(&t, "sensor stack");
  pb_table_number_column(&t, "its stiffness", "N/µm", 4);
  pb_table_number_column(&t, "first resonance", "Hz", 5);
  pb_table_number_column(&t, "shift", "%", 3);
  pb_table_number_column(&t, "damping", "%", 3);
  pb_table_number_column(&t, "zero of V_a → V_s", "Hz", 5);
  for (size_t i = 0; i < r->count; i++) {
    const boundary_row *row = &r->row[i];
    pb_table_text(&t, row->label);
    pb_table_number(&t, 1e-6 * row->stiffness);
    pb_table_number(&t, row->hz);
    pb_table_number(&t, shift(r, i));
    pb_table_number(&t, 100 * row->damping);
    pb_table_number(&t, row->zero_hz);
  }
  pb_status st = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  return st;
}

static const char *const kinds[] = {[PB_BOUNDARY_SHORT] = "short",
                                    [PB_BOUNDARY_OPEN] = "open",
                                    [PB_BOUNDARY_RESISTOR] = "resistor"};

static void print_json(const boundary_result *r) {
  pb_jsonout j;
  pb_jsonout_begin(&j, stdout);
  pb_jsonout_object(&j, NULL);
  pb_jsonout_text(&j, "subject", r->subject);
  pb_jsonout_number(&j, "coupling", r->row[0].boundary.coupling);
  pb_jsonout_number(&j, "capacitance", r->row[0].boundary.capacitance);
  pb_jsonout_array(&j, "boundaries");
  for (size_t i = 0; i < r->count; i++) {
    const boundary_row *row = &r->row[i];
    const bool resistor = row->boundary.kind == PB_BOUNDARY_RESISTOR;
    pb_jsonout_object(&j, NULL);
    pb_jsonout_text(&j, "kind", kinds[row->boundary.kind]);
    pb_jsonout_number(&j, "resistance", resistor ? row->boundary.resistance : NAN);
    pb_jsonout_number(&j, "stack_stiffness", row->stiffness);
    pb_jsonout_number(&j, "resonance_hz", row->hz);
    pb_jsonout_number(&j, "shift_percent", shift(r, i));
    pb_jsonout_number(&j, "damping", row->damping);
    pb_jsonout_number(&j, "zero_hz", row->zero_hz);
    pb_jsonout_object_end(&j);
  }
  pb_jsonout_array_end(&j);
  pb_jsonout_object_end(&j);
  pb_jsonout_end(&j);
}

// ---- files --------------------------------------------------------------------------------------

static pb_status save_csv(const boundary_result *r, const char *path, pb_error *err) {
  static const char *const head[][2] = {
      {"boundary", NULL},  {"resistance", "Ohm"}, {"stack stiffness", "N/m"},
      {"resonance", "Hz"}, {"shift", "%"},        {"damping", NULL},
      {"zero", "Hz"}};
  pb_csv csv = {0};
  pb_status st = pb_csv_open(path, &csv, err);
  if (st) return st;
  for (size_t i = 0; i < sizeof head / sizeof *head; i++)
    pb_csv_column(&csv, head[i][0], head[i][1]);
  for (size_t i = 0; i < r->count; i++) {
    const boundary_row *row = &r->row[i];
    const bool resistor = row->boundary.kind == PB_BOUNDARY_RESISTOR;
    pb_csv_text(&csv, kinds[row->boundary.kind]);
    pb_csv_number(&csv, resistor ? row->boundary.resistance : NAN);
    pb_csv_number(&csv, row->stiffness);
    pb_csv_number(&csv, row->hz);
    pb_csv_number(&csv, shift(r, i));
    pb_csv_number(&csv, row->damping);
    pb_csv_number(&csv, row->zero_hz);
  }
  return pb_csv_close(&csv, err);
}

// A column of the rows as an array; the caller's.
enum { RESISTANCE, HZ, DAMPING };
static double *column(const boundary_result *r, int which) {
  double *out = malloc(r->count * sizeof *out);
  for (size_t i = 0; out && i < r->count; i++) {
    const boundary_row *row = &r->row[i];
    const double ohms = row->boundary.kind == PB_BOUNDARY_SHORT  ? 0
                        : row->boundary.kind == PB_BOUNDARY_OPEN ? INFINITY
                                                                 : row->boundary.resistance;
    out[i] = which == RESISTANCE ? ohms : which == HZ ? row->hz : row->damping;
  }
  return out;
}

static pb_status save_mat(const boundary_result *r, const char *path, pb_error *err) {
  static const char *const names[] = {"resistance", "resonance_hz", "damping"};
  pb_matfile *mat;
  pb_status st = pb_matfile_open(path, &mat, err);
  if (st) return st;
  pb_matfile_text(mat, "subject", r->subject);
  for (int k = 0; k < 3 && !st; k++) {
    double *values = column(r, k);
    if (values)
      pb_matfile_real(mat, names[k], r->count, 1, values);
    else
      st = pb_fail_memory(err, path);
    free(values);
  }
  for (size_t i = 0; i < r->count && r->hz && !st; i++) {
    char name[32];
    snprintf(name, sizeof name, "y_of_va_%zu", i + 1);
    pb_matfile_complex(mat, name, BOUNDARY_POINTS, 1, r->row[i].response);
  }
  if (!st && r->hz) pb_matfile_real(mat, "frequency_hz", BOUNDARY_POINTS, 1, r->hz);
  if (!st) return pb_matfile_close(mat, err);
  pb_matfile_discard(mat);
  return st;
}

// ---- plots --------------------------------------------------------------------------------------

static pb_status plot_responses(const boundary_options *o, const boundary_result *r,
                                pb_error *err) {
  char path[1024];
  size_t best = 0, count = 0;
  pb_bode_curve curve[3];
  for (size_t i = 2; i < r->count; i++)
    if (!best || r->row[i].damping > r->row[best].damping) best = i;
  const size_t shown[3] = {0, 1, best};
  for (int i = 0; i < (best ? 3 : 2); i++) {
    const boundary_row *row = &r->row[shown[i]];
    curve[count++] = (pb_bode_curve){row->label, PB_PLOT_LINE,  i + 1, BOUNDARY_POINTS,
                                     r->hz,      row->response, NULL};
  }
  const pb_bode_plot bode = {.title = "V_a → y by the boundary of the sensor stack",
                             .unit = "m/V",
                             .count = count,
                             .curve = curve};
  pb_status st = pb_result_path(&o->subject.result, "boundary.png", path, sizeof path, err);
  return st ? st : pb_plot_bode(path, &bode, err);
}

static pb_status plot_resistors(const boundary_options *o, const boundary_result *r,
                                pb_error *err) {
  char path[1024];
  const size_t count = r->count - 2;
  double *ohms = column(r, RESISTANCE), *hz = column(r, HZ), *damping = column(r, DAMPING);
  pb_status st = ohms && hz && damping ? PB_OK : pb_fail_memory(err, "plot");
  if (!st) {
    for (size_t i = 0; i < r->count; i++) damping[i] *= 100;
    const double ends[2] = {ohms[2], ohms[r->count - 1]};
    const double low[2] = {hz[0], hz[0]}, high[2] = {hz[1], hz[1]};
    const pb_plot_curve upper[] = {{"with the resistor", PB_PLOT_LINE, 1, count, ohms + 2, hz + 2},
                                   {"short-circuited", PB_PLOT_DASHED, 2, 2, ends, low},
                                   {"open", PB_PLOT_DASHED, 3, 2, ends, high}};
    const pb_plot_curve lower[] = {
        {"with the resistor", PB_PLOT_LINE, 1, count, ohms + 2, damping + 2}};
    const pb_plot_panel panel[] = {
        {.x = {.log = true}, .y = {.label = "First resonance (Hz)"}, .count = 3, .curve = upper},
        {.x = {.label = "Resistance (Ω)", .log = true},
         .y = {.label = "Damping (%)"},
         .count = 1,
         .curve = lower}};
    const pb_plot_figure figure = {.shared_x = true, .count = 2, .panel = panel};
    st = pb_result_path(&o->subject.result, "boundary-resistance.png", path, sizeof path, err);
    if (!st) st = pb_plot(path, &figure, err);
  }
  free(ohms);
  free(hz);
  free(damping);
  return st;
}

pb_status boundary_present(const boundary_options *o, const boundary_result *r, pb_error *err) {
  char path[1024];
  pb_status st = PB_OK;
  if (o->subject.result.json)
    print_json(r);
  else
    st = print(r, err);
  if (!st && o->subject.result.dir) {
    st = pb_result_path(&o->subject.result, "boundary.csv", path, sizeof path, err);
    if (!st) st = save_csv(r, path, err);
    if (!st) st = pb_result_path(&o->subject.result, "boundary.mat", path, sizeof path, err);
    if (!st) st = save_mat(r, path, err);
  }
  if (!st && o->subject.result.plot && r->hz) st = plot_responses(o, r, err);
  if (!st && o->subject.result.plot && r->count > 3) st = plot_resistors(o, r, err);
  return st;
}
