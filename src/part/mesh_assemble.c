// Sparse K and M of a mesh: see mesh.h.
//
// The pattern comes from the nodes: column node q holds the blocks of all nodes p ≤ q that share an
// element with it. K has full 3 × 3 blocks (the upper triangle of the diagonal ones), M the same
// scalar three times.
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "part/mesh.h"

typedef struct pattern {
  size_t *element_start, *element;  // elements of each node
  size_t *start, *neighbour;        // nodes ≤ q of node q, ascending, q last
} pattern;

static void clear_pattern(pattern *p) {
  free(p->element_start);
  free(p->element);
  free(p->start);
  free(p->neighbour);
  *p = (pattern){0};
}

static bool list_elements(const pb_mesh *mesh, pattern *p) {
  size_t n = mesh->nodes;
  p->element_start = calloc(n + 2, sizeof *p->element_start);
  p->element = malloc((20 * mesh->elements) * sizeof *p->element);
  if (!p->element_start || !p->element) return false;
  size_t *start = p->element_start;
  for (size_t e = 0; e < mesh->elements; e++)
    for (int i = 0; i < 20; i++) start[mesh->node[e][i] + 2]++;
  for (size_t q = 0; q < n; q++) start[q + 2] += start[q + 1];
  for (size_t e = 0; e < mesh->elements; e++)
    for (int i = 0; i < 20; i++) p->element[start[mesh->node[e][i] + 1]++] = e;
  return true;
}

static int compare_index(const void *a, const void *b) {
  size_t x = *(const size_t *)a, y = *(const size_t *)b;
  return (x > y) - (x < y);
}

// Neighbours of node q into `list` (when not NULL); `seen` holds q + 1 for those already there.
static size_t neighbours(const pb_mesh *mesh, const pattern *p, size_t q, size_t *seen, size_t mark,
                         size_t *list) {
  size_t count = 0;
  for (size_t at = p->element_start[q]; at < p->element_start[q + 1]; at++) {
    const size_t *node = mesh->node[p->element[at]];
    for (int i = 0; i < 20; i++) {
      if (node[i] > q || seen[node[i]] == mark) continue;
      seen[node[i]] = mark;
      if (list) list[count] = node[i];
      count++;
    }
  }
  if (list) qsort(list, count, sizeof *list, compare_index);
  return count;
}

static bool list_neighbours(const pb_mesh *mesh, pattern *p) {
  size_t n = mesh->nodes;
  size_t *seen = calloc(n, sizeof *seen);
  p->start = calloc(n + 1, sizeof *p->start);
  bool ok = seen && p->start;
  for (size_t q = 0; ok && q < n; q++)
    p->start[q + 1] = p->start[q] + neighbours(mesh, p, q, seen, q + 1, NULL);
  p->neighbour = ok ? malloc(p->start[n] * sizeof *p->neighbour) : NULL;
  ok = ok && p->neighbour;
  if (ok) memset(seen, 0, n * sizeof *seen);
  for (size_t q = 0; ok && q < n; q++)
    neighbours(mesh, p, q, seen, q + 1, p->neighbour + p->start[q]);
  free(seen);
  return ok;
}

static bool allocate_sparse(size_t n, size_t entries, pb_sparse *a) {
  a->n = n;
  a->start = malloc((n + 1) * sizeof *a->start);
  a->row = malloc(entries * sizeof *a->row);
  a->value = calloc(entries, sizeof *a->value);
  return a->start && a->row && a->value;
}

static bool lay_out(const pb_mesh *mesh, const pattern *p, pb_fem *fem) {
  size_t n = mesh->nodes, blocks = p->start[n];
  if (!allocate_sparse(3 * n, 9 * blocks - 3 * n, &fem->k)) return false;
  if (!allocate_sparse(3 * n, 3 * blocks, &fem->m)) return false;
  int64_t k = 0, m = 0;
  for (size_t q = 0; q < n; q++) {
    for (int d = 0; d < 3; d++) {
      fem->k.start[3 * q + (size_t)d] = k;
      fem->m.start[3 * q + (size_t)d] = m;
      for (size_t at = p->start[q]; at < p->start[q + 1]; at++) {
        int64_t row = 3 * (int64_t)p->neighbour[at];
        for (int a = 0; a < (p->neighbour[at] == q ? d + 1 : 3); a++) fem->k.row[k++] = row + a;
        fem->m.row[m++] = row + d;
      }
    }
  }
  fem->k.start[3 * n] = k;
  fem->m.start[3 * n] = m;
  return true;
}

// Adds the block of element nodes i, j: rows of the smaller node number, columns of the greater.
static void add_block(pb_fem *fem, const pattern *p, size_t i, size_t j, double k[3][3], double m) {
  bool swapped = i > j;
  size_t row = swapped ? j : i, col = swapped ? i : j;
  size_t low = p->start[col], high = p->start[col + 1] - 1;
  while (low < high) {
    size_t middle = (low + high) / 2;
    if (p->neighbour[middle] < row) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  int64_t place = (int64_t)(low - p->start[col]);
  for (int b = 0; b < 3; b++) {
    int64_t at = fem->k.start[3 * col + (size_t)b] + 3 * place;
    for (int a = 0; a <= (row == col ? b : 2); a++)
      fem->k.value[at + a] += swapped ? k[b][a] : k[a][b];
    fem->m.value[fem->m.start[3 * col + (size_t)b] + place] += m;
  }
}

static pb_status add_elements(const pb_mesh *mesh, const pattern *p, size_t materials,
                              const pb_material *material, pb_fem *fem, pb_error *err) {
  double(*k)[20][3][3] = malloc(20 * sizeof *k), m[20][20];
  pb_status st = k ? PB_OK : pb_fail_memory(err, "mesh");
  for (size_t e = 0; !st && e < mesh->elements; e++) {
    const size_t *node = mesh->node[e];
    double xyz[20][3];
    for (int i = 0; i < 20; i++) memcpy(xyz[i], mesh->xyz + 3 * node[i], sizeof xyz[i]);
    if (mesh->region[e] < 0 || (size_t)mesh->region[e] >= materials) {
      st = pb_fail(err, PB_ERR_ARGUMENT, "mesh", "region %d has no material", mesh->region[e]);
    } else if (!pb_hex20_matrices(xyz, material + mesh->region[e], k, m)) {
      st = pb_fail(err, PB_ERR_GEOMETRY, "mesh", "element %zu is turned inside out", e + 1);
    } else {
      for (size_t i = 0; i < 20; i++)
        for (size_t j = i; j < 20; j++) add_block(fem, p, node[i], node[j], k[i][j], m[i][j]);
    }
  }
  free(k);
  return st;
}

static bool copy_nodes(const pb_mesh *mesh, pb_fem *fem) {
  fem->nodes = mesh->nodes;
  fem->name = pb_text_copy("mesh");
  fem->xyz = malloc(3 * mesh->nodes * sizeof *fem->xyz);
  fem->dof = malloc(3 * mesh->nodes * sizeof *fem->dof);
  if (!fem->name || !fem->xyz || !fem->dof) return false;
  memcpy(fem->xyz, mesh->xyz, 3 * mesh->nodes * sizeof *fem->xyz);
  for (size_t i = 0; i < 3 * mesh->nodes; i++) fem->dof[i] = (int64_t)i;
  return true;
}

pb_status pb_mesh_assemble(const pb_mesh *mesh, size_t materials, const pb_material *material,
                           pb_fem *out, pb_error *err) {
  *out = (pb_fem){0};
  pattern p = {0};
  bool ok = list_elements(mesh, &p) && list_neighbours(mesh, &p) && lay_out(mesh, &p, out) &&
            copy_nodes(mesh, out);
  pb_status st =
      ok ? add_elements(mesh, &p, materials, material, out, err) : pb_fail_memory(err, "mesh");
  clear_pattern(&p);
  if (st) pb_fem_clear(out);
  return st;
}
