// Plane meshes in blocks: see section.h.
#include "part/section.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double two_pi = 6.283185307179586476925286766559;

static pb_point2 edge_point(const pb_edge2 *edge, pb_point2 a, pb_point2 b, double t) {
  if (!edge->arc) return (pb_point2){a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)};
  double ax = a.x - edge->centre.x, ay = a.y - edge->centre.y;
  double bx = b.x - edge->centre.x, by = b.y - edge->centre.y;
  double from = atan2(ay, ax), turn = remainder(atan2(by, bx) - from, two_pi);
  double radius = (1 - t) * hypot(ax, ay) + t * hypot(bx, by);
  if (t == 0) return a;
  if (t == 1) return b;
  return (pb_point2){edge->centre.x + radius * cos(from + t * turn),
                     edge->centre.y + radius * sin(from + t * turn)};
}

pb_point2 pb_block_point(const pb_block *block, double u, double v) {
  const pb_point2 *c = block->corner;
  pb_point2 bottom = edge_point(&block->edge[0], c[0], c[1], u);
  pb_point2 right = edge_point(&block->edge[1], c[1], c[2], v);
  pb_point2 top = edge_point(&block->edge[2], c[3], c[2], u);
  pb_point2 left = edge_point(&block->edge[3], c[0], c[3], v);
  double w00 = (1 - u) * (1 - v), w10 = u * (1 - v), w11 = u * v, w01 = (1 - u) * v;
  return (pb_point2){(1 - v) * bottom.x + v * top.x + (1 - u) * left.x + u * right.x -
                         (w00 * c[0].x + w10 * c[1].x + w11 * c[2].x + w01 * c[3].x),
                     (1 - v) * bottom.y + v * top.y + (1 - u) * left.y + u * right.y -
                         (w00 * c[0].y + w10 * c[1].y + w11 * c[2].y + w01 * c[3].y)};
}

double pb_block_fraction(size_t cells, double grow, size_t index) {
  double total = 0, at = 0, size = 1;
  if (!(grow > 0)) grow = 1;
  for (size_t i = 0; i < cells; i++, size *= grow) {
    if (2 * i + 1 == index) at = total + 0.5 * size;
    if (2 * i == index) at = total;
    total += size;
  }
  return index >= 2 * cells ? 1 : at / total;
}

static pb_status reserve(pb_section *s, pb_error *err) {
  if (s->nodes == s->node_capacity) {
    size_t capacity = s->node_capacity ? 2 * s->node_capacity : 256;
    pb_point2 *at = realloc(s->at, capacity * sizeof *at);
    if (at) s->at = at;
    bool *middle = realloc(s->middle, capacity * sizeof *middle);
    if (middle) s->middle = middle;
    if (!at || !middle) return pb_fail_memory(err, "section");
    s->node_capacity = capacity;
  }
  if (s->quads == s->quad_capacity) {
    size_t capacity = s->quad_capacity ? 2 * s->quad_capacity : 128;
    size_t(*quad)[8] = realloc(s->quad, capacity * sizeof *quad);
    if (quad) s->quad = quad;
    int *tag = realloc(s->tag, capacity * sizeof *tag);
    if (tag) s->tag = tag;
    if (!quad || !tag) return pb_fail_memory(err, "section");
    s->quad_capacity = capacity;
  }
  return PB_OK;
}

// The node at a place, a new one where there is none yet.
static pb_status find_node(pb_section *s, pb_point2 p, bool middle, size_t *out, pb_error *err) {
  for (size_t i = 0; i < s->nodes; i++) {
    if (s->middle[i] != middle || fabs(s->at[i].x - p.x) > s->tolerance) continue;
    if (fabs(s->at[i].y - p.y) > s->tolerance) continue;
    *out = i;
    return PB_OK;
  }
  pb_status st = reserve(s, err);
  if (st) return st;
  s->at[s->nodes] = p;
  s->middle[s->nodes] = middle;
  *out = s->nodes++;
  return PB_OK;
}

// One quadrilateral; a mirrored one is turned round so that its corners stay anticlockwise.
static pb_status add_quad(pb_section *s, const pb_block *block, size_t i, size_t j, int sx, int sy,
                          pb_error *err) {
  static const size_t du[8] = {0, 2, 2, 0, 1, 2, 1, 0}, dv[8] = {0, 0, 2, 2, 0, 1, 2, 1};
  static const int turned[8] = {0, 3, 2, 1, 7, 6, 5, 4};
  pb_status st = reserve(s, err);
  for (int k = 0; !st && k < 8; k++) {
    double u = pb_block_fraction(block->cells[0], block->grow[0], 2 * i + du[k]);
    double v = pb_block_fraction(block->cells[1], block->grow[1], 2 * j + dv[k]);
    pb_point2 p = pb_block_point(block, u, v);
    p.x *= sx, p.y *= sy;
    st = find_node(s, p, k >= 4, &s->quad[s->quads][sx * sy > 0 ? k : turned[k]], err);
  }
  if (!st) s->tag[s->quads++] = block->tag;
  return st;
}

pb_status pb_section_add(pb_section *s, const pb_block *block, bool mirror_x, bool mirror_y,
                         pb_error *err) {
  for (int sy = 1; sy >= (mirror_y ? -1 : 1); sy -= 2) {
    for (int sx = 1; sx >= (mirror_x ? -1 : 1); sx -= 2) {
      for (size_t j = 0; j < block->cells[1]; j++) {
        for (size_t i = 0; i < block->cells[0]; i++) {
          pb_status st = add_quad(s, block, i, j, sx, sy, err);
          if (st) return st;
        }
      }
    }
  }
  return PB_OK;
}

void pb_section_clear(pb_section *s) {
  free(s->at);
  free(s->middle);
  free(s->quad);
  free(s->tag);
  *s = (pb_section){0};
}
