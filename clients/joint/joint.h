// plantbus-joint: its commands, and what their files share.
#ifndef PB_JOINT_JOINT_H
#define PB_JOINT_JOINT_H

#include "commands.h"
#include "shipped.h"
#include "source.h"
#include "study/joint_character.h"

int command_characterize(int argc, char **argv);

enum { JOINT_POINTS = 1500, JOINT_QUANTITIES = 5 };
extern const char *const joint_quantities[];  // [JOINT_QUANTITIES], then NULL

typedef struct joint_options {
  const char *file, *model, *specification;
  size_t nodes[2];
  double modal_damping;
  double stroke;  // rad; 0: unknown
  bool check, element_option;
  double f1, f2;  // Hz
  pb_result_options result;
} joint_options;

typedef struct joint_result {
  char name[128];
  pb_joint_character character;
  pb_limits limits;
  double value[JOINT_QUANTITIES];  // of each quantity, where the specification limits none: of x
  double margin[JOINT_QUANTITIES];
  pb_verdict verdict[JOINT_QUANTITIES];
  const pb_limit *limit[JOINT_QUANTITIES];  // NULL: none
  size_t missed, unknown;
  double *hz;                     // [JOINT_POINTS]
  double complex *compliance[6];  // x y z rx ry rz
} joint_result;

// Table or JSON, files, plot, as the options ask.
pb_status joint_present(const joint_options *options, const joint_result *result, pb_error *err);

#endif
