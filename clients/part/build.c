// plantbus-part build: dimensions → mesh → K and M → element, without any outside program.
#include "build.h"

#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "outfile.h"
#include "part.h"

enum {
  KEY_JSON = 0x100,
  KEY_FORMAT,
  KEY_MESH,
  KEY_MODES,
  KEY_TIE,
  KEY_SET,
  KEY_SWEEP,
  KEY_CONVERGENCE,
  KEY_PLOT,
  KEY_PICTURE,
  KEY_PICTURE_MODE,
  KEY_FULL
};

static const struct argp_option option_table[] = {
    {NULL, 'o', "FILE", 0, "Write the element: MAT v5, or Matrix Market where FILE ends in .mtx",
     1},
    {"format", KEY_FORMAT, "mat|mtx", 0, "Write this format whatever the name of the file", 1},
    {"json", KEY_JSON, NULL, 0, "Print JSON instead of tables", 1},
    {"mesh", KEY_MESH, "N", 0, "Density of the mesh: 1 coarse, 2 half the element size …", 2},
    {"modes", KEY_MODES, "P", 0, "Number of fixed-interface modes", 2},
    {"tie", KEY_TIE, "averaged|rigid", 0, "How frames are tied to their faces", 2},
    {"set", KEY_SET, "/POINTER=VALUE", 0, "Change a value of the part file; may be repeated", 2},
    {"sweep", KEY_SWEEP, "/POINTER=V,V,...", 0, "A table of characteristics over these values", 3},
    {"convergence", KEY_CONVERGENCE, "N,N,...", OPTION_ARG_OPTIONAL,
     "A table of characteristics over densities of the mesh (default 0.5,0.75,1,1.5)", 3},
    {"plot", KEY_PLOT, "FILE.png", 0, "Plot the table of --sweep or --convergence", 3},
    {"picture", KEY_PICTURE, "FILE", 0, "Draw the meshed part: .svg or .png", 4},
    {"picture-mode", KEY_PICTURE_MODE, "K", 0,
     "Draw mode K of the part held at its bottom frame, exaggerated", 4},
    {"full", KEY_FULL, "DIR", 0,
     "Write the full K and M (Matrix Market), nodes, frames and a CalculiX deck into DIR", 4},
    {0},
};

static const char description[] =
    "Builds the super-element of a part from its dimensions: structured mesh of 20-node hexahedra, "
    "sparse K and M, reduction to the part's frames.\v"
    "PART.json is described in docs/parts.md; config/parts holds three. VALUE is JSON, or a bare "
    "word as a string.";

static void add_set(build_options *o, const char *pointer, const char *value,
                    struct argp_state *state) {
  const char **set = realloc(o->set, (o->sets + 1) * sizeof *set);
  char *text = malloc(strlen(pointer) + strlen(value) + 1);
  if (!set || !text) argp_failure(state, PB_EXIT_FAILED, 0, "out of memory");
  strcpy(text, pointer);
  strcat(text, value);
  o->set = set;
  o->set[o->sets++] = text;
}

static const double least_density = 0.5, most_density = 6;  // of /mesh/density

static void parse_densities(build_options *o, const char *arg, struct argp_state *state) {
  free(o->density);
  pb_option_double_list(state, "--convergence", arg ? arg : "0.5,0.75,1,1.5", &o->density,
                        &o->densities);
  for (size_t i = 0; i < o->densities; i++)
    if (!(o->density[i] >= least_density && o->density[i] <= most_density))
      argp_error(state, "--convergence: %g is out of range, expected %g to %g", o->density[i],
                 least_density, most_density);
}

static void check_suffix(const char *flag, const char *path, bool svg, struct argp_state *state) {
  size_t n = strlen(path);
  bool good = n > 4 && (!strcmp(path + n - 4, ".png") || (svg && !strcmp(path + n - 4, ".svg")));
  if (!good)
    argp_error(state, "%s: '%s' does not end in %s", flag, path, svg ? ".svg or .png" : ".png");
}

static void check_sweep(const char *arg, struct argp_state *state) {
  const char *equal = strchr(arg, '=');
  if (arg[0] != '/' || !equal) argp_error(state, "--sweep: expected /pointer=value,value,...");
  double *value = NULL;
  size_t count;
  pb_option_double_list(state, "--sweep", equal + 1, &value, &count);
  free(value);
}

static void check_line(const build_options *o, struct argp_state *state) {
  bool table = o->sweep || o->densities;
  if (!o->file) argp_error(state, "expected a part file");
  if (o->sweep && o->densities) argp_error(state, "--sweep and --convergence exclude each other");
  if (table && (o->out || o->picture || o->full))
    argp_error(state, "a table of many elements writes no element, picture or full model");
  if (o->plot && !table) argp_error(state, "--plot needs --sweep or --convergence");
  if (o->picture_mode && !o->picture) argp_error(state, "--picture-mode needs --picture");
  if (o->sweep) check_sweep(o->sweep, state);
}

static error_t parse_files(int key, char *arg, struct argp_state *state, build_options *o) {
  switch (key) {
  case 'o':
    o->out = arg;
    return 0;
  case KEY_FORMAT:
    if (!pb_element_format_parse(arg, &o->format))
      argp_error(state, "--format: expected mat or mtx, not '%s'", arg);
    return 0;
  case KEY_JSON:
    o->json = true;
    return 0;
  case KEY_PLOT:
    check_suffix("--plot", arg, false, state);
    o->plot = arg;
    return 0;
  case KEY_PICTURE:
    check_suffix("--picture", arg, true, state);
    o->picture = arg;
    return 0;
  case KEY_PICTURE_MODE:
    o->picture_mode = (size_t)pb_option_uint64(state, "--picture-mode", arg, 1, 1000);
    return 0;
  case KEY_FULL:
    o->full = arg;
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

static error_t parse(int key, char *arg, struct argp_state *state) {
  build_options *o = state->input;
  switch (key) {
  case KEY_MESH:
    pb_option_double(state, "--mesh", arg, least_density, most_density);
    add_set(o, "/mesh/density=", arg, state);
    return 0;
  case KEY_MODES:
    pb_option_uint64(state, "--modes", arg, 1, 1000);
    add_set(o, "/modes=", arg, state);
    return 0;
  case KEY_TIE:
    if (strcmp(arg, "averaged") && strcmp(arg, "rigid"))
      argp_error(state, "--tie: expected averaged or rigid, not '%s'", arg);
    add_set(o, "/frames/tie=", arg, state);
    return 0;
  case KEY_SET:
    if (arg[0] != '/' || !strchr(arg, '='))
      argp_error(state, "--set: expected /pointer=value, not '%s'", arg);
    add_set(o, arg, "", state);
    return 0;
  case KEY_SWEEP:
    o->sweep = arg;
    return 0;
  case KEY_CONVERGENCE:
    parse_densities(o, arg, state);
    return 0;
  case ARGP_KEY_ARG:
    if (o->file) argp_error(state, "one part file only");
    o->file = arg;
    return 0;
  case ARGP_KEY_END:
    check_line(o, state);
    return 0;
  default:
    return parse_files(key, arg, state, o);
  }
}

static pb_status build_one(const build_options *o, pb_error *err) {
  cJSON *json = NULL;
  build b = {0};
  pb_status st = pb_outfile_probe(o->out, err);
  if (!st) st = pb_outfile_probe(o->picture, err);
  if (!st) st = build_read(o, &json, err);
  if (!st) st = build_model(json, &b, err);
  if (!st) st = build_reduce(&b, o->picture_mode > 0, err);
  if (!st && o->out) st = build_write(&b, o, err);
  if (!st && o->full) st = build_full(&b, o->full, err);
  if (!st && o->picture) st = build_picture(&b, o, err);
  if (!st) st = build_report(&b, o, err);
  build_clear(&b);
  cJSON_Delete(json);
  return st;
}

int part_build(int argc, char **argv) {
  static const struct argp argp = {option_table, parse, "PART.json", description, NULL, NULL, NULL};
  build_options options = {0};
  pb_error err = {0};
  pb_options_parse(&argp, argc, argv, &options);
  pb_status st = pb_outfile_probe(options.plot, &err);
  if (!st)
    st = options.sweep       ? build_sweep(&options, &err)
         : options.densities ? build_converge(&options, &err)
                             : build_one(&options, &err);
  if (st) pb_print_error(stderr, &err);
  for (size_t i = 0; i < options.sets; i++) free((char *)options.set[i]);
  free(options.set);
  free(options.density);
  return st ? PB_EXIT_FAILED : PB_EXIT_DONE;
}
