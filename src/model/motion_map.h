// How the states of a compiled plant are the motion of its components, and the way back.
//
//   q = C_q x + D_q u,  q̇ = C_v x            stacked component coordinates (assembly/motion.h)
//   x = B_q M (q − D_q u) + B_v M q̇          projection on the plant's motions in the metric of M
//
// The stacked equations get each coordinate as an output, and a displacement and an impulse on each
// as inputs; assembly and compilation carry these along with the plant's own signals, through
// constraints, condensation, block-diagonalisation and truncation. With modes Φ and constraints
// q = N T Φ η the projection is η = ΦᵀTᵀNᵀ M q: exact for every motion that the plant can make, and
// conserving momentum for the others.
#ifndef PB_MODEL_MOTION_MAP_H
#define PB_MODEL_MOTION_MAP_H

#include "assembly/motion.h"
#include "model/means.h"
#include "model/model.h"

// Larger plants are compiled without a map: they cannot be changed while they run.
enum { PB_MOTION_MAP_LARGEST = 4000 };

typedef struct pb_motion_map {
  pb_plant *plant;   // owned: names, kinds, frames, elements
  pb_layout layout;  // where the coordinates of each component start in q
  size_t n, nx, nu;  // coordinates; states and inputs of the model
  double *m, *k;     // n × n: stacked mass and stiffness
  double *f;         // n × nu: forces of the inputs on the coordinates
  double *dq;        // n × nu
  double *b, *c;     // with the plant's own inputs and outputs: what the four below are part of
  const double *cq, *cv;  // n × nx, leading dimension ldc
  const double *bq, *bv;  // nx × n
  size_t ldc;
} pb_motion_map;

// Reads a plant file's text (element paths relative to directory), assembles and compiles it, with
// its map. *map NULL: the plant is too large for one. *text (may be NULL): the file in canonical
// form. All owned by the caller. Fails as pb_plant_parse, pb_system_assemble, pb_model_compile.
// [init]
pb_status pb_model_parse(const char *text, size_t length, const char *directory,
                         pb_warnings *warnings, pb_model **out, pb_motion_map **map,
                         char **canonical, pb_error *err);

// The same with what the caller lends (may be NULL). [init]
pb_status pb_model_parse_with(const char *text, size_t length, const char *directory,
                              const pb_means *means, pb_warnings *warnings, pb_model **out,
                              pb_motion_map **map, char **canonical, pb_error *err);

void pb_motion_map_free(pb_motion_map *map);  // NULL is allowed

// Kinetic and strain energy of a state with inputs u [nu], J. Fails with PB_ERR_MEMORY. [init]
pb_status pb_motion_map_energy(const pb_motion_map *map, const double *x, const double *u,
                               double *energy, pb_error *err);

#endif
