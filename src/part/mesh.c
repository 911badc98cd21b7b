// A section drawn through layers: see mesh.h.
#include "part/mesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct drawing {
  const pb_section *section;
  const pb_extrusion *extrusion;
  pb_mesh *mesh;
  size_t *number;  // [(2·layers + 1) × section nodes] node + 1 in the mesh; 0: not used
} drawing;

static size_t *number_of(const drawing *d, size_t node, size_t half) {
  return d->number + half * d->section->nodes + node;
}

// The section nodes and half-levels of an element's nodes, third axis along the layers.
static void element_sources(const drawing *d, size_t quad, size_t layer, size_t node[20],
                            size_t half[20]) {
  const size_t *q = d->section->quad[quad];
  for (int i = 0; i < 4; i++) {
    node[i] = node[i + 4] = node[i + 16] = q[i];
    node[i + 8] = node[i + 12] = q[i + 4];
    half[i] = half[i + 8] = 2 * layer;
    half[i + 4] = half[i + 12] = 2 * layer + 2;
    half[i + 16] = 2 * layer + 1;
  }
}

static void mark_used(drawing *d) {
  const pb_extrusion *x = d->extrusion;
  for (size_t layer = 0; layer < x->layers; layer++) {
    for (size_t quad = 0; quad < d->section->quads; quad++) {
      if (x->region(x->context, quad, layer) < 0) continue;
      size_t node[20], half[20];
      element_sources(d, quad, layer, node, half);
      for (int i = 0; i < 20; i++) *number_of(d, node[i], half[i]) = 1;
      d->mesh->elements++;
    }
  }
}

static void place_nodes(drawing *d) {
  const pb_extrusion *x = d->extrusion;
  size_t next = 0;
  for (size_t half = 0; half <= 2 * x->layers; half++) {
    for (size_t node = 0; node < d->section->nodes; node++) {
      size_t *number = number_of(d, node, half);
      if (!*number) continue;
      x->place(x->context, node, half, d->mesh->xyz + 3 * next);
      *number = ++next;
    }
  }
}

static void gather(const pb_mesh *mesh, size_t element, double xyz[20][3]) {
  for (int i = 0; i < 20; i++)
    memcpy(xyz[i], mesh->xyz + 3 * mesh->node[element][i], 3 * sizeof(double));
}

// Turned so that its Jacobian is positive, or refused.
static pb_status orient(pb_mesh *mesh, size_t element, pb_error *err) {
  double xyz[20][3];
  gather(mesh, element, xyz);
  if (pb_hex20_jacobian(xyz) > 0) return PB_OK;
  size_t *node = mesh->node[element];
  for (int i = 0; i < 8; i++) {
    int a = i < 4 ? i : i + 4;  // corners 1–4 with 5–8, sides 9–12 with 13–16
    size_t swap = node[a];
    node[a] = node[a + 4];
    node[a + 4] = swap;
  }
  gather(mesh, element, xyz);
  if (pb_hex20_jacobian(xyz) > 0) return PB_OK;
  double center[3] = {0};
  for (int i = 0; i < 8; i++)
    for (int a = 0; a < 3; a++) center[a] += xyz[i][a] / 8;
  return pb_fail(err, PB_ERR_GEOMETRY, "mesh",
                 "an element near (%.4g, %.4g, %.4g) mm is turned inside out: these dimensions do "
                 "not fit together, or the mesh is too coarse for them",
                 1e3 * center[0], 1e3 * center[1], 1e3 * center[2]);
}

static pb_status connect(drawing *d, pb_error *err) {
  const pb_extrusion *x = d->extrusion;
  pb_mesh *mesh = d->mesh;
  size_t element = 0;
  for (size_t layer = 0; layer < x->layers; layer++) {
    for (size_t quad = 0; quad < d->section->quads; quad++) {
      int region = x->region(x->context, quad, layer);
      if (region < 0) continue;
      size_t node[20], half[20];
      element_sources(d, quad, layer, node, half);
      for (int i = 0; i < 20; i++) mesh->node[element][i] = *number_of(d, node[i], half[i]) - 1;
      mesh->region[element] = region;
      pb_status st = orient(mesh, element++, err);
      if (st) return st;
    }
  }
  return PB_OK;
}

pb_status pb_mesh_extrude(const pb_section *section, const pb_extrusion *extrusion, pb_mesh *out,
                          pb_error *err) {
  *out = (pb_mesh){0};
  size_t places = (2 * extrusion->layers + 1) * section->nodes;
  drawing d = {section, extrusion, out, calloc(places ? places : 1, sizeof(size_t))};
  pb_status st = PB_OK;
  if (!d.number) return pb_fail_memory(err, "mesh");
  mark_used(&d);
  for (size_t i = 0; i < places; i++) out->nodes += d.number[i];
  if (!out->elements) {
    st = pb_fail(err, PB_ERR_GEOMETRY, "mesh", "there is no element");
    goto done;
  }
  out->xyz = malloc(3 * out->nodes * sizeof *out->xyz);
  out->node = malloc(out->elements * sizeof *out->node);
  out->region = malloc(out->elements * sizeof *out->region);
  if (!out->xyz || !out->node || !out->region) {
    st = pb_fail_memory(err, "mesh");
    goto done;
  }
  place_nodes(&d);
  st = connect(&d, err);
done:
  free(d.number);
  if (st) pb_mesh_clear(out);
  return st;
}

void pb_mesh_clear(pb_mesh *mesh) {
  free(mesh->xyz);
  free(mesh->node);
  free(mesh->region);
  *mesh = (pb_mesh){0};
}

void pb_mesh_volume(const pb_mesh *mesh, size_t regions, double *volume) {
  memset(volume, 0, regions * sizeof *volume);
  for (size_t e = 0; e < mesh->elements; e++) {
    double xyz[20][3];
    gather(mesh, e, xyz);
    volume[mesh->region[e]] += pb_hex20_volume(xyz);
  }
}
