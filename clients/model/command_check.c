// plantbus-model check: loads a plant, shows the health of its elements and every warning.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "assembly/system.h"
#include "plant/element_doctor.h"
#include "plant/plant.h"
#include "table.h"
#include "tool.h"

typedef struct element_state {
  const pb_element *element;
  pb_diagnosis health;
} element_state;

typedef struct check {
  pb_plant *plant;
  pb_model *model;
  pb_warnings warnings;
  pb_error error;  // code PB_OK: the plant is usable
  size_t elements;
  element_state *element;  // [elements] each once
  double fastest_growth;   // largest real part of the poles, 1/s
} check;

static const pb_element *joint_element(const pb_connection *c) {
  return c->joint.type == PB_JOINT_ELEMENT ? c->joint.super.element : NULL;
}

static void add_element(check *c, const pb_element *element) {
  if (!element) return;
  for (size_t k = 0; k < c->elements; k++) {
    if (!strcmp(c->element[k].element->file, element->file)) return;
  }
  c->element[c->elements++].element = element;
}

static pb_status collect_elements(check *c, pb_error *err) {
  const pb_plant *p = c->plant;
  c->element = calloc(p->component_count + p->connection_count + 1, sizeof *c->element);
  if (!c->element) return pb_fail_memory(err, p->name);
  for (size_t k = 0; k < p->component_count; k++) {
    const pb_component *part = &p->component[k];
    if (part->type == PB_SUPER_ELEMENT) add_element(c, part->super.element);
  }
  for (size_t k = 0; k < p->connection_count; k++) {
    add_element(c, joint_element(&p->connection[k]));
  }
  pb_status status = PB_OK;
  for (size_t k = 0; !status && k < c->elements; k++)
    status = pb_element_check(c->element[k].element, &c->element[k].health, err);
  return status;
}

// A pole to the right of the axis by more than rounding would make every simulation run away.
static pb_status judge_poles(check *c, pb_error *err) {
  double complex *pole = malloc((c->model->nx + 1) * sizeof *pole);
  pb_status status = pole ? pb_model_poles(c->model, PB_CONTINUOUS, pole, err)
                          : pb_fail_memory(err, c->model->name);
  double worst = -INFINITY, frequency = 0;
  for (size_t k = 0; !status && k < c->model->nx; k++) {
    if (creal(pole[k]) <= worst) continue;
    worst = creal(pole[k]);
    frequency = cabs(pole[k]) / (2 * 3.14159265358979323846);
  }
  free(pole);
  c->fastest_growth = worst;
  if (status || worst <= 1e-6 * (1 + frequency)) return status;
  return pb_warn(&c->warnings, err, c->model->name, "a pole at %g Hz grows with %g per second",
                 frequency, worst);
}

static void run_check(const tool *t, check *c) {
  pb_error *err = &c->error;
  pb_system *system = NULL;
  pb_status status = pb_plant_load(t->file, &c->warnings, &c->plant, err);
  if (!status) status = collect_elements(c, err);
  if (!status) status = pb_system_assemble(c->plant, &c->warnings, &system, err);
  if (!status) status = pb_model_compile(system, &c->warnings, &c->model, err);
  pb_system_free(system);
  if (!status) judge_poles(c, err);
}

// ---- JSON ---------------------------------------------------------------------------------------

static void elements_json(pb_jsonout *json, const check *c) {
  pb_jsonout_array(json, "elements");
  for (size_t k = 0; k < c->elements; k++) {
    const pb_element *e = c->element[k].element;
    pb_jsonout_object(json, NULL);
    pb_jsonout_text(json, "file", e->file);
    pb_jsonout_integer(json, "frames", e->frames);
    pb_jsonout_integer(json, "modes", e->size - 6 * e->frames);
    pb_jsonout_number(json, "mass", e->health.mass);
    pb_jsonout_numbers(json, "center_of_mass", e->health.center, 3);
    pb_jsonout_number(json, "asymmetry_k", e->health.asymmetry_k);
    pb_jsonout_number(json, "asymmetry_m", e->health.asymmetry_m);
    pb_jsonout_number(json, "rigid_body_hz", e->health.rigid_hz);
    pb_jsonout_number(json, "first_flexible_hz", e->health.flexible_hz);
    pb_jsonout_boolean(json, "sound", !c->element[k].health.findings);
    char summary[1024];
    pb_diagnosis_summary(&c->element[k].health, summary, sizeof summary);
    pb_jsonout_text(json, "doctor", summary);
    pb_jsonout_object_end(json);
  }
  pb_jsonout_array_end(json);
}

static void message_json(pb_jsonout *json, const char *key, const char *where,
                         const char *message) {
  pb_jsonout_object(json, key);
  pb_jsonout_text(json, "where", where);
  pb_jsonout_text(json, "message", message);
  pb_jsonout_object_end(json);
}

static void check_json(pb_jsonout *json, const void *context) {
  const check *c = context;
  pb_jsonout_object(json, NULL);
  pb_jsonout_boolean(json, "good", c->error.code == PB_OK);
  if (c->error.code) message_json(json, "error", c->error.where, c->error.message);
  if (c->model) {
    pb_jsonout_text(json, "name", c->model->name);
    pb_jsonout_integer(json, "dof", c->model->dof);
    pb_jsonout_integer(json, "states", c->model->nx);
  }
  elements_json(json, c);
  pb_jsonout_array(json, "warnings");
  for (size_t k = 0; k < c->warnings.count; k++) {
    message_json(json, NULL, c->warnings.item[k].where, c->warnings.item[k].message);
  }
  pb_jsonout_array_end(json);
  pb_jsonout_object_end(json);
}

// ---- table --------------------------------------------------------------------------------------

static const char *base_name(const char *path) {
  const char *slash = strrchr(path, '/');
  return slash ? slash + 1 : path;
}

static pb_status print_elements(const check *c, pb_error *err) {
  if (!c->elements) return PB_OK;
  pb_table table = {0};
  pb_table_text_column(&table, "element");
  pb_table_number_column(&table, "frames", NULL, 3);
  pb_table_number_column(&table, "modes", NULL, 3);
  pb_table_number_column(&table, "mass", "kg", 4);
  pb_table_number_column(&table, "asymmetry K", NULL, 2);
  pb_table_number_column(&table, "asymmetry M", NULL, 2);
  pb_table_number_column(&table, "rigid body", "Hz", 3);
  pb_table_number_column(&table, "first mode", "Hz", 5);
  for (size_t k = 0; k < c->elements; k++) {
    const pb_element *e = c->element[k].element;
    pb_table_text(&table, base_name(e->file));
    pb_table_count(&table, e->frames);
    pb_table_count(&table, e->size - 6 * e->frames);
    pb_table_number(&table, e->health.mass);
    pb_table_number(&table, e->health.asymmetry_k);
    pb_table_number(&table, e->health.asymmetry_m);
    pb_table_number(&table, e->health.rigid_hz);
    pb_table_number(&table, e->health.flexible_hz);
  }
  pb_status status = pb_table_print(&table, stdout, 0, err);
  pb_table_free(&table);
  for (size_t k = 0; k < c->elements; k++) {
    char summary[1024];
    pb_diagnosis_summary(&c->element[k].health, summary, sizeof summary);
    printf("%s: %s\n", base_name(c->element[k].element->file), summary);
  }
  putchar('\n');
  return status;
}

static pb_status print_check(const check *c, pb_error *err) {
  pb_status status = print_elements(c, err);
  for (size_t k = 0; k < c->warnings.count; k++) {
    const pb_warning *w = &c->warnings.item[k];
    printf("warning: %s%s%s\n", w->where, w->where[0] ? ": " : "", w->message);
  }
  if (!c->error.code) {
    printf("%s: usable, %zu degrees of freedom, %zu states, %zu warning%s\n", c->model->name,
           c->model->dof, c->model->nx, c->warnings.count, c->warnings.count == 1 ? "" : "s");
  }
  return status;
}

int command_check(const tool *t) {
  check c = {0};
  pb_error err = {0};
  run_check(t, &c);
  int code = wants_table(t) ? tool_end(print_check(&c, &err), &err) : emit_json(t, check_json, &c);
  if (c.error.code) code = tool_end(c.error.code, &c.error);
  pb_model_free(c.model);
  pb_plant_free(c.plant);
  pb_warnings_clear(&c.warnings);
  free(c.element);
  return code;
}
