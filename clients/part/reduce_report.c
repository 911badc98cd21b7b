// What plantbus-part reduce says of an element: tables, or one JSON object.
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "jsonout.h"
#include "reduce.h"
#include "table.h"
#include "standard_output.h"

enum { SHOWN = 12 };  // frequencies of each kind in the tables

static const double two_pi = 6.283185307179586476925286766559;

void reduce_measure(reduce_usage *usage) {
  usage->resident = usage->peak = 0;
  FILE *f = fopen("/proc/self/status", "r");
  char line[256];
  double kib;
  while (f && fgets(line, sizeof line, f)) {
    if (sscanf(line, "VmRSS: %lf", &kib) == 1) usage->resident = 1024 * kib;
    if (sscanf(line, "VmHWM: %lf", &kib) == 1) usage->peak = 1024 * kib;
  }
  if (f) fclose(f);
}

static double free_hz(const pb_element *e, size_t i) {
  double omega2 = e->omega2[i];
  return omega2 < 0 ? -sqrt(-omega2) / two_pi : sqrt(omega2) / two_pi;
}

// ---- tables -------------------------------------------------------------------------------------

static pb_status print_frames(const reduce_run *run, pb_error *err) {
  pb_table table = {0};
  pb_table_text_column(&table, "frame");
  pb_table_text_column(&table, "tie");
  pb_table_number_column(&table, "nodes", NULL, 6);
  static const char *const axis[3] = {"x", "y", "z"};
  for (size_t a = 0; a < 3; a++) pb_table_number_column(&table, axis[a], "mm", 6);
  for (size_t f = 0; f < run->fem.frames; f++) {
    const pb_fem_frame *frame = &run->fem.frame[f];
    pb_table_text(&table, frame->name);
    pb_table_text(&table, frame->tie == PB_TIE_RIGID ? "rigid" : "averaged");
    pb_table_count(&table, frame->nodes);
    for (size_t a = 0; a < 3; a++) pb_table_number(&table, 1e3 * frame->origin[a]);
  }
  pb_status st = pb_table_print(&table, stdout, 2, err);
  pb_table_free(&table);
  return st;
}

static pb_status print_frequencies(const reduce_run *run, pb_error *err) {
  const pb_reduction *r = run->element;
  pb_table table = {0};
  pb_table_number_column(&table, "mode", NULL, 3);
  pb_table_number_column(&table, "frames held", "Hz", 6);
  pb_table_number_column(&table, "free", "Hz", 6);
  for (size_t i = 0; i < SHOWN && i < r->size; i++) {
    pb_table_count(&table, i + 1);
    pb_table_number(&table, i < r->modes ? r->fixed_hz[i] : NAN);
    pb_table_number(&table, free_hz(run->free_element, i));
  }
  pb_status st = pb_table_print(&table, stdout, 2, err);
  pb_table_free(&table);
  return st;
}

static pb_status print_checks(const pb_reduction *r, pb_error *err) {
  pb_table table = {0};
  pb_table_number_column(&table, "frequency", "Hz", 5);
  pb_table_number_column(&table, "error of K − ω²M", "%", 3);
  pb_table_number_column(&table, "modes below, held", NULL, 6);
  pb_table_number_column(&table, "free", NULL, 6);
  for (size_t i = 0; i < r->checks; i++) {
    pb_table_number(&table, r->check[i].hz);
    pb_table_number(&table, 100 * r->check[i].error);
    pb_table_count(&table, r->check[i].fixed_below);
    pb_table_count(&table, r->check[i].free_below);
  }
  printf("\nagainst the full model\n");
  pb_status st = pb_table_print(&table, stdout, 2, err);
  pb_table_free(&table);
  return st;
}

static void print_usage(pb_table *table, const char *name, const reduce_usage *u) {
  pb_table_text(table, name);
  pb_table_number(table, u->seconds);
  pb_table_number(table, 1e-6 * u->resident);
  pb_table_number(table, 1e-6 * u->peak);
}

static pb_status print_phases(const reduce_run *run, pb_error *err) {
  pb_table table = {0};
  pb_table_text_column(&table, "phase");
  pb_table_number_column(&table, "time", "s", 3);
  pb_table_number_column(&table, "memory", "MB", 4);
  pb_table_number_column(&table, "most so far", "MB", 4);
  print_usage(&table, "reading", &run->read);
  for (size_t p = 0; p < PB_REDUCE_PHASES; p++)
    if (run->usage[p].seconds > 0 || p != PB_REDUCE_CHECK)
      print_usage(&table, pb_reduce_phase_name((pb_reduce_phase)p), &run->usage[p]);
  pb_status st = pb_table_print(&table, stdout, 2, err);
  pb_table_free(&table);
  return st;
}

static void print_head(const reduce_run *run) {
  const pb_reduction *r = run->element;
  const pb_element_health *h = &run->free_element->health;
  printf("%s: %zu degrees of freedom → %zu (%zu frames, %zu modes", run->fem.name, r->full_dof,
         r->size, r->frames, r->modes);
  if (r->modes) printf(" up to %.5g Hz", r->fixed_hz[r->modes - 1]);
  printf(")\n");
  printf("rows: %s\n", run->row_source);
  if (r->proven_hz > 0)
    printf("counted in the full model: these are all modes below %.6g Hz\n", r->proven_hz);
  printf("mass %.7g kg (full model %.7g kg), centre (%.5g, %.5g, %.5g) mm\n", r->mass, r->full_mass,
         1e3 * h->center[0], 1e3 * h->center[1], 1e3 * h->center[2]);
  printf("rigid motions: forces of %.1e of the stiffness; free element at most %.3g Hz, first "
         "deforming mode %.5g Hz\n",
         r->rigid_residual, fabs(h->rigid_hz), h->flexible_hz);
  if (r->rigid_residual > 1e-6)
    printf("  the full model resists rigid motions: it is fixed somewhere, or its coordinates do "
           "not fit its matrices\n");
  printf("\n");
}

static pb_status report_text(const reduce_run *run, const reduce_options *o, pb_error *err) {
  print_head(run);
  pb_status st = print_frames(run, err);
  printf("\n");
  if (!st) st = print_frequencies(run, err);
  if (!st && run->element->checks) st = print_checks(run->element, err);
  printf("\n");
  if (!st) st = print_phases(run, err);
  if (!st && o->out) printf("\nelement: %s\n", o->out);
  return st;
}

// ---- JSON ---------------------------------------------------------------------------------------

static void json_frames(pb_jsonout *json, const reduce_run *run) {
  pb_jsonout_array(json, "frames");
  for (size_t f = 0; f < run->fem.frames; f++) {
    const pb_fem_frame *frame = &run->fem.frame[f];
    pb_jsonout_object(json, NULL);
    pb_jsonout_text(json, "name", frame->name);
    pb_jsonout_text(json, "tie", frame->tie == PB_TIE_RIGID ? "rigid" : "averaged");
    pb_jsonout_integer(json, "nodes", frame->nodes);
    pb_jsonout_numbers(json, "origin", frame->origin, 3);
    pb_jsonout_object_end(json);
  }
  pb_jsonout_array_end(json);
}

static void json_checks(pb_jsonout *json, const pb_reduction *r) {
  pb_jsonout_array(json, "checks");
  for (size_t i = 0; i < r->checks; i++) {
    pb_jsonout_object(json, NULL);
    pb_jsonout_number(json, "hz", r->check[i].hz);
    pb_jsonout_number(json, "error", r->check[i].error);
    pb_jsonout_integer(json, "fixed_below", r->check[i].fixed_below);
    pb_jsonout_integer(json, "free_below", r->check[i].free_below);
    pb_jsonout_object_end(json);
  }
  pb_jsonout_array_end(json);
}

static void json_usage(pb_jsonout *json, const char *name, const reduce_usage *u) {
  pb_jsonout_object(json, NULL);
  pb_jsonout_text(json, "phase", name);
  pb_jsonout_number(json, "seconds", u->seconds);
  pb_jsonout_number(json, "resident_bytes", u->resident);
  pb_jsonout_number(json, "peak_bytes", u->peak);
  pb_jsonout_object_end(json);
}

static void json_frequencies(pb_jsonout *json, const reduce_run *run) {
  const pb_reduction *r = run->element;
  pb_jsonout_numbers(json, "fixed_hz", r->fixed_hz, r->modes);
  pb_jsonout_row(json, "free_hz");
  for (size_t i = 0; i < r->size; i++) pb_jsonout_number(json, NULL, free_hz(run->free_element, i));
  pb_jsonout_array_end(json);
}

static pb_status report_json(const reduce_run *run, const reduce_options *o, pb_error *err) {
  const pb_reduction *r = run->element;
  const pb_element_health *h = &run->free_element->health;
  pb_jsonout json;
  pb_jsonout_begin(&json, stdout);
  pb_jsonout_object(&json, NULL);
  pb_jsonout_text(&json, "name", run->fem.name);
  pb_jsonout_text(&json, "element", o->out);
  pb_jsonout_text(&json, "rows_from", run->row_source);
  pb_jsonout_integer(&json, "full_dof", r->full_dof);
  pb_jsonout_integer(&json, "size", r->size);
  pb_jsonout_integer(&json, "modes", r->modes);
  pb_jsonout_number(&json, "proven_hz", r->proven_hz > 0 ? r->proven_hz : NAN);
  pb_jsonout_number(&json, "mass", r->mass);
  pb_jsonout_number(&json, "full_mass", r->full_mass);
  pb_jsonout_numbers(&json, "center", h->center, 3);
  pb_jsonout_number(&json, "rigid_residual", r->rigid_residual);
  pb_jsonout_number(&json, "rigid_hz", h->rigid_hz);
  pb_jsonout_number(&json, "first_free_hz", h->flexible_hz);
  json_frames(&json, run);
  json_frequencies(&json, run);
  json_checks(&json, r);
  pb_jsonout_integer(&json, "factor_entries", r->factor_entries);
  pb_jsonout_array(&json, "phases");
  json_usage(&json, "reading", &run->read);
  for (size_t p = 0; p < PB_REDUCE_PHASES; p++)
    json_usage(&json, pb_reduce_phase_name((pb_reduce_phase)p), &run->usage[p]);
  pb_jsonout_array_end(&json);
  pb_jsonout_object_end(&json);
  pb_jsonout_end(&json);
  return pb_stdout_flush(err);
}

pb_status reduce_report(const reduce_run *run, const reduce_options *o, pb_error *err) {
  return o->json ? report_json(run, o, err) : report_text(run, o, err);
}
