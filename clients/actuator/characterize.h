// plantbus-actuator characterize: what its files share.
#ifndef PB_ACTUATOR_CHARACTERIZE_H
#define PB_ACTUATOR_CHARACTERIZE_H

#include "actuator.h"
#include "shipped.h"
#include "study/actuator_character.h"

typedef struct characterize_options {
  subject_options subject;
  pb_stack_nominal nominal;
  const char *datasheet;  // NAME of the shipped list, FILE, or FILE:NAME; NULL: none
  double load;            // kg, on a live bench without a force input
  double f1, f2;          // Hz, of the compliance plot
} characterize_options;

// The figures of one actuator and the compliance behind them.
enum { CHARACTERIZE_FIGURES = 14, CHARACTERIZE_POINTS = 2000 };
typedef struct characterize_result {
  char name[128];
  part_figure figure[CHARACTERIZE_FIGURES];
  size_t figures;
  double *hz;                  // [CHARACTERIZE_POINTS]
  double complex *compliance;  // y/F, m/N; NULL: live
  double stiffness;            // N/m
  double sheet_stiffness;      // N/m; NaN: unknown
} characterize_result;

// Adds a figure.
void characterize_add(characterize_result *result, const char *key, const char *name,
                      const char *unit, double scale, double value);

// Table or JSON, files, plot, as the options ask.
pb_status characterize_present(const characterize_options *options,
                               const characterize_result *result, pb_error *err);

// The figures that an experiment on a running bench gives.
pb_status characterize_live(const characterize_options *options, characterize_result *result,
                            pb_error *err);

#endif
