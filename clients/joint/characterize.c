// plantbus-joint characterize: k_a, k_s, k_f, k_t of a joint from the gains between its two frames,
// against a specification (Table 3.1 of the report).
//
// Of two directions that should be equal (x and y) the one that is worse for the limit counts.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "csv.h"
#include "joint.h"
#include "jsonout.h"
#include "matfile.h"
#include "plot.h"
#include "print.h"
#include "shipped.h"
#include "source.h"
#include "study/joint_character.h"
#include "table.h"

enum {
  KEY_NODES = 0x100,
  KEY_MODEL,
  KEY_DAMPING,
  KEY_SPECIFICATION,
  KEY_STROKE,
  KEY_CHECK,
  KEY_BAND
};
enum { POINTS = 1500, QUANTITIES = 5 };

typedef struct options {
  const char *file, *model, *specification;
  size_t nodes[2];
  double modal_damping;
  double stroke;  // rad; 0: unknown
  bool check, element_option;
  double f1, f2;  // Hz
  result_options result;
} options;

static const struct argp_option option_table[] = {
    {"model", KEY_MODEL, "NAME", 0, "Model of the plant file (default: the only one that fits)", 2},
    {"nodes", KEY_NODES, "A,B", 0, "Element: the frames it joins (default 2,1)", 2},
    {"modal-damping", KEY_DAMPING, "XI", 0, "Element: damping ratio of all modes (default 0.01)",
     2},
    {"specification", KEY_SPECIFICATION, "FILE", 0,
     "As config/specifications/nano-hexapod-joint.json (default: that file, built in)", 3},
    {"stroke", KEY_STROKE, "RAD", 0,
     "Bending stroke, which no linear model knows (default: unknown)", 3},
    {"check", KEY_CHECK, NULL, 0, "Exit with 1 when a limit is missed", 3},
    {"range", KEY_BAND, "F1,F2", 0, "Of the compliances, Hz (default 10,10000)", 3},
    {0},
};

static void parse_nodes(struct argp_state *state, const char *text, options *o) {
  double *value = NULL;
  size_t count = 0;
  pb_option_double_list(state, "--nodes", text, &value, &count);
  bool ok = count == 2 && value[0] != value[1];
  for (size_t i = 0; i < count && ok; i++) {
    ok = value[i] >= 1 && value[i] <= 1e6 && value[i] == floor(value[i]);
    if (ok) o->nodes[i] = (size_t)value[i];
  }
  if (!ok) argp_error(state, "--nodes: '%s' is not two different frames, counted from 1", text);
  free(value);
}

static void parse_range(struct argp_state *state, const char *text, options *o) {
  double *value = NULL;
  size_t count = 0;
  pb_option_double_list(state, "--range", text, &value, &count);
  if (count == 2 && value[0] > 0 && value[1] > value[0])
    o->f1 = value[0], o->f2 = value[1];
  else
    argp_error(state, "--range: '%s' is not two frequencies 0 < F1 < F2", text);
  free(value);
}

static error_t parse(int key, char *text, struct argp_state *state) {
  options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->result;
    return 0;
  case KEY_MODEL:
    o->model = text;
    return 0;
  case KEY_NODES:
    parse_nodes(state, text, o);
    o->element_option = true;
    return 0;
  case KEY_DAMPING:
    o->modal_damping = pb_option_double(state, "--modal-damping", text, 0, 1);
    o->element_option = true;
    return 0;
  case KEY_SPECIFICATION:
    o->specification = text;
    return 0;
  case KEY_STROKE:
    o->stroke = pb_option_double(state, "--stroke", text, 1e-12, 7);
    return 0;
  case KEY_CHECK:
    o->check = true;
    return 0;
  case KEY_BAND:
    parse_range(state, text, o);
    return 0;
  case ARGP_KEY_ARG:
    if (o->file) argp_error(state, "unexpected argument '%s'", text);
    o->file = text;
    return 0;
  case ARGP_KEY_END:
    if (!o->file) argp_error(state, "which joint? Give an element (.mat) or a plant file");
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

static pb_status open_source(const options *o, pb_element_source *out, pb_error *err) {
  char *text = NULL, *directory = NULL;
  if (source_is_element_file(o->file)) {
    if (o->model)
      return pb_fail(err, PB_ERR_ARGUMENT, "--model", "%s is an element, not a plant file",
                     o->file);
    return pb_element_source_joint(o->file, o->nodes, o->modal_damping, out, err);
  }
  if (o->element_option)
    return pb_fail(err, PB_ERR_ARGUMENT, o->file,
                   "a plant file says itself how its element is used: --nodes and --modal-damping "
                   "are for element files (.mat)");
  pb_status st = source_read_plant(o->file, &text, &directory, err);
  if (!st)
    st = pb_element_source_plant(text, o->file, directory, o->model, pb_element_is_joint, out, err);
  free(text);
  free(directory);
  return st;
}

// ---- judging ------------------------------------------------------------------------------------

static const char *const quantities[QUANTITIES + 1] = {"axial_stiffness",   "shear_stiffness",
                                                       "bending_stiffness", "torsion_stiffness",
                                                       "bending_stroke",    NULL};

typedef struct result {
  char name[128];
  pb_joint_character character;
  pb_limits limits;
  double value[QUANTITIES];  // of each quantity, where the specification limits none: of x
  double margin[QUANTITIES];
  pb_verdict verdict[QUANTITIES];
  const pb_limit *limit[QUANTITIES];  // NULL: none
  size_t missed, unknown;
  double *hz;                     // [POINTS]
  double complex *compliance[6];  // x y z rx ry rz
} result;

// The values of a quantity: one, or two in x and y.
static size_t values_of(const pb_joint_character *c, double stroke, int quantity, double value[2]) {
  static const int first[] = {2, 0, 3, 5};
  if (quantity == QUANTITIES - 1) {
    value[0] = stroke > 0 ? stroke : NAN;
    return 1;
  }
  value[0] = c->k[first[quantity]];
  value[1] = c->k[first[quantity] + 1];
  return quantity == 1 || quantity == 2 ? 2 : 1;
}

static void judge(const options *o, result *r) {
  for (int q = 0; q < QUANTITIES; q++) {
    double value[2], margin;
    const size_t count = values_of(&r->character, o->stroke, q, value);
    r->value[q] = value[0];
    r->margin[q] = NAN;
    for (size_t k = 0; k < r->limits.count; k++)
      if (!strcmp(r->limits.limit[k].quantity->key, quantities[q]))
        r->limit[q] = &r->limits.limit[k];
    if (!r->limit[q]) continue;
    r->verdict[q] = pb_limit_judge(r->limit[q], value[0], &r->margin[q]);
    for (size_t i = 1; i < count; i++) {
      const pb_verdict verdict = pb_limit_judge(r->limit[q], value[i], &margin);
      if (!(margin < r->margin[q])) continue;
      r->value[q] = value[i];
      r->margin[q] = margin;
      r->verdict[q] = verdict;
    }
    r->missed += r->verdict[q] == PB_MISSED;
    r->unknown += r->verdict[q] == PB_UNKNOWN;
  }
}

static const char *verdict_text(const result *r, int q) {
  if (!r->limit[q]) return "";
  return r->verdict[q] == PB_MET ? "pass" : r->verdict[q] == PB_MISSED ? "miss" : "unknown";
}

// ---- telling ------------------------------------------------------------------------------------

static void margin_text(const result *r, int q, char *text, size_t size) {
  if (!r->limit[q] || isnan(r->margin[q]))
    snprintf(text, size, "–");
  else if (r->verdict[q] == PB_MISSED)
    snprintf(text, size, "miss by %.2g %%", fabs(100 * r->margin[q]));
  else
    snprintf(text, size, "%.3g %%", 100 * r->margin[q]);
}

static pb_status print_limits(const result *r, pb_error *err) {
  pb_table t = {0};
  char text[96];
  printf("\n%s:\n", r->limits.name);
  pb_table_text_column(&t, "quantity");
  pb_table_number_column(&t, "value", NULL, 4);
  pb_table_text_column(&t, "unit");
  pb_table_text_column(&t, "limit");
  pb_table_text_column(&t, "verdict");
  pb_table_text_column(&t, "margin");
  for (int q = 0; q < QUANTITIES; q++) {
    const pb_quantity *quantity = pb_quantity_find(quantities[q]);
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

static pb_status print(const result *r, pb_error *err) {
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

static void print_json(const result *r) {
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
  for (int q = 0; q < QUANTITIES; q++) {
    if (!r->limit[q]) continue;
    pb_jsonout_object(&j, quantities[q]);
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

static pb_status save(const options *o, const result *r, pb_error *err) {
  response list[6];
  char path[1024];
  pb_matfile *mat;
  for (int i = 0; i < 6; i++)
    list[i] = (response){directions[i], i < 3 ? "m/N" : "rad/(Nm)", r->compliance[i]};
  pb_status st = result_path(&o->result, "joint.csv", path, sizeof path, err);
  if (!st) st = responses_csv(path, r->hz, POINTS, list, 6, err);
  if (!st) st = result_path(&o->result, "joint.mat", path, sizeof path, err);
  if (!st) st = pb_matfile_open(path, &mat, err);
  if (st) return st;
  pb_matfile_text(mat, "name", r->name);
  pb_matfile_real(mat, "k", 6, 1, r->character.k);
  pb_matfile_scalar(mat, "mass", r->character.mass);
  responses_mat(mat, r->hz, POINTS, list, 6);
  return pb_matfile_close(mat, err);
}

// The compliances, translations over rotations, each with one over its stiffness dashed.
static pb_status plot(const options *o, const result *r, pb_error *err) {
  static const char *const labels[6] = {"x, shear",    "y, shear",    "z, axial",
                                        "rx, bending", "ry, bending", "rz, torsion"};
  char path[1024];
  double *magnitude = malloc(6 * POINTS * sizeof *magnitude), level[6][2];
  const double ends[2] = {o->f1, o->f2};
  pb_plot_curve curve[2][6];
  size_t count[2] = {0};
  if (!magnitude) return pb_fail_memory(err, "plot");
  for (int i = 0; i < 6; i++) {
    const int panel = i / 3;
    if (!(r->character.k[i] > 0) || isinf(r->character.k[i])) continue;
    for (int f = 0; f < POINTS; f++) magnitude[i * POINTS + f] = cabs(r->compliance[i][f]);
    level[i][0] = level[i][1] = 1 / r->character.k[i];
    curve[panel][count[panel]++] =
        (pb_plot_curve){labels[i], PB_PLOT_LINE, i + 1, POINTS, r->hz, magnitude + i * POINTS};
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
  pb_status st = result_path(&o->result, "joint.png", path, sizeof path, err);
  if (!st && figure.count == 0)
    st = pb_fail(err, PB_ERR_ARGUMENT, "--plot", "the joint gives way in no direction");
  if (!st) st = pb_plot(path, &figure, err);
  free(magnitude);
  return st;
}

// ---- the command --------------------------------------------------------------------------------

static pb_status measure(const options *o, result *r, pb_error *err) {
  static const char *const input[6] = {"Fx", "Fy", "Fz", "Mx", "My", "Mz"};
  static const char *const output[6] = {"Dx", "Dy", "Dz", "Rx", "Ry", "Rz"};
  pb_element_source source;
  pb_bench_model bench = {0};
  pb_warnings warnings = {0};
  pb_status st = open_source(o, &source, err);
  if (st) return st;
  snprintf(r->name, sizeof r->name, "%.120s", source.name);
  st = pb_joint_characterize(&source, &warnings, &bench, &r->character, err);
  pb_print_warnings(stderr, &warnings);
  r->hz = log_frequencies(o->f1, o->f2, POINTS);
  if (!st && !r->hz) st = pb_fail_memory(err, "compliance");
  for (int i = 0; i < 6 && !st; i++)
    st = channel_response(bench.model, input[i], output[i], r->hz, POINTS, &r->compliance[i], err);
  pb_bench_model_clear(&bench);
  pb_warnings_clear(&warnings);
  pb_element_source_clear(&source);
  return st;
}

static void result_clear(result *r) {
  pb_limits_clear(&r->limits);
  free(r->hz);
  for (int i = 0; i < 6; i++) free(r->compliance[i]);
}

int command_characterize(int argc, char **argv) {
  static const struct argp_child children[] = {{&result_argp, 0, NULL, 0}, {0}};
  static const struct argp argp = {
      option_table,
      parse,
      "FILE",
      "Characterises a flexible joint: an element file (.mat), or a joint's model of a plant "
      "file.\v"
      "One frame is held; each stiffness is one over the gain at 0 Hz from a force on the other to "
      "its motion.\n\n"
      "Exit codes: 0 done (with --check: and every known limit met), 1 failed or missed, 2 wrong "
      "command line.\n",
      children,
      NULL,
      NULL};
  options o = {.nodes = {2, 1}, .modal_damping = 0.01, .f1 = 10, .f2 = 1e4};
  result r = {0};
  pb_error err = {0};
  pb_options_parse(&argp, argc, argv, &o);
  pb_status st = pb_shipped_limits(o.specification, pb_shipped_joint_specification, quantities,
                                   &r.limits, &err);
  if (!st) st = measure(&o, &r, &err);
  if (!st) {
    judge(&o, &r);
    if (o.result.json)
      print_json(&r);
    else
      st = print(&r, &err);
  }
  if (!st && o.result.dir) st = save(&o, &r, &err);
  if (!st && o.result.plot) st = plot(&o, &r, &err);
  int code = result_end(st, &err);
  if (code == PB_EXIT_DONE && o.check && r.missed > 0) code = PB_EXIT_FAILED;
  result_clear(&r);
  return code;
}
