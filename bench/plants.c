// Which plants are measured: see plants.h.
#include "plants.h"

#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static bool is_plant_file(const char *name) {
  size_t length = strlen(name);
  return length > 5 && !strcmp(name + length - 5, ".json") && !strstr(name, ".expected.") &&
         !strstr(name, "-electronics");
}

static int by_name(const struct dirent **a, const struct dirent **b) {
  return strcmp((*a)->d_name, (*b)->d_name);
}

static int keep(const struct dirent *entry) {
  return is_plant_file(entry->d_name);
}

static bool known(const bench_plants *p, const pb_model *m) {
  for (size_t k = 0; k < p->count; k++) {
    const pb_model *other = p->item[k].model;
    if (other->nx == m->nx && other->nu == m->nu && other->ny == m->ny) return true;
  }
  return false;
}

static void add(bench_plants *p, const char *directory, const char *name, bool shipped,
                size_t max_states) {
  bench_plant plant = {.shipped = shipped};
  pb_error err = {0};
  if (asprintf(&plant.path, "%s/%s", directory, name) < 0) bench_fail("out of memory");
  bench_check(pb_model_load(plant.path, NULL, &plant.model, &err), &err);
  plant.name = strndup(name, strlen(name) - 5);
  bench_plant *item = realloc(p->item, (p->count + 1) * sizeof *item);
  if (!plant.name || !item) bench_fail("out of memory");
  p->item = item;
  if (known(p, plant.model) || (max_states && plant.model->nx > max_states)) {
    pb_model_free(plant.model);
    free(plant.path);
    free(plant.name);
    return;
  }
  item[p->count++] = plant;
}

static void add_directory(bench_plants *p, const char *directory, bool shipped, size_t max_states) {
  struct dirent **entry = NULL;
  int count = scandir(directory, &entry, keep, by_name);
  for (int k = 0; k < count; k++) {
    add(p, directory, entry[k]->d_name, shipped, max_states);
    free(entry[k]);
  }
  free(entry);
}

static int by_states(const void *a, const void *b) {
  size_t x = ((const bench_plant *)a)->model->nx, y = ((const bench_plant *)b)->model->nx;
  return (x > y) - (x < y);
}

bench_plants bench_plants_load(size_t max_states) {
  bench_plants p = {0};
  add_directory(&p, PB_CONFIG "/plants", true, max_states);
  add_directory(&p, PB_SHARED "/reference", false, max_states);
  if (!p.count) bench_fail("no plant could be found");
  qsort(p.item, p.count, sizeof *p.item, by_states);
  return p;
}

void bench_plants_free(bench_plants *p) {
  for (size_t k = 0; k < p->count; k++) {
    pb_model_free(p->item[k].model);
    free(p->item[k].path);
    free(p->item[k].name);
  }
  free(p->item);
  *p = (bench_plants){0};
}

const bench_plant *bench_plants_find(const bench_plants *p, size_t states) {
  const bench_plant *best = NULL;
  double least = 0.05 * (double)states;
  for (size_t k = 0; k < p->count; k++) {
    double away = fabs((double)p->item[k].model->nx - (double)states);
    if (away > least) continue;
    least = away;
    best = &p->item[k];
  }
  return best;
}
