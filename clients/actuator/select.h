// plantbus-actuator select: what its files share.
#ifndef PB_ACTUATOR_SELECT_H
#define PB_ACTUATOR_SELECT_H

#include "actuator.h"
#include "shipped.h"

typedef struct select_options {
  const char *list, *specification;
  double near;
  bool strict;
  pb_result_options result;
} select_options;

typedef struct select_entry {
  double value, margin;
  pb_verdict verdict;
} select_entry;

typedef struct select_candidate {
  const char *name;
  size_t missed, near, unknown;
  bool meets;           // as the exit code counts
  select_entry *entry;  // [limits]
} select_candidate;

typedef struct select_result {
  pb_limits limits;
  size_t count, meeting;
  select_candidate *candidate;  // [count]
  select_entry *entries;
} select_result;

// Table or JSON, files, plot, as the options ask.
pb_status select_present(const select_options *options, const select_result *result, pb_error *err);

#endif
