// The findings of the doctor: see report.h.
#include "report.h"

#include <stdarg.h>
#include <stdlib.h>

#include "jsonout.h"

static const char *grade_name(grade g) {
  static const char *const name[] = {"OK", "WARN", "FAIL"};
  return name[g];
}

// Names on the bus may hold anything; what is printed holds no control characters.
static void clean(char *text) {
  for (char *c = text; *c; c++) {
    const unsigned char u = (unsigned char)*c;
    if (u < ' ' || u == 0x7f || (u == 0xc2 && (unsigned char)c[1] < 0xa0)) *c = '?';
  }
}

void report_add(report *r, grade result, const char *check, const char *mend, const char *format,
                ...) {
  finding *grown = realloc(r->item, (r->count + 1) * sizeof *grown);
  if (!grown) {
    r->failed = true;
    return;
  }
  r->item = grown;
  finding *f = &grown[r->count++];
  *f = (finding){.check = check, .result = result};
  va_list arguments;
  va_start(arguments, format);
  vsnprintf(f->text, sizeof f->text, format, arguments);
  va_end(arguments);
  snprintf(f->mend, sizeof f->mend, "%s", mend ? mend : "");
  clean(f->text);
  clean(f->mend);
}

grade report_worst(const report *r) {
  grade worst = GRADE_OK;
  for (size_t i = 0; i < r->count; i++)
    if (r->item[i].result > worst) worst = r->item[i].result;
  return worst;
}

// The mend stands on a line of its own: next to long texts it would be far out.
pb_status report_print(const report *r, FILE *stream, pb_error *err) {
  if (r->failed) return pb_fail_memory(err, "report");
  for (size_t i = 0; i < r->count; i++) {
    const finding *f = &r->item[i];
    fprintf(stream, "%-4s  %-13s  %s\n", grade_name(f->result), f->check, f->text);
    if (f->mend[0]) fprintf(stream, "%-4s  %-13s  -> %s\n", "", "", f->mend);
  }
  return PB_OK;
}

pb_status report_print_json(const report *r, FILE *stream, pb_error *err) {
  if (r->failed) return pb_fail_memory(err, "report");
  pb_jsonout json;
  pb_jsonout_begin(&json, stream);
  pb_jsonout_object(&json, NULL);
  pb_jsonout_text(&json, "result", grade_name(report_worst(r)));
  pb_jsonout_array(&json, "checks");
  for (size_t i = 0; i < r->count; i++) {
    const finding *f = &r->item[i];
    pb_jsonout_object(&json, NULL);
    pb_jsonout_text(&json, "check", f->check);
    pb_jsonout_text(&json, "result", grade_name(f->result));
    pb_jsonout_text(&json, "text", f->text);
    pb_jsonout_text(&json, "mend", f->mend[0] ? f->mend : NULL);
    pb_jsonout_object_end(&json);
  }
  pb_jsonout_array_end(&json);
  pb_jsonout_object_end(&json);
  pb_jsonout_end(&json);
  return PB_OK;
}

void report_clear(report *r) {
  free(r->item);
  *r = (report){0};
}
