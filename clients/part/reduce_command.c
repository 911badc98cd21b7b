// plantbus-part reduce: full K and M from an outside program → element.
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/text.h"
#include "blas_threads.h"
#include "options.h"
#include "outfile.h"
#include "part.h"
#include "progress.h"
#include "reduce.h"

enum {
  KEY_JSON = 0x100,
  KEY_FORMAT,
  KEY_NODES,
  KEY_DOFS,
  KEY_FRAMES,
  KEY_FRAME,
  KEY_SETS,
  KEY_NAME,
  KEY_UNITS,
  KEY_MODES,
  KEY_MAX_FREQUENCY,
  KEY_PROVE,
  KEY_CHECK,
  KEY_CHECK_TO
};

static const reduce_units unit_systems[] = {
    {"m-N-kg", 1, 1, 1},
    {"mm-N-t", 1e-3, 1e3, 1e3},
    {"mm-mN-kg", 1e-3, 1, 1},
};

static const struct argp_option option_table[] = {
    {"nodes", KEY_NODES, "FILE", 0, "Numbers and places of the nodes (needed)", 1},
    {"dofs", KEY_DOFS, "FILE", 0,
     "Node and direction of each row, where K's file does not say; CalculiX' .dof is found by "
     "itself",
     1},
    {"units", KEY_UNITS, "SYSTEM", 0, "Of the files: m-N-kg (default), mm-N-t or mm-mN-kg", 1},
    {"frames", KEY_FRAMES, "FILE", 0, "Interface frames (plantbus.frames/1)", 2},
    {"frame", KEY_FRAME, "NAME={...}", 0, "One frame, an object as in that file; may be repeated",
     2},
    {"sets", KEY_SETS, "FILE", 0, "Input deck whose node sets the frames of --frame name", 2},
    {"modes", KEY_MODES, "P", 0, "Keep this many fixed-interface modes", 3},
    {"max-frequency", KEY_MAX_FREQUENCY, "HZ", 0,
     "Keep all of them up to this frequency, their number proven (with --modes: at most P)", 3},
    {"prove", KEY_PROVE, NULL, 0, "Prove also for --modes alone that none is missing", 3},
    {"check", KEY_CHECK, "N", 0, "Compare with the full model at N frequencies", 3},
    {"check-to", KEY_CHECK_TO, "HZ", 0, "The highest of them (default: half of the last kept mode)",
     3},
    {NULL, 'o', "FILE", 0, "Write the element: MAT v5, or Matrix Market where FILE ends in .mtx",
     4},
    {"format", KEY_FORMAT, "mat|mtx", 0, "Write this format whatever the name of the file", 4},
    {"name", KEY_NAME, "NAME", 0, "Of the part (default: the stiffness file's)", 4},
    {"json", KEY_JSON, NULL, 0, "Print JSON instead of tables", 4},
    {0},
};

static const char description[] =
    "Reduces full stiffness and mass matrices to interface frames and fixed-interface modes "
    "(Craig-Bampton).\v"
    "STIFFNESS and MASS: CalculiX .sti and .mas, Matrix Market, Ansys MMF, and what else "
    "plantbus-part import reads; told apart by their content. The frames' file, and how rows find "
    "their nodes: docs/parts-reduce.md.";

// ---- command line -------------------------------------------------------------------------------

static const reduce_units *find_units(const char *name, struct argp_state *state) {
  for (size_t i = 0; i < sizeof unit_systems / sizeof *unit_systems; i++)
    if (!strcmp(name, unit_systems[i].name)) return &unit_systems[i];
  argp_error(state, "--units: expected m-N-kg, mm-N-t or mm-mN-kg, not '%s'", name);
  return NULL;
}

static void add_frame(reduce_options *o, const char *arg, struct argp_state *state) {
  const char **more = realloc(o->inline_frame, (o->inline_frames + 1) * sizeof *more);
  if (!more) argp_failure(state, PB_EXIT_FAILED, 0, "out of memory");
  o->inline_frame = more;
  o->inline_frame[o->inline_frames++] = arg;
}

static void check_line(const reduce_options *o, struct argp_state *state) {
  const pb_reduce_options *r = &o->reduce;
  if (!o->mass) argp_error(state, "expected the files of K and of M");
  if (!o->nodes) argp_error(state, "--nodes is missing");
  if (!o->frames && !o->inline_frames) argp_error(state, "no frame: --frames or --frame");
  if (!r->modes && !(r->max_hz > 0))
    argp_error(state, "how many modes: --modes or --max-frequency");
  if (r->check_to_hz > 0 && !r->check_points) argp_error(state, "--check-to needs --check");
}

static error_t parse_numbers(int key, char *arg, struct argp_state *state, pb_reduce_options *o) {
  switch (key) {
  case KEY_MODES:
    o->modes = (size_t)pb_option_uint64(state, "--modes", arg, 1, 10000);
    return 0;
  case KEY_MAX_FREQUENCY:
    o->max_hz = pb_option_double(state, "--max-frequency", arg, 1e-9, 1e12);
    return 0;
  case KEY_PROVE:
    o->prove = true;
    return 0;
  case KEY_CHECK:
    o->check_points = (size_t)pb_option_uint64(state, "--check", arg, 1, 1000);
    return 0;
  case KEY_CHECK_TO:
    o->check_to_hz = pb_option_double(state, "--check-to", arg, 1e-9, 1e12);
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

static error_t parse_files(int key, char *arg, struct argp_state *state, reduce_options *o) {
  switch (key) {
  case KEY_NODES:
    o->nodes = arg;
    return 0;
  case KEY_DOFS:
    o->dofs = arg;
    return 0;
  case KEY_FRAMES:
    o->frames = arg;
    return 0;
  case KEY_FRAME:
    add_frame(o, arg, state);
    return 0;
  case KEY_SETS:
    o->sets = arg;
    return 0;
  case KEY_UNITS:
    o->units = find_units(arg, state);
    return 0;
  default:
    return parse_numbers(key, arg, state, &o->reduce);
  }
}

static error_t parse(int key, char *arg, struct argp_state *state) {
  reduce_options *o = state->input;
  switch (key) {
  case 'o':
    o->out = arg;
    return 0;
  case KEY_FORMAT:
    if (!pb_element_format_parse(arg, &o->format))
      argp_error(state, "--format: expected mat or mtx, not '%s'", arg);
    return 0;
  case KEY_NAME:
    o->name = arg;
    return 0;
  case KEY_JSON:
    o->json = true;
    return 0;
  case ARGP_KEY_ARG:
    if (state->arg_num > 1) argp_error(state, "unexpected argument '%s'", arg);
    *(state->arg_num ? &o->mass : &o->stiffness) = arg;
    return 0;
  case ARGP_KEY_END:
    check_line(o, state);
    return 0;
  default:
    return parse_files(key, arg, state, o);
  }
}

// ---- the run ------------------------------------------------------------------------------------

// A phase's memory is read when the next one begins.
typedef struct watch {
  pb_progress line;
  reduce_run *run;
  pb_reduce_phase phase;
  bool any;
} watch;

static bool follow(void *context, pb_reduce_phase phase, double done, double total) {
  watch *w = context;
  if (!w->any || phase != w->phase) {
    if (w->any) reduce_measure(&w->run->usage[w->phase]);
    w->any = true;
    w->phase = phase;
  }
  pb_blas_threads(phase);
  pb_progress_update(&w->line, done, total, pb_reduce_phase_name(phase));
  return true;
}

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static pb_status reduce_element(const reduce_options *o, reduce_run *run, pb_error *err) {
  watch w = {.run = run};
  pb_progress_begin(&w.line, stderr, run->fem.name);
  pb_reduce_options options = o->reduce;
  options.spend = &run->fem.k;
  options.progress = follow;
  options.context = &w;
  pb_status st = pb_reduce(&run->fem, &options, false, &run->element, err);
  pb_progress_end(&w.line);
  if (w.any) reduce_measure(&run->usage[w.phase]);
  for (size_t p = 0; !st && p < PB_REDUCE_PHASES; p++)
    run->usage[p].seconds = run->element->seconds[p];
  const pb_reduction *r = run->element;
  if (!st)
    st = pb_element_new(run->fem.name, r->frames, r->size, r->position, r->k, r->m, NULL,
                        &run->free_element, err);
  return st;
}

static const char *base_name(const char *path) {
  const char *slash = strrchr(path, '/');
  return slash ? slash + 1 : path;
}

// No directory and no date: the same files give the same bytes wherever they lie.
static void describe(const reduce_options *o, const reduce_run *run, pb_text *text) {
  const pb_reduction *r = run->element;
  pb_text_format(text, "plantbus-part reduce, version %s\n", PB_VERSION);
  pb_text_format(text, "from %s and %s (%s): %zu degrees of freedom, %zu nodes\n",
                 base_name(o->stiffness), base_name(o->mass), o->units->name, r->full_dof,
                 run->fem.nodes);
  for (size_t f = 0; f < run->fem.frames; f++) {
    const pb_fem_frame *frame = &run->fem.frame[f];
    pb_text_format(text, "frame %s: %s, %zu nodes\n", frame->name,
                   frame->tie == PB_TIE_RIGID ? "rigid" : "averaged", frame->nodes);
  }
  if (r->proven_hz > 0)
    pb_text_format(text, "all fixed-interface modes below %.9g Hz, by a count\n", r->proven_hz);
}

static pb_status write_element(const reduce_options *o, const reduce_run *run, pb_error *err) {
  const pb_reduction *r = run->element;
  pb_text text = {0};
  const char **name = malloc((r->frames + 1) * sizeof *name);
  describe(o, run, &text);
  pb_status st = name && !text.failed ? PB_OK : pb_fail_memory(err, o->out);
  for (size_t f = 0; !st && f < r->frames; f++) name[f] = run->fem.frame[f].name;
  pb_element_out element = {.name = run->fem.name,
                            .frames = r->frames,
                            .size = r->size,
                            .position = r->position,
                            .k = r->k,
                            .m = r->m,
                            .frame_name = name,
                            .fixed_hz = r->fixed_hz,
                            .provenance = text.text};
  if (!st) st = pb_element_write(&element, o->out, o->format, err);
  free(text.text);
  free(name);
  return st;
}

int part_reduce(int argc, char **argv) {
  reduce_options options = {.units = unit_systems};
  reduce_run run = {0};
  pb_error err = {0};
  const struct argp argp = {option_table, parse, "STIFFNESS MASS", description, NULL, NULL, NULL};
  pb_options_parse(&argp, argc, argv, &options);
  double begun = now();
  pb_status st = pb_outfile_probe(options.out, &err);
  if (!st) st = reduce_read(&options, &run, &err);
  reduce_measure(&run.read);
  run.read.seconds = now() - begun;
  if (!st) st = reduce_element(&options, &run, &err);
  if (!st && options.out) st = write_element(&options, &run, &err);
  if (!st) st = reduce_report(&run, &options, &err);
  if (st) pb_print_error(stderr, &err);
  pb_element_free(run.free_element);
  pb_reduction_free(run.element);
  pb_fem_clear(&run.fem);
  free(options.inline_frame);
  return st ? PB_EXIT_FAILED : PB_EXIT_DONE;
}
