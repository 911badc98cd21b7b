// plantbus-study: one thing varied over a hexapod, and what it does to its control.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "commands.h"
#include "interrupt.h"
#include "ranks.h"
#include "study.h"

enum {
  KEY_VALUES = 0x100,
  KEY_MODEL,
  KEY_K_F,
  KEY_K_T,
  KEY_K_A,
  KEY_K_S,
  KEY_BAND,
  KEY_FROM,
  KEY_TO,
  KEY_POINTS,
  KEY_INTEGRATOR,
  KEY_HIGHPASS,
  KEY_WORKERS,
  KEY_LIVE,
  KEY_PATIENCE,
};

// Of OpenBLAS, when that is the BLAS in use.
void openblas_set_num_threads(int count) __attribute__((weak));

static const struct argp_option option_table[] = {
    {"values", KEY_VALUES, "LIST", 0,
     "What to study, comma-separated: numbers in SI units (axial: also inf), or names of models",
     2},
    {"model", KEY_MODEL, "NAME=JSON", 0,
     "A model more in the plant file, as JSON or @FILE; repeatable", 2},
    {"joint-k_f", KEY_K_F, "NM/RAD", 0, "joint-model: bending stiffness, where not the plant's", 2},
    {"joint-k_t", KEY_K_T, "NM/RAD", 0, "joint-model: torsional stiffness", 2},
    {"joint-k_a", KEY_K_A, "N/M", 0, "joint-model: axial stiffness", 2},
    {"joint-k_s", KEY_K_S, "N/M", 0, "joint-model: shear stiffness", 2},
    {"band", KEY_BAND, "F1,F2", 0, "Modes to damp in Hz (default: the six lowest)", 3},
    {"from", KEY_FROM, "HZ", 0, "Lowest frequency of the responses (default 1)", 3},
    {"to", KEY_TO, "HZ", 0, "Highest frequency (default 1000)", 3},
    {"points", KEY_POINTS, "N", 0, "Frequencies (default 600)", 3},
    {"integrator", KEY_INTEGRATOR, "HZ", 0, "Corner of the integrator of K_IFF (default 2)", 3},
    {"highpass", KEY_HIGHPASS, "HZ", 0, "Corner of its high-pass filter (default 0.5)", 3},
    {"workers", KEY_WORKERS, "N", 0,
     "Processes on this host (default: one a core; under mpirun one)", 4},
    {"live", KEY_LIVE, NULL, 0,
     "Change the plant of a running daemon to each value, identify it, compare; then give it its "
     "plant back",
     5},
    {"patience", KEY_PATIENCE, "S", 0, "live: how long a change may take (default 120)", 5},
    {0}};

static const char description[] =
    "Varies one thing over a hexapod and tells what it does to its control."
    "\vPLANT is a plant file with the template nano_hexapod. Each value makes a plant of its own: "
    "HAC plant (actuators to dL), IFF plant (actuators to force sensors), root loci of integral "
    "force feedback with one gain for six struts, the damping attainable for each mode, model "
    "order, RGA numbers, zeros, and whether the forces act along the struts. Values run side by "
    "side on the cores, and under mpirun on several machines: the same results in the same "
    "order.\n\n"
    "With --live there is no PLANT: it is that of the daemon.\n\n"
    "Exit codes: 0 done, 1 failed, 2 wrong command line.";

// A model's JSON may hold commas: the text is one entry.
static void add_model(struct argp_state *state, const char *text, pb_name_list *list) {
  char **grown = realloc(list->name, (list->count + 1) * sizeof *grown);
  char *copy = strdup(text);
  if (grown) list->name = grown;
  if (!grown || !copy) argp_failure(state, PB_EXIT_FAILED, 0, "out of memory");
  list->name[list->count++] = copy;
}

static error_t parse_number(int key, char *text, struct argp_state *state) {
  study_options *o = state->input;
  switch (key) {
  case KEY_K_F:
    o->stiffness.k_f = pb_option_double(state, "--joint-k_f", text, 0, 1e12);
    break;
  case KEY_K_T:
    o->stiffness.k_t = pb_option_double(state, "--joint-k_t", text, 0, 1e12);
    break;
  case KEY_K_A:
    o->stiffness.k_a = pb_option_double(state, "--joint-k_a", text, 1e-6, 1e15);
    break;
  case KEY_K_S:
    o->stiffness.k_s = pb_option_double(state, "--joint-k_s", text, 1e-6, 1e15);
    break;
  case KEY_FROM:
    o->point.from = pb_option_double(state, "--from", text, 1e-6, 1e6);
    break;
  case KEY_TO:
    o->point.to = pb_option_double(state, "--to", text, 1e-6, 1e6);
    break;
  case KEY_POINTS:
    o->point.points = (size_t)pb_option_uint64(state, "--points", text, 2, 100000);
    break;
  case KEY_INTEGRATOR:
    o->point.integrator_hz = pb_option_double(state, "--integrator", text, 1e-6, 1e6);
    break;
  case KEY_HIGHPASS:
    o->point.highpass_hz = pb_option_double(state, "--highpass", text, 1e-6, 1e6);
    break;
  case KEY_WORKERS:
    o->workers = (size_t)pb_option_uint64(state, "--workers", text, 1, 1024);
    break;
  case KEY_PATIENCE:
    o->patience = pb_option_double(state, "--patience", text, 1e-3, 86400);
    break;
  default:
    return ARGP_ERR_UNKNOWN;
  }
  return 0;
}

// Values that are no numbers of this study are a wrong command line; names are looked up later.
static void check_values(struct argp_state *state, const study_options *o) {
  for (size_t k = 0; k < o->values.count; k++) {
    const pb_variation v = {.kind = o->kind, .text = o->values.name[k]};
    pb_error err;
    double value;
    if (pb_variation_number(&v, &value, &err)) argp_error(state, "--values: %s", err.message);
  }
}

static error_t parse(int key, char *text, struct argp_state *state) {
  study_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->common;
    state->child_inputs[1] = &o->result;
    break;
  case KEY_VALUES:
    pb_option_names(state, "--values", text, &o->values);
    break;
  case KEY_MODEL:
    add_model(state, text, &o->models);
    break;
  case KEY_BAND:
    pb_option_band(state, "--band", text, &o->point.f1, &o->point.f2);
    break;
  case KEY_LIVE:
    o->live = true;
    break;
  case ARGP_KEY_ARG:
    if (state->arg_num > 0) argp_error(state, "unexpected argument '%s'", text);
    o->plant_path = text;
    break;
  case ARGP_KEY_END:
    check_values(state, o);
    if (o->point.from >= o->point.to) argp_error(state, "--from is not below --to");
    if (!o->live && !o->plant_path) argp_error(state, "the plant file is missing");
    if (o->live && o->plant_path) argp_error(state, "--live takes the daemon's plant, no file");
    if (o->live && (o->result.plot || o->result.dir))
      argp_error(state, "--live prints its report only; plantbus-identify writes files");
    break;
  default:
    return parse_number(key, text, state);
  }
  return 0;
}

static pb_status report(const study *s, pb_error *err) {
  const pb_result_options *o = &s->options->result;
  pb_status status = o->json ? study_print_json(s, err) : study_print(s, err);
  if (!status && o->dir) status = study_save(s, o->dir, err);
  if (!status && o->plot) status = study_plot(s, pb_result_dir(o), err);
  return status;
}

static pb_status run_study(const study_options *o, pb_error *err) {
  study s = {0};
  pb_status status = study_ranks_begin(err);
  if (!status && study_rank() == 0) status = pb_result_check(&o->result, err);
  if (!status) status = study_open(o, &s, err);
  if (!status) status = study_run(&s, err);
  if (!status && study_rank() == 0) status = report(&s, err);
  study_close(&s);
  return status;
}

static int run(pb_study_kind kind, int argc, char **argv) {
  static const struct argp_child children[] = {
      {&pb_common_argp, 0, "Of a running daemon:", 5}, {&pb_result_argp, 0, NULL, 0}, {0}};
  static const struct argp argp = {option_table, parse, "PLANT", description, children, NULL, NULL};
  study_options o = {.kind = kind,
                     .stiffness = {NAN, NAN, NAN, NAN},
                     .point = {.from = 1, .to = 1000, .points = 600},
                     .patience = 120,
                     .result = {.files_help = "Write study-….csv, study-…-frf.csv, "
                                              "study-…-locus.csv and study-….mat into DIR",
                                .plot_help = "Draw the plants, root loci, RGA numbers and "
                                             "attainable damping (PNG) into DIR, or here"}};
  pb_error err = {0};
  pb_options_parse(&argp, argc, argv, &o);
  // One thread: the workers share the cores, and a product's bits do not depend on their number.
  if (openblas_set_num_threads) openblas_set_num_threads(1);
  pb_interrupt_install();
  pb_status status = o.live ? study_live(&o, &err) : run_study(&o, &err);
  const int code = pb_result_end(status, &err);
  study_ranks_end(code != PB_EXIT_DONE);
  pb_name_list_free(&o.values);
  pb_name_list_free(&o.models);
  return code;
}

static int bending(int argc, char **argv) {
  return run(PB_STUDY_BENDING, argc, argv);
}

static int torsion(int argc, char **argv) {
  return run(PB_STUDY_TORSION, argc, argv);
}

static int axial(int argc, char **argv) {
  return run(PB_STUDY_AXIAL, argc, argv);
}

static int mass(int argc, char **argv) {
  return run(PB_STUDY_MASS, argc, argv);
}

static int joint_model(int argc, char **argv) {
  return run(PB_STUDY_JOINT_MODEL, argc, argv);
}

static int actuator_model(int argc, char **argv) {
  return run(PB_STUDY_ACTUATOR_MODEL, argc, argv);
}

static const pb_command commands[] = {
    {"bending", bending, "bending stiffness k_f of the joints (report fig. 3.2, 3.3)"},
    {"torsion", torsion, "torsional stiffness k_t of the joints"},
    {"axial", axial, "axial stiffness k_a of the joints (fig. 3.4, 3.5)"},
    {"mass", mass, "mass of the payload"},
    {"joint-model", joint_model,
     "joints ideal, with bending, with axial stiffness, bushings, elements (fig. 3.8)"},
    {"actuator-model", actuator_model,
     "struts of one or two degrees of freedom, elements (fig. 2.7)"},
    {0}};

int main(int argc, char **argv) {
  return pb_commands_run(argc, argv,
                         "Varies one thing over a hexapod and tells what it does to its control.",
                         commands);
}
