// Faces of a mesh, and frames on them: see mesh.h.
#include <stdlib.h>
#include <string.h>

#include "part/mesh.h"

// A face by its corners, smallest node first, so that both elements' views of it agree.
typedef struct face_key {
  size_t corner[4];
  pb_mesh_face face;
} face_key;

static int compare_keys(const void *a, const void *b) {
  const face_key *x = a, *y = b;
  for (int i = 0; i < 4; i++)
    if (x->corner[i] != y->corner[i]) return x->corner[i] < y->corner[i] ? -1 : 1;
  return (x->face.element > y->face.element) - (x->face.element < y->face.element);
}

static bool same_corners(const face_key *x, const face_key *y) {
  return !memcmp(x->corner, y->corner, sizeof x->corner);
}

static face_key key_of(const pb_mesh *mesh, size_t element, int face) {
  face_key key = {.face = {element, face, false}};
  for (int i = 0; i < 4; i++) {
    size_t node = mesh->node[element][pb_hex20_face[face][i]];
    int at = i;
    for (; at > 0 && key.corner[at - 1] > node; at--) key.corner[at] = key.corner[at - 1];
    key.corner[at] = node;
  }
  return key;
}

pb_status pb_mesh_faces(const pb_mesh *mesh, pb_mesh_face **out, size_t *count, pb_error *err) {
  *out = NULL;
  *count = 0;
  size_t all = 6 * mesh->elements, kept = 0;
  face_key *key = malloc(all * sizeof *key);
  pb_mesh_face *faces = malloc(all * sizeof *faces);
  if (!key || !faces) {
    free(key);
    free(faces);
    return pb_fail_memory(err, "mesh");
  }
  for (size_t e = 0; e < mesh->elements; e++)
    for (int face = 0; face < 6; face++) key[6 * e + (size_t)face] = key_of(mesh, e, face);
  qsort(key, all, sizeof *key, compare_keys);
  for (size_t i = 0; i < all; i++) {
    bool twice = i + 1 < all && same_corners(key + i, key + i + 1);
    faces[kept] = key[i].face;
    faces[kept++].surface = !twice;
    if (twice) i++;
  }
  free(key);
  *out = faces;
  *count = kept;
  return PB_OK;
}

void pb_mesh_face_places(const pb_mesh *mesh, const pb_mesh_face *face, double xyz[8][3]) {
  for (int i = 0; i < 8; i++) {
    size_t node = mesh->node[face->element][pb_hex20_face[face->face][i]];
    memcpy(xyz[i], mesh->xyz + 3 * node, 3 * sizeof(double));
  }
}

// Sums of the chosen faces' moments for every mesh node; a node is used where `used` says so.
static size_t sum_moments(const pb_mesh *mesh, const pb_mesh_face *faces, size_t count,
                          bool (*wanted)(const void *, double[8][3]), const void *context,
                          const double origin[3], double (*moment)[4], bool *used, double *area) {
  size_t nodes = 0;
  for (size_t f = 0; f < count; f++) {
    double xyz[8][3], weight[8][4];
    pb_mesh_face_places(mesh, faces + f, xyz);
    if (!wanted(context, xyz)) continue;
    *area += pb_face8_moments(xyz, origin, weight);
    for (int i = 0; i < 8; i++) {
      size_t node = mesh->node[faces[f].element][pb_hex20_face[faces[f].face][i]];
      nodes += !used[node];
      used[node] = true;
      for (int a = 0; a < 4; a++) moment[node][a] += weight[i][a];
    }
  }
  return nodes;
}

pb_status pb_mesh_frame(const pb_mesh *mesh, const pb_mesh_face *faces, size_t count,
                        bool (*wanted)(const void *context, double xyz[8][3]), const void *context,
                        pb_fem_frame *frame, double *area, pb_error *err) {
  double(*moment)[4] = calloc(mesh->nodes, sizeof *moment), total = 0;
  bool *used = calloc(mesh->nodes, sizeof *used);
  const char *name = frame->name ? frame->name : "frame";
  pb_status st = moment && used ? PB_OK : pb_fail_memory(err, name);
  size_t nodes = 0, next = 0;
  if (!st)
    nodes = sum_moments(mesh, faces, count, wanted, context, frame->origin, moment, used, &total);
  if (!st && !nodes) st = pb_fail(err, PB_ERR_GEOMETRY, name, "the mesh has no face there");
  size_t *node = st ? NULL : malloc(nodes * sizeof *node);
  double *kept = st ? NULL : malloc(4 * nodes * sizeof *kept);
  if (!st && (!node || !kept)) st = pb_fail_memory(err, name);
  for (size_t i = 0; !st && i < mesh->nodes; i++) {
    if (!used[i]) continue;
    node[next] = i;
    memcpy(kept + 4 * next++, moment[i], sizeof moment[i]);
  }
  free(moment);
  free(used);
  if (st) {
    free(node);
    free(kept);
    return st;
  }
  frame->nodes = nodes;
  frame->node = node;
  frame->moment = kept;
  if (area) *area = total;
  return PB_OK;
}
