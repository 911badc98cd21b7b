// plantbus-actuator constants: g_a and g_s from the properties of the stacks.
#include <math.h>

#include "actuator.h"
#include "plot.h"
#include "study/actuator_piezo.h"

enum { KEY_D33 = 0x100, KEY_EPS, KEY_S_D, KEY_C_E, KEY_LENGTH, KEY_AREA, KEY_LAYERS };

typedef struct options {
  pb_piezo piezo;
  pb_result_options result;
} options;

static const struct argp_option option_table[] = {
    {"d33", KEY_D33, "M/V", 0, "Piezoelectric constant (default 680e-12)", 2},
    {"permittivity", KEY_EPS, "F/M", 0, "At constant stress (default 4e-8)", 2},
    {"compliance", KEY_S_D, "M2/N", 0, "At constant electric displacement, s^D (default 21e-12)",
     2},
    {"modulus", KEY_C_E, "N/M2", 0, "At constant electric field, c^E (default 48e9)", 2},
    {"length", KEY_LENGTH, "M", 0, "Of one stack (default 0.02)", 2},
    {"area", KEY_AREA, "M2", 0, "Of its section (default 1e-4)", 2},
    {"layers", KEY_LAYERS, "N", 0, "In one stack (default 160)", 2},
    {0},
};

static error_t parse(int key, char *text, struct argp_state *state) {
  options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->result;
    return 0;
  case KEY_D33:
    o->piezo.d33 = pb_option_double(state, "--d33", text, 1e-15, 1e-3);
    return 0;
  case KEY_EPS:
    o->piezo.eps_t = pb_option_double(state, "--permittivity", text, 1e-13, 1);
    return 0;
  case KEY_S_D:
    o->piezo.s_d = pb_option_double(state, "--compliance", text, 1e-15, 1);
    return 0;
  case KEY_C_E:
    o->piezo.c_e = pb_option_double(state, "--modulus", text, 1, 1e15);
    return 0;
  case KEY_LENGTH:
    o->piezo.length = pb_option_double(state, "--length", text, 1e-9, 1e3);
    return 0;
  case KEY_AREA:
    o->piezo.area = pb_option_double(state, "--area", text, 1e-15, 1e3);
    return 0;
  case KEY_LAYERS:
    o->piezo.layers = (double)pb_option_uint64(state, "--layers", text, 1, 1000000);
    return 0;
  case ARGP_KEY_ARG:
    argp_error(state, "unexpected argument '%s'", text);
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

enum { FIGURES = 14 };

static void fill(const pb_piezo *p, part_figure out[FIGURES]) {
  const part_figure list[FIGURES] = {
      {"d33", "d_33", "m/V", 1, p->d33, NAN, NAN},
      {"permittivity", "ε^T", "F/m", 1, p->eps_t, NAN, NAN},
      {"compliance", "s^D", "m²/N", 1, p->s_d, NAN, NAN},
      {"modulus", "c^E", "N/m²", 1, p->c_e, NAN, NAN},
      {"length", "length of a stack", "mm", 1e3, p->length, NAN, NAN},
      {"area", "section", "mm²", 1e6, p->area, NAN, NAN},
      {"layers", "layers", "", 1, p->layers, NAN, NAN},
      {"g_a", "g_a = d_33 n c^E A/L", "N/V", 1, pb_piezo_force_constant(p), NAN, NAN},
      {"g_s", "g_s = d_33/(ε^T s^D n)", "V/µm", 1e-6, pb_piezo_sensor_constant(p), NAN, NAN},
      {"free_stroke", "free elongation n d_33", "nm/V", 1e9, p->layers * p->d33, NAN, NAN},
      {"stack_stiffness", "stack stiffness c^E A/L", "N/µm", 1e-6, pb_piezo_stiffness(p), NAN, NAN},
      {"capacitance", "capacitance n² ε^T A/L", "µF", 1e6, pb_piezo_capacitance(p), NAN, NAN},
      {"coupling", "coupling k_33", "", 1, pb_piezo_coupling(p), NAN, NAN},
      {"open_over_short", "stiffness open/short", "", 1, 1 / (1 - pow(pb_piezo_coupling(p), 2)),
       NAN, NAN},
  };
  for (int i = 0; i < FIGURES; i++) out[i] = list[i];
}

static pb_status save(const options *o, const part_figure *f, pb_error *err) {
  char path[1024];
  pb_matfile *mat;
  pb_status st = pb_result_path(&o->result, "constants.csv", path, sizeof path, err);
  if (!st) st = figures_csv(path, f, FIGURES, err);
  if (!st) st = pb_result_path(&o->result, "constants.mat", path, sizeof path, err);
  if (!st) st = pb_matfile_open(path, &mat, err);
  if (st) return st;
  figures_mat(mat, f, FIGURES);
  return pb_matfile_close(mat, err);
}

// Both constants over the number of layers: thin layers push harder per volt and give less voltage.
static pb_status plot(const options *o, pb_error *err) {
  enum { POINTS = 100 };
  double n[POINTS], g_a[POINTS], g_s[POINTS];
  char path[1024];
  for (int i = 0; i < POINTS; i++) {
    pb_piezo p = o->piezo;
    p.layers = n[i] = o->piezo.layers * 2.5 * (i + 1) / POINTS;
    g_a[i] = pb_piezo_force_constant(&p);
    g_s[i] = 1e-6 * pb_piezo_sensor_constant(&p);
  }
  const double chosen[2] = {pb_piezo_force_constant(&o->piezo),
                            1e-6 * pb_piezo_sensor_constant(&o->piezo)};
  const pb_plot_curve force[] = {{"g_a", PB_PLOT_LINE, 1, POINTS, n, g_a},
                                 {"chosen", PB_PLOT_SQUARE, 2, 1, &o->piezo.layers, &chosen[0]}};
  const pb_plot_curve sensor[] = {{"g_s", PB_PLOT_LINE, 3, POINTS, n, g_s},
                                  {"chosen", PB_PLOT_SQUARE, 2, 1, &o->piezo.layers, &chosen[1]}};
  const pb_plot_panel panel[] = {
      {.y = {.label = "Actuator constant (N/V)"}, .count = 2, .curve = force},
      {.x = {.label = "Layers of a stack"},
       .y = {.label = "Sensor constant (V/µm)", .log = true},
       .count = 2,
       .curve = sensor}};
  const pb_plot_figure figure = {.shared_x = true, .count = 2, .panel = panel};
  pb_status st = pb_result_path(&o->result, "constants.png", path, sizeof path, err);
  return st ? st : pb_plot(path, &figure, err);
}

int command_constants(int argc, char **argv) {
  static const struct argp_child children[] = {{&pb_result_argp, 0, NULL, 0}, {0}};
  static const struct argp argp = {
      option_table,
      parse,
      NULL,
      "Constants of a piezoelectric stack from its properties (default: Table 1.4 of the report).\v"
      "g_a: force of the blocked stack per volt. g_s: voltage of the open stack per elongation.",
      children,
      NULL,
      NULL};
  options o = {.piezo = pb_piezo_default()};
  pb_error err = {0};
  part_figure f[FIGURES];
  pb_options_parse(&argp, argc, argv, &o);
  fill(&o.piezo, f);
  pb_status st = PB_OK;
  if (o.result.json) {
    pb_jsonout j;
    pb_jsonout_begin(&j, stdout);
    pb_jsonout_object(&j, NULL);
    for (int i = 0; i < FIGURES; i++) pb_jsonout_number(&j, f[i].key, f[i].value);
    pb_jsonout_object_end(&j);
    pb_jsonout_end(&j);
  } else {
    st = figures_print(f, FIGURES, false, &err);
  }
  if (!st && o.result.dir) st = save(&o, f, &err);
  if (!st && o.result.plot) st = plot(&o, &err);
  return pb_result_end(st, &err);
}
