// plantbus-joint characterize: k_a, k_s, k_f, k_t of a joint from the gains between its two frames,
// against a specification (Table 3.1 of the report).
//
// Of two directions that should be equal (x and y) the one that is worse for the limit counts.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "joint.h"
#include "print.h"

enum {
  KEY_NODES = 0x100,
  KEY_MODEL,
  KEY_DAMPING,
  KEY_SPECIFICATION,
  KEY_STROKE,
  KEY_CHECK,
  KEY_BAND
};

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

static error_t parse(int key, char *text, struct argp_state *state) {
  joint_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->result;
    return 0;
  case KEY_MODEL:
    o->model = text;
    return 0;
  case KEY_NODES:
    pb_option_frames(state, "--nodes", text, o->nodes);
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
    pb_option_band(state, "--range", text, &o->f1, &o->f2);
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

static pb_status open_source(const joint_options *o, pb_element_source *out, pb_error *err) {
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

const char *const joint_quantities[] = {"axial_stiffness",   "shear_stiffness", "bending_stiffness",
                                        "torsion_stiffness", "bending_stroke",  NULL};

// The values of a quantity: one, or two in x and y.
static size_t values_of(const pb_joint_character *c, double stroke, int quantity, double value[2]) {
  static const int first[] = {2, 0, 3, 5};
  if (quantity == JOINT_QUANTITIES - 1) {
    value[0] = stroke > 0 ? stroke : NAN;
    return 1;
  }
  const size_t count = quantity == 1 || quantity == 2 ? 2 : 1;
  for (size_t i = 0; i < count; i++) value[i] = c->k[(size_t)first[quantity] + i];
  return count;
}

static void judge(const joint_options *o, joint_result *r) {
  for (int q = 0; q < JOINT_QUANTITIES; q++) {
    double value[2] = {0}, margin;
    const size_t count = values_of(&r->character, o->stroke, q, value);
    r->value[q] = value[0];
    r->margin[q] = NAN;
    for (size_t k = 0; k < r->limits.count; k++)
      if (!strcmp(r->limits.limit[k].quantity->key, joint_quantities[q]))
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

// ---- the command --------------------------------------------------------------------------------

static pb_status measure(const joint_options *o, joint_result *r, pb_error *err) {
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
  r->hz = log_frequencies(o->f1, o->f2, JOINT_POINTS);
  if (!st && !r->hz) st = pb_fail_memory(err, "compliance");
  for (int i = 0; i < 6 && !st; i++)
    st = channel_response(bench.model, input[i], output[i], r->hz, JOINT_POINTS, &r->compliance[i],
                          err);
  pb_bench_model_clear(&bench);
  pb_warnings_clear(&warnings);
  pb_element_source_clear(&source);
  return st;
}

static void result_clear(joint_result *r) {
  pb_limits_clear(&r->limits);
  free(r->hz);
  for (int i = 0; i < 6; i++) free(r->compliance[i]);
}

int command_characterize(int argc, char **argv) {
  static const struct argp_child children[] = {{&pb_result_argp, 0, NULL, 0}, {0}};
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
  joint_options o = {.nodes = {2, 1}, .modal_damping = 0.01, .f1 = 10, .f2 = 1e4};
  joint_result r = {0};
  pb_error err = {0};
  pb_options_parse(&argp, argc, argv, &o);
  pb_status st = pb_shipped_limits(o.specification, pb_shipped_joint_specification,
                                   joint_quantities, &r.limits, &err);
  if (!st) st = measure(&o, &r, &err);
  if (!st) {
    judge(&o, &r);
    st = joint_present(&o, &r, &err);
  }
  int code = pb_result_end(st, &err);
  if (code == PB_EXIT_DONE && o.check && r.missed > 0) code = PB_EXIT_FAILED;
  result_clear(&r);
  return code;
}
