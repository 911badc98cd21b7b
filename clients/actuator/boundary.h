// plantbus-actuator boundary: what its files share.
#ifndef PB_ACTUATOR_BOUNDARY_H
#define PB_ACTUATOR_BOUNDARY_H

#include "actuator.h"
#include "plant/plant.h"

typedef struct boundary_options {
  subject_options subject;
  double load;                   // kg
  double coupling, capacitance;  // 0: of the model, else the defaults
  double *resistance;            // Ohm [resistances]; NULL: around the best
  size_t resistances;
  double f1, f2;  // Hz, of the responses; 0: around the resonance
} boundary_options;

enum { BOUNDARY_POINTS = 2000 };

// One boundary and what it makes of the actuator.
typedef struct boundary_row {
  pb_boundary boundary;
  char label[64];
  double stiffness;          // N/m, of the stack at the resonance
  double hz, damping;        // first resonance
  double zero_hz;            // of V_a → V_s
  double complex *response;  // y/V_a [BOUNDARY_POINTS], or NULL
} boundary_row;

typedef struct boundary_result {
  char subject[160];
  size_t count;
  boundary_row *row;  // [count]: short, open, then resistors ascending
  double *hz;         // [BOUNDARY_POINTS], or NULL
} boundary_result;

// {"boundary": {...}} for a model. NULL: out of memory. The caller's.
cJSON *boundary_patch(const pb_boundary *boundary);

// Coupling and capacitance of the command line, of the model's own boundary, or the defaults.
pb_boundary boundary_start(const boundary_options *options, const cJSON *model);

// Adds a row; its label follows from the boundary.
pb_status boundary_add(boundary_result *result, const boundary_row *row, pb_error *err);

// The boundaries of the running plant's model switched one after the other, each identified; the
// revision that was found is put back, also after a failure.
pb_status boundary_live(const boundary_options *options, boundary_result *result, pb_error *err);

pb_status boundary_present(const boundary_options *options, const boundary_result *result,
                           pb_error *err);

#endif
