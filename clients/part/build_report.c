// What an element is known by, beside what is published of the part.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "build.h"
#include "jsonout.h"
#include "table.h"
#include "standard_output.h"

static double published(const pb_part *part, const char *name) {
  for (size_t i = 0; i < part->published; i++)
    if (!strcmp(part->publication[i].name, name)) return part->publication[i].value;
  return NAN;
}

static pb_status characteristics_table(const build *b, pb_error *err) {
  pb_table table = {0};
  pb_table_text_column(&table, "characteristic");
  pb_table_number_column(&table, "element", NULL, 5);
  pb_table_number_column(&table, "published", NULL, 5);
  pb_table_number_column(&table, "diff", "%", 3);
  pb_table_text_column(&table, "unit");
  for (size_t i = 0; i < b->values; i++) {
    double known = published(&b->part, b->value[i].name);
    pb_table_text(&table, b->value[i].name);
    pb_table_number(&table, b->value[i].value);
    pb_table_number(&table, known);
    pb_table_number(&table, 100 * (b->value[i].value / known - 1));
    pb_table_text(&table, b->value[i].unit);
  }
  pb_status st = pb_table_print(&table, stdout, 2, err);
  pb_table_free(&table);
  return st;
}

static pb_status frames_table(const build *b, pb_error *err) {
  pb_table table = {0};
  pb_table_number_column(&table, "frame", NULL, 3);
  pb_table_text_column(&table, "name");
  for (int a = 0; a < 3; a++)
    pb_table_number_column(&table, (const char *[]){"x", "y", "z"}[a], "mm", 6);
  pb_table_number_column(&table, "nodes", NULL, 6);
  for (size_t i = 0; i < b->fem.frames; i++) {
    pb_table_count(&table, i + 1);
    pb_table_text(&table, b->fem.frame[i].name);
    for (int a = 0; a < 3; a++) pb_table_number(&table, 1e3 * b->fem.frame[i].origin[a]);
    pb_table_count(&table, b->fem.frame[i].nodes);
  }
  pb_status st = pb_table_print(&table, stdout, 2, err);
  pb_table_free(&table);
  return st;
}

static pb_status report_text(const build *b, const build_options *options, pb_error *err) {
  const pb_reduction *r = b->element;
  printf("%s: %zu elements, %zu degrees of freedom → %zu (%zu frames, %zu modes up to %.4g kHz)\n",
         b->part.name, b->mesh.elements, r->full_dof, r->size, r->frames, r->modes,
         1e-3 * r->fixed_hz[r->modes - 1]);
  printf("mesh and matrices %.2f s, reduction %.2f s\n", b->seconds[0], b->seconds[1]);
  printf("free element: rigid motions below %.2g Hz, first deforming mode at %.5g Hz\n\n",
         fabs(b->rigid_hz), b->flexible_hz);
  pb_status st = frames_table(b, err);
  printf("\n");
  if (!st) st = characteristics_table(b, err);
  if (!st && options->out) printf("\nelement: %s\n", options->out);
  return st;
}

static pb_status report_json(const build *b, const build_options *options, pb_error *err) {
  const pb_reduction *r = b->element;
  pb_jsonout json;
  pb_jsonout_begin(&json, stdout);
  pb_jsonout_object(&json, NULL);
  pb_jsonout_text(&json, "name", b->part.name);
  pb_jsonout_text(&json, "type", pb_part_type_name(b->part.type));
  pb_jsonout_text(&json, "element", options->out);
  pb_jsonout_integer(&json, "elements", b->mesh.elements);
  pb_jsonout_integer(&json, "full_dof", r->full_dof);
  pb_jsonout_integer(&json, "size", r->size);
  pb_jsonout_integer(&json, "modes", r->modes);
  pb_jsonout_numbers(&json, "fixed_hz", r->fixed_hz, r->modes);
  pb_jsonout_number(&json, "rigid_hz", b->rigid_hz);
  pb_jsonout_number(&json, "first_free_hz", b->flexible_hz);
  pb_jsonout_numbers(&json, "seconds", b->seconds, 2);
  pb_jsonout_array(&json, "frames");
  for (size_t i = 0; i < b->fem.frames; i++) {
    pb_jsonout_object(&json, NULL);
    pb_jsonout_text(&json, "name", b->fem.frame[i].name);
    pb_jsonout_numbers(&json, "position", b->fem.frame[i].origin, 3);
    pb_jsonout_object_end(&json);
  }
  pb_jsonout_array_end(&json);
  pb_jsonout_object(&json, "characteristics");
  for (size_t i = 0; i < b->values; i++)
    pb_jsonout_number(&json, b->value[i].name, b->value[i].value);
  pb_jsonout_object_end(&json);
  pb_jsonout_object(&json, "published");
  for (size_t i = 0; i < b->part.published; i++)
    pb_jsonout_number(&json, b->part.publication[i].name, b->part.publication[i].value);
  pb_jsonout_object_end(&json);
  pb_jsonout_object_end(&json);
  pb_jsonout_end(&json);
  return pb_stdout_flush(err);
}

pb_status build_report(const build *b, const build_options *options, pb_error *err) {
  return options->json ? report_json(b, options, err) : report_text(b, options, err);
}
