// plantbus-actuator select: actuators against a specification.
//
// What a data sheet does not say stays unknown. A near miss misses by no more than --near. Exit
// code: 0 when at least one actuator meets every limit that is known of it (--strict: every limit),
// else 1.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "select.h"

enum { KEY_LIST = 0x100, KEY_SPECIFICATION, KEY_NEAR, KEY_STRICT };

static const struct argp_option option_table[] = {
    {"actuators", KEY_LIST, "FILE", 0,
     "Data sheets, as config/actuators/amplified-piezo.json (default: that file, built in)", 2},
    {"specification", KEY_SPECIFICATION, "FILE", 0,
     "As config/specifications/nano-hexapod-actuator.json (default: that file, built in)", 2},
    {"near", KEY_NEAR, "PART", 0, "Misses up to this part of the limit are near ones (default 0.1)",
     2},
    {"strict", KEY_STRICT, NULL, 0, "Count what is unknown as not met", 2},
    {0},
};

static error_t parse(int key, char *text, struct argp_state *state) {
  select_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->result;
    return 0;
  case KEY_LIST:
    o->list = text;
    return 0;
  case KEY_SPECIFICATION:
    o->specification = text;
    return 0;
  case KEY_NEAR:
    o->near = pb_option_double(state, "--near", text, 0, 10);
    return 0;
  case KEY_STRICT:
    o->strict = true;
    return 0;
  case ARGP_KEY_ARG:
    argp_error(state, "unexpected argument '%s'", text);
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

// ---- judging ------------------------------------------------------------------------------------

static pb_status judge_one(const select_options *o, const cJSON *sheet, select_result *j,
                           select_candidate *c, pb_error *err) {
  c->name = sheet->string;
  for (size_t k = 0; k < j->limits.count; k++) {
    const pb_limit *limit = &j->limits.limit[k];
    pb_sheet_value v;
    select_entry *e = &c->entry[k];
    pb_status st = pb_sheet_read(sheet, "/actuators", limit->quantity->key, &v, err);
    if (st) return st;
    // Of a range the end that is worse counts.
    double other;
    e->value = v.low;
    e->verdict = pb_limit_judge(limit, v.low, &e->margin);
    pb_verdict high = pb_limit_judge(limit, v.high, &other);
    if (other < e->margin) *e = (select_entry){v.high, other, high};
    c->missed += e->verdict == PB_MISSED;
    c->near += e->verdict == PB_MISSED && e->margin >= -o->near - 1e-12;
    c->unknown += e->verdict == PB_UNKNOWN;
  }
  c->meets = c->missed == 0 && (c->unknown == 0 || !o->strict) && c->unknown < j->limits.count;
  j->meeting += c->meets;
  return PB_OK;
}

static pb_status judge(const select_options *o, const cJSON *sheets, select_result *j,
                       pb_error *err) {
  const size_t count = (size_t)cJSON_GetArraySize(sheets);
  j->candidate = calloc(count, sizeof *j->candidate);
  j->entries = calloc(count * j->limits.count, sizeof *j->entries);
  if (!j->candidate || !j->entries) return pb_fail_memory(err, "actuators");
  pb_status st = PB_OK;
  for (const cJSON *s = sheets->child; s && !st; s = s->next, j->count++) {
    j->candidate[j->count].entry = j->entries + j->count * j->limits.count;
    st = judge_one(o, s, j, &j->candidate[j->count], err);
  }
  return st;
}

int command_select(int argc, char **argv) {
  static const struct argp_child children[] = {{&pb_result_argp, 0, NULL, 0}, {0}};
  static const struct argp argp = {
      option_table,
      parse,
      NULL,
      "Judges actuators by their data sheets against a specification.\v"
      "Exit codes: 0 at least one meets every limit that is known of it (--strict: every limit), 1 "
      "none does or something failed, 2 wrong command line.",
      children,
      NULL,
      NULL};
  select_options o = {.near = 0.1};
  pb_error err = {0};
  select_result j = {0};
  cJSON *file = NULL;
  const cJSON *sheets = NULL;
  pb_options_parse(&argp, argc, argv, &o);
  pb_status st = pb_shipped_limits(o.specification, pb_shipped_actuator_specification,
                                   actuator_quantities, &j.limits, &err);
  if (!st) st = pb_shipped_sheets(o.list, actuator_quantities, &file, &sheets, &err);
  if (!st) st = judge(&o, sheets, &j, &err);
  if (!st) st = select_present(&o, &j, &err);
  int code = pb_result_end(st, &err);
  if (code == PB_EXIT_DONE && j.meeting == 0) code = PB_EXIT_FAILED;
  pb_limits_clear(&j.limits);
  free(j.candidate);
  free(j.entries);
  cJSON_Delete(file);
  return code;
}
