// The plants that are measured: those in config/plants, and the reference plants beside the
// checkout whose number of states no shipped plant has.
#ifndef PB_BENCH_PLANTS_H
#define PB_BENCH_PLANTS_H

#include "bench.h"
#include "model/model.h"

typedef struct bench_plant {
  char *path;
  char *name;  // file name without directory and extension
  bool shipped;
  pb_model *model;
} bench_plant;

typedef struct bench_plants {
  size_t count;
  bench_plant *item;  // [count] by ascending number of states
} bench_plants;

// Loads all; a plant that cannot be loaded ends the program. Those with more than max states (0: no
// limit) are left out, and signals with electronics are left out of shipped plants' variants: one
// plant a number of states, inputs and outputs.
bench_plants bench_plants_load(size_t max_states);
void bench_plants_free(bench_plants *plants);

// The plant with the number of states nearest to `states`, within 5 %; NULL: there is none.
const bench_plant *bench_plants_find(const bench_plants *plants, size_t states);

#endif
