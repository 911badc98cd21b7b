// plantbus-gate: all limits of a specification against a plant file, in one table and an exit code.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "jsonout.h"
#include "results.h"
#include "study/gate.h"
#include "table.h"
#include "standard_output.h"

enum { KEY_JSON = 0x100 };

typedef struct gate_options {
  const char *spec, *plant;
  bool json;
} gate_options;

// Of OpenBLAS, when that is the BLAS in use.
void openblas_set_num_threads(int count) __attribute__((weak));

static const struct argp_option option_table[] = {
    {"json", KEY_JSON, NULL, 0, "Print JSON instead of a table", 1}, {0}};

static const char description[] =
    "Holds a plant file against all limits of a specification.\v"
    "SPEC is a JSON file with schema plantbus.gate/1: limits on stiffness, modes, stroke, "
    "attainable "
    "damping, coupling, order and the forces along the struts (config/specifications holds "
    "one).\n\n"
    "Exit codes: 0 all limits are held; 1 one is missed, the plant cannot be judged, or a file not "
    "read; 2 wrong command line or specification.";

static error_t parse(int key, char *text, struct argp_state *state) {
  gate_options *o = state->input;
  switch (key) {
  case KEY_JSON:
    o->json = true;
    break;
  case ARGP_KEY_ARG:
    if (state->arg_num > 1) argp_error(state, "unexpected argument '%s'", text);
    *(state->arg_num == 0 ? &o->spec : &o->plant) = text;
    break;
  case ARGP_KEY_END:
    if (!o->plant) argp_error(state, "a specification and a plant file are needed");
    break;
  default:
    return ARGP_ERR_UNKNOWN;
  }
  return 0;
}

static pb_status print_table(const gate_options *o, const pb_gate *g, pb_error *err) {
  pb_table t = {0};
  size_t missed = 0;
  pb_table_text_column(&t, "limit");
  pb_table_number_column(&t, "value", NULL, 4);
  pb_table_number_column(&t, "min", NULL, 4);
  pb_table_number_column(&t, "max", NULL, 4);
  pb_table_text_column(&t, "unit");
  pb_table_number_column(&t, "margin", "%", 3);
  pb_table_text_column(&t, "");
  for (size_t k = 0; k < g->count; k++) {
    const pb_gate_limit *l = &g->limit[k];
    char name[80];
    pb_gate_limit_name(l, name, sizeof name);
    pb_table_text(&t, name);
    pb_table_number(&t, l->value);
    pb_table_number(&t, l->min);
    pb_table_number(&t, l->max);
    pb_table_text(&t, pb_gate_limit_unit(l));
    pb_table_number(&t, 100 * l->margin);
    pb_table_text(&t, l->passed ? "pass" : "FAIL");
    missed += !l->passed;
  }
  printf("%s against '%s':\n", o->plant, g->name);
  pb_status status = pb_table_print(&t, stdout, 2, err);
  pb_table_free(&t);
  if (missed)
    printf("FAIL: %zu of %zu limits missed\n", missed, g->count);
  else
    printf("pass: all %zu limits\n", g->count);
  return status;
}

static void print_json(const gate_options *o, const pb_gate *g) {
  pb_jsonout j;
  pb_jsonout_begin(&j, stdout);
  pb_jsonout_object(&j, NULL);
  pb_jsonout_text(&j, "specification", g->name);
  pb_jsonout_text(&j, "plant", o->plant);
  pb_jsonout_boolean(&j, "passed", g->passed);
  pb_jsonout_array(&j, "limits");
  for (size_t k = 0; k < g->count; k++) {
    const pb_gate_limit *l = &g->limit[k];
    char name[80];
    pb_gate_limit_name(l, name, sizeof name);
    pb_jsonout_object(&j, NULL);
    pb_jsonout_text(&j, "pointer", l->pointer);
    pb_jsonout_text(&j, "limit", name);
    pb_jsonout_text(&j, "unit", pb_gate_limit_unit(l));
    pb_jsonout_number(&j, "value", l->value);
    pb_jsonout_number(&j, "min", l->min);
    pb_jsonout_number(&j, "max", l->max);
    pb_jsonout_number(&j, "margin", l->margin);
    pb_jsonout_boolean(&j, "passed", l->passed);
    pb_jsonout_object_end(&j);
  }
  pb_jsonout_array_end(&j);
  pb_jsonout_object_end(&j);
  pb_jsonout_end(&j);
}

// Puts the file's name before the place in it.
static void name_file(const char *path, pb_error *err) {
  char where[sizeof err->where];
  if (!strcmp(err->where, path)) return;
  snprintf(where, sizeof where, "%.120s: %.120s", path, err->where);
  memcpy(err->where, where, sizeof where);
}

static pb_status judge(const gate_options *o, pb_gate *gate, pb_error *err) {
  cJSON *plant = NULL;
  const char *slash = strrchr(o->plant, '/');
  char *directory = slash ? strndup(o->plant, (size_t)(slash - o->plant) + 1) : strdup(".");
  pb_status status =
      directory ? pb_json_read(o->plant, &plant, NULL, err) : pb_fail_memory(err, o->plant);
  if (!status) {
    status = pb_gate_judge(gate, plant, directory, err);
    if (status) name_file(strncmp(err->where, "/limits/", 8) ? o->plant : o->spec, err);
  }
  cJSON_Delete(plant);
  free(directory);
  return status;
}

static pb_status read_spec(const gate_options *o, pb_gate *gate, pb_error *err) {
  cJSON *spec = NULL;
  pb_status status = pb_json_read(o->spec, &spec, NULL, err);
  if (!status) {
    status = pb_gate_read(spec, gate, err);
    if (status) name_file(o->spec, err);
  }
  cJSON_Delete(spec);
  return status;
}

int main(int argc, char **argv) {
  static const struct argp argp = {option_table, parse, "SPEC PLANT", description,
                                   NULL,         NULL,  NULL};
  gate_options o = {0};
  pb_gate gate = {0};
  pb_error err = {0};
  pb_options_parse(&argp, argc, argv, &o);
  if (openblas_set_num_threads) openblas_set_num_threads(1);
  pb_status status = read_spec(&o, &gate, &err);
  int code = !status ? PB_EXIT_DONE : status == PB_ERR_IO ? PB_EXIT_FAILED : PB_EXIT_USAGE;
  if (!status) {
    status = judge(&o, &gate, &err);
    if (!status && o.json)
      print_json(&o, &gate);
    else if (!status)
      status = print_table(&o, &gate, &err);
    if (!status) status = pb_stdout_flush(&err);
    code = !status && gate.passed ? PB_EXIT_DONE : PB_EXIT_FAILED;
  }
  if (status) pb_print_error(stderr, &err);
  pb_gate_clear(&gate);
  return code;
}
