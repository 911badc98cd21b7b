// What a study says: tables or JSON on stdout.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "jsonout.h"
#include "study.h"
#include "table.h"
#include "standard_output.h"

// ---- tables -------------------------------------------------------------------------------------

static void value_column(const study *s, pb_table *t) {
  const pb_study_kind_facts *facts = pb_study_kind_of(s->options->kind);
  char head[64];
  snprintf(head, sizeof head, facts->unit ? "%s [%s]" : "%s", facts->quantity, facts->unit);
  pb_table_text_column(t, head);
}

static pb_status finish(pb_table *t, const char *title, pb_error *err) {
  printf("\n%s\n", title);
  pb_status status = pb_table_print(t, stdout, 2, err);
  pb_table_free(t);
  return status;
}

static pb_status print_plants(const study *s, pb_error *err) {
  pb_table t = {0};
  value_column(s, &t);
  pb_table_number_column(&t, "states", NULL, 6);
  pb_table_number_column(&t, "first mode", "Hz", 4);
  pb_table_number_column(&t, "last mode", "Hz", 4);
  pb_table_number_column(&t, "IFF zero", "Hz", 4);
  pb_table_number_column(&t, "of one strut alone", "Hz", 4);
  pb_table_number_column(&t, "RGA number", NULL, 4);
  for (size_t k = 0; k < s->count; k++) {
    const pb_study_point *p = &s->point[k];
    pb_table_text(&t, s->label[k]);
    pb_table_count(&t, p->states);
    pb_table_number(&t, p->size.modes ? p->mode_hz[0] : NAN);
    pb_table_number(&t, p->size.modes ? p->mode_hz[p->size.modes - 1] : NAN);
    pb_table_number(&t, p->zero_hz);
    pb_table_number(&t, p->zero_alone_hz);
    pb_table_number(&t, p->rga_undamped);
  }
  return finish(
      &t,
      "Plants: modes to damp, lowest complex zero of the IFF plant (six struts; one strut "
      "alone), largest RGA number up to the last mode",
      err);
}

static pb_status print_damping(const study *s, pb_error *err) {
  pb_table t = {0};
  size_t modes = 0;
  value_column(s, &t);
  for (size_t k = 0; k < s->count; k++)
    if (s->point[k].size.modes > modes) modes = s->point[k].size.modes;
  if (modes > 12) modes = 12;
  for (size_t m = 0; m < modes; m++) {
    char head[24];
    snprintf(head, sizeof head, "mode %zu", m + 1);
    pb_table_number_column(&t, head, "%", 4);
  }
  for (size_t k = 0; k < s->count; k++) {
    const pb_study_point *p = &s->point[k];
    pb_table_text(&t, s->label[k]);
    for (size_t m = 0; m < modes; m++)
      pb_table_number(&t, m < p->size.modes ? 100 * p->attainable[m] : NAN);
  }
  return finish(&t, "Attainable damping with IFF: the largest of each mode on its root locus", err);
}

static pb_status print_gains(const study *s, pb_error *err) {
  pb_table t = {0};
  value_column(s, &t);
  pb_table_number_column(&t, "best gain", NULL, 4);
  pb_table_number_column(&t, "smallest damping", "%", 4);
  pb_table_number_column(&t, "RGA number damped", NULL, 4);
  pb_table_number_column(&t, "stable to gain", NULL, 4);
  pb_table_number_column(&t, "best stable gain", NULL, 4);
  pb_table_number_column(&t, "smallest damping", "%", 4);
  for (size_t k = 0; k < s->count; k++) {
    const pb_study_point *p = &s->point[k];
    pb_table_text(&t, s->label[k]);
    pb_table_number(&t, p->best.gain);
    pb_table_number(&t, 100 * p->best.smallest);
    pb_table_number(&t, p->rga_damped);
    pb_table_number(&t, p->stable_to > 0 ? p->stable_to : NAN);
    pb_table_number(&t, p->stable.gain > 0 ? p->stable.gain : NAN);
    pb_table_number(&t, p->stable.gain > 0 ? 100 * p->stable.smallest : NAN);
  }
  return finish(&t, "One gain for six struts: the largest smallest damping", err);
}

static pb_status print_struts(const study *s, pb_error *err) {
  pb_table t = {0};
  value_column(s, &t);
  pb_table_number_column(&t, "k", "N/µm", 4);
  pb_table_number_column(&t, "l", "mm", 4);
  pb_table_number_column(&t, "k l²", "Nm/rad", 4);
  pb_table_number_column(&t, "k_r", "Nm/rad", 4);
  pb_table_number_column(&t, "k l² / k_r", NULL, 4);
  pb_table_text_column(&t, "k_r ≪ k l²");
  for (size_t k = 0; k < s->count; k++) {
    const pb_strut_condition *c = &s->point[k].struts;
    pb_table_text(&t, s->label[k]);
    pb_table_number(&t, 1e-6 * c->k);
    pb_table_number(&t, 1e3 * c->length);
    pb_table_number(&t, c->limit);
    pb_table_number(&t, c->bending);
    pb_table_number(&t, c->margin);
    pb_table_text(&t, c->held ? "yes" : "no");
  }
  return finish(
      &t, "Forces along the struts (McInroy): joints that bend by less than a tenth of k l²", err);
}

pb_status study_print(const study *s, pb_error *err) {
  const pb_study_point *p = &s->point[0];
  printf("%s: %s, %zu plants\n", s->plant, pb_study_kind_of(s->options->kind)->name, s->count);
  bool same = true;
  for (size_t k = 1; k < s->count; k++) same = same && !strcmp(s->point[k].input, p->input);
  printf("HAC plant %s → dL1, IFF plant %s → %s, %g Hz\n", same ? p->input : "actuator 1",
         same ? p->input : "actuator 1", same ? p->sensor : "force sensor 1", p->sample_rate);
  pb_status status = print_plants(s, err);
  if (!status) status = print_damping(s, err);
  if (!status) status = print_gains(s, err);
  return status ? status : print_struts(s, err);
}

// ---- JSON ---------------------------------------------------------------------------------------

static void json_choice(pb_jsonout *j, const char *key, const pb_gain_choice *c) {
  pb_jsonout_object(j, key);
  pb_jsonout_number(j, "gain", c->gain);
  pb_jsonout_number(j, "smallest_damping", c->smallest);
  pb_jsonout_object_end(j);
}

static void json_struts(pb_jsonout *j, const pb_strut_condition *c) {
  pb_jsonout_object(j, "struts");
  pb_jsonout_number(j, "k", c->k);
  pb_jsonout_number(j, "length", c->length);
  pb_jsonout_number(j, "limit", c->limit);
  pb_jsonout_number(j, "k_r", c->bending);
  pb_jsonout_number(j, "margin", c->margin);
  pb_jsonout_boolean(j, "held", c->held);
  pb_jsonout_object_end(j);
}

static void json_point(pb_jsonout *j, const study *s, size_t k) {
  const pb_study_point *p = &s->point[k];
  pb_jsonout_object(j, NULL);
  if (isnan(s->value[k]) || isinf(s->value[k]))
    pb_jsonout_text(j, "value", s->label[k]);
  else
    pb_jsonout_number(j, "value", s->value[k]);
  pb_jsonout_text(j, "input", p->input);
  pb_jsonout_text(j, "sensor", p->sensor);
  pb_jsonout_integer(j, "states", p->states);
  pb_jsonout_integer(j, "dof", p->dof);
  pb_jsonout_number(j, "iff_zero_hz", p->zero_hz);
  pb_jsonout_number(j, "iff_zero_alone_hz", p->zero_alone_hz);
  pb_jsonout_numbers(j, "mode_hz", p->mode_hz, p->size.modes);
  pb_jsonout_numbers(j, "mode_damping", p->mode_damping, p->size.modes);
  pb_jsonout_numbers(j, "attainable_damping", p->attainable, p->size.modes);
  pb_jsonout_numbers(j, "attained_at_gain", p->attained_at, p->size.modes);
  pb_jsonout_number(j, "smallest_attainable_damping", p->smallest_attainable);
  json_choice(j, "best", &p->best);
  json_choice(j, "best_stable", &p->stable);
  pb_jsonout_number(j, "stable_to_gain", p->stable_to);
  pb_jsonout_number(j, "rga_number_undamped", p->rga_undamped);
  pb_jsonout_number(j, "rga_number_damped", p->rga_damped);
  json_struts(j, &p->struts);
  pb_jsonout_object_end(j);
}

pb_status study_print_json(const study *s, pb_error *err) {
  const pb_study_kind_facts *facts = pb_study_kind_of(s->options->kind);
  pb_jsonout j;
  pb_jsonout_begin(&j, stdout);
  pb_jsonout_object(&j, NULL);
  pb_jsonout_text(&j, "study", facts->name);
  pb_jsonout_text(&j, "plant", s->plant);
  pb_jsonout_text(&j, "quantity", facts->quantity);
  pb_jsonout_text(&j, "unit", facts->unit);
  pb_jsonout_array(&j, "values");
  for (size_t k = 0; k < s->count; k++) json_point(&j, s, k);
  pb_jsonout_array_end(&j);
  pb_jsonout_object_end(&j);
  pb_jsonout_end(&j);
  return pb_stdout_flush(err);
}
