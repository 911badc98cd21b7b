// The full model for other programs: K.mtx and M.mtx (Matrix Market), nodes.csv, frames.json, and
// decks for CalculiX: part.inp stores K and M, modes.inp computes the free part's frequencies.
//
// Node numbers start at 1; row 3 (n − 1) + d of the matrices is direction d of node n. CalculiX
// reads twenty characters of a number: coordinates have fourteen digits.
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "build.h"
#include "frames.h"
#include "outfile.h"

enum { PATH = 4096 };

// A file in the directory that appears when it is complete.
static pb_status open_in(const char *directory, const char *name, pb_outfile *out, pb_error *err) {
  char path[PATH];
  if (snprintf(path, sizeof path, "%s/%s", directory, name) >= PATH)
    return pb_fail(err, PB_ERR_IO, directory, "the name is too long");
  return pb_outfile_open(path, out, err);
}

// Symmetric: the lower triangle is what the format stores.
static pb_status write_matrix(const char *directory, const char *name, const pb_sparse *a,
                              pb_error *err) {
  pb_outfile s;
  pb_status st = open_in(directory, name, &s, err);
  if (st) return st;
  fprintf(s.stream, "%%%%MatrixMarket matrix coordinate real symmetric\n%zu %zu %lld\n", a->n, a->n,
          (long long)a->start[a->n]);
  for (size_t j = 0; j < a->n; j++)
    for (int64_t at = a->start[j]; at < a->start[j + 1]; at++)
      fprintf(s.stream, "%zu %lld %.17g\n", j + 1, (long long)a->row[at] + 1, a->value[at]);
  return pb_outfile_close(&s, err);
}

static pb_status write_nodes(const build *b, const char *directory, pb_error *err) {
  pb_outfile s;
  pb_status st = open_in(directory, "nodes.csv", &s, err);
  if (st) return st;
  fprintf(s.stream, "node,x,y,z\n");
  for (size_t i = 0; i < b->mesh.nodes; i++) {
    const double *p = b->mesh.xyz + 3 * i;
    fprintf(s.stream, "%zu,%.17g,%.17g,%.17g\n", i + 1, p[0], p[1], p[2]);
  }
  return pb_outfile_close(&s, err);
}

// For plantbus-part reduce.
static pb_status write_frames(const build *b, const char *directory, pb_error *err) {
  char path[PATH];
  if (snprintf(path, sizeof path, "%s/frames.json", directory) >= PATH)
    return pb_fail(err, PB_ERR_IO, directory, "the name is too long");
  return pb_frames_write(&b->fem, path, err);
}

static void deck_elements(const build *b, FILE *out) {
  for (size_t region = 0; region < b->part.materials; region++) {
    fprintf(out, "*ELEMENT, TYPE=C3D20R, ELSET=%s\n", pb_part_material_name(b->part.type, region));
    for (size_t e = 0; e < b->mesh.elements; e++) {
      if (b->mesh.region[e] != (int)region) continue;
      fprintf(out, "%zu", e + 1);
      for (int i = 0; i < 20; i++)
        fprintf(out, "%s%zu", i == 15 ? ",\n" : ", ", b->mesh.node[e][i] + 1);
      fprintf(out, "\n");
    }
  }
}

static void deck_materials(const build *b, FILE *out) {
  for (size_t region = 0; region < b->part.materials; region++) {
    const pb_material *m = b->part.material + region;
    const char *name = pb_part_material_name(b->part.type, region);
    fprintf(out, "*MATERIAL, NAME=%s\n*ELASTIC\n%.13g, %.13g\n*DENSITY\n%.13g\n", name,
            m->youngs_modulus, m->poisson_ratio, m->density);
    fprintf(out, "*SOLID SECTION, ELSET=%s, MATERIAL=%s\n", name, name);
  }
}

static pb_status write_deck(const build *b, const char *directory, const char *name,
                            const char *step, pb_error *err) {
  pb_outfile s;
  pb_status st = open_in(directory, name, &s, err);
  if (st) return st;
  fprintf(s.stream, "** %s, built from its dimensions; m, N, kg, s\n*NODE, NSET=ALL\n",
          b->part.name);
  for (size_t i = 0; i < b->mesh.nodes; i++) {
    const double *p = b->mesh.xyz + 3 * i;
    fprintf(s.stream, "%zu, %.13e, %.13e, %.13e\n", i + 1, p[0], p[1], p[2]);
  }
  deck_elements(b, s.stream);
  deck_materials(b, s.stream);
  fprintf(s.stream, "*STEP\n%s*END STEP\n", step);
  return pb_outfile_close(&s, err);
}

pb_status build_full(const build *b, const char *directory, pb_error *err) {
  if (mkdir(directory, 0777) && errno != EEXIST)
    return pb_fail(err, PB_ERR_IO, directory, "cannot be made: %s", strerror(errno));
  pb_status st = write_matrix(directory, "K.mtx", &b->fem.k, err);
  if (!st) st = write_matrix(directory, "M.mtx", &b->fem.m, err);
  if (!st) st = write_nodes(b, directory, err);
  if (!st) st = write_frames(b, directory, err);
  if (!st) st = write_deck(b, directory, "part.inp", "*FREQUENCY, SOLVER=MATRIXSTORAGE\n", err);
  if (!st) st = write_deck(b, directory, "modes.inp", "*FREQUENCY\n20\n", err);
  return st;
}
