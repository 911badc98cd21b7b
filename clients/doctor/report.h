// The findings of the doctor: what was looked at, what came out, and what mends it.
#ifndef PB_CLIENTS_DOCTOR_REPORT_H
#define PB_CLIENTS_DOCTOR_REPORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "base/status.h"

typedef enum grade { GRADE_OK, GRADE_WARN, GRADE_FAIL } grade;

typedef struct finding {
  const char *check;  // constant text
  grade result;
  char text[512], mend[320];  // mend: empty when there is nothing to mend
} finding;

// Zero-initialise; free with report_clear. A failed allocation is remembered.
typedef struct report {
  size_t count;
  finding *item;
  bool failed;
} report;

// Adds a finding; mend may be NULL, text is as by printf.
void report_add(report *r, grade result, const char *check, const char *mend, const char *format,
                ...) __attribute__((format(printf, 5, 6)));

// The worst result.
grade report_worst(const report *r);

// As a table of check, result and mend, or as a JSON object. Fails with PB_ERR_MEMORY.
pb_status report_print(const report *r, FILE *stream, pb_error *err);
pb_status report_print_json(const report *r, FILE *stream, pb_error *err);

void report_clear(report *r);

#endif
