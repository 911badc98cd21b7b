// Which nodes a frame is tied to: by list, by set, by place.
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "frames_internal.h"
#include "node_sets.h"
#include "part/matrix_file.h"

// ---- selections ---------------------------------------------------------------------------------

// A selection takes away the nodes that it does not accept; several on one frame intersect.
static void keep_where(const frame_source *s, bool (*accepts)(const double *, const double *),
                       const double *shape) {
  for (size_t i = 0; i < s->fem->nodes; i++)
    if (s->chosen[i]) s->chosen[i] = accepts(shape, s->fem->xyz + 3 * i);
}

// shape: lowest corner, highest corner.
static bool in_box(const double *shape, const double *x) {
  bool in = true;
  for (size_t a = 0; a < 3; a++) in &= x[a] >= shape[a] && x[a] <= shape[3 + a];
  return in;
}

// shape: point, unit normal, tolerance.
static bool on_plane(const double *shape, const double *x) {
  double along = 0;
  for (size_t a = 0; a < 3; a++) along += (x[a] - shape[a]) * shape[3 + a];
  return fabs(along) <= shape[6];
}

// shape: point, unit axis, radius, tolerance.
static bool on_cylinder(const double *shape, const double *x) {
  double along = 0, square = 0;
  for (size_t a = 0; a < 3; a++) along += (x[a] - shape[a]) * shape[3 + a];
  for (size_t a = 0; a < 3; a++) {
    double off = x[a] - shape[a] - along * shape[3 + a];
    square += off * off;
  }
  return fabs(sqrt(square) - shape[6]) <= shape[7];
}

// A millionth of the model's largest extent: nodes are meant to lie on the surface.
static double default_tolerance(const pb_fem *fem) {
  double size = 0;
  for (size_t a = 0; a < 3; a++) {
    double low = INFINITY, high = -INFINITY;
    for (size_t i = 0; i < fem->nodes; i++) {
      low = fmin(low, fem->xyz[a + 3 * i]);
      high = fmax(high, fem->xyz[a + 3 * i]);
    }
    size = fmax(size, high - low);
  }
  return 1e-6 * size;
}

static pb_status select_box(const frame_source *s, const cJSON *value, const char *where,
                            pb_error *err) {
  double shape[6];
  if (!cJSON_IsArray(value) || cJSON_GetArraySize(value) != 2)
    return pb_fail(err, PB_ERR_SCHEMA, where, "expected [[x, y, z], [x, y, z]]");
  pb_status st = pb_json_numbers(cJSON_GetArrayItem(value, 0), where, 3, shape, err);
  if (!st) st = pb_json_numbers(cJSON_GetArrayItem(value, 1), where, 3, shape + 3, err);
  for (size_t a = 0; a < 6; a++) shape[a] *= s->length;
  for (size_t a = 0; !st && a < 3; a++)
    if (shape[a] > shape[3 + a])
      st = pb_fail(err, PB_ERR_SCHEMA, where, "the lowest corner comes first");
  if (!st) keep_where(s, in_box, shape);
  return st;
}

// Plane (direction "normal") or cylinder ("axis" and radius): point, direction, [radius,]
// tolerance.
static pb_status select_surface(const frame_source *s, const cJSON *value, const char *where,
                                bool cylinder, pb_error *err) {
  static const char *const plane_keys[] = {"point", "normal", "tolerance", NULL};
  static const char *const cylinder_keys[] = {"point", "axis", "radius", "tolerance", NULL};
  double shape[8], tolerance;
  bool found;
  pb_reader r;
  pb_field radius = {"radius", 0, PB_POSITIVE, true, 0};
  pb_field within = {"tolerance", 0, PB_NON_NEGATIVE, false, default_tolerance(s->fem) / s->length};
  pb_status st = pb_reader_open(value, where, NULL, &r, err);
  if (!st) st = pb_reader_known(&r, cylinder ? cylinder_keys : plane_keys, NULL, 0);
  if (!st) st = pb_reader_vector(&r, "point", true, shape, &found);
  if (!st) st = pb_reader_direction(&r, cylinder ? "axis" : "normal", true, shape + 3, &found);
  if (!st && cylinder) st = pb_reader_number(&r, &radius, &shape[6]);
  if (!st) st = pb_reader_number(&r, &within, &tolerance);
  if (st) return st;
  for (size_t a = 0; a < 3; a++) shape[a] *= s->length;
  if (cylinder) shape[6] *= s->length;
  shape[cylinder ? 7 : 6] = tolerance * s->length;
  keep_where(s, cylinder ? on_cylinder : on_plane, shape);
  return PB_OK;
}

static size_t node_index(const pb_fem *fem, int64_t number) {
  if (!fem->number)
    return number >= 1 && (size_t)number <= fem->nodes ? (size_t)number - 1 : SIZE_MAX;
  return pb_node_index(fem->number, fem->nodes, number);  // numbers ascend
}

// Node numbers in the order in which the frame lists them, which is that of its weights.
static pb_status list_nodes(const cJSON *value, const char *where, int64_t **number, size_t *count,
                            pb_error *err) {
  size_t size = cJSON_IsArray(value) ? (size_t)cJSON_GetArraySize(value) : 0;
  *number = NULL;
  *count = 0;
  if (!size) return pb_fail(err, PB_ERR_SCHEMA, where, "expected an array of node numbers");
  int64_t *made = malloc(size * sizeof *made);
  if (!made) return pb_fail_memory(err, where);
  pb_status st = PB_OK;
  const cJSON *item;
  cJSON_ArrayForEach(item, value) {
    size_t n;
    st = pb_json_index(item, where, 1, (size_t)1 << 52, &n, err);
    if (st) break;
    made[(*count)++] = (int64_t)n;
  }
  if (st) {
    free(made);
    *count = 0;
    return st;
  }
  *number = made;
  return PB_OK;
}

// Numbers into indices; a node may be named once.
static pb_status find_nodes(const frame_source *s, const int64_t *number, size_t count,
                            const char *where, size_t *node, pb_error *err) {
  memset(s->chosen, 0, s->fem->nodes * sizeof *s->chosen);
  for (size_t i = 0; i < count; i++) {
    node[i] = node_index(s->fem, number[i]);
    if (node[i] == SIZE_MAX)
      return pb_fail(err, PB_ERR_REFERENCE, where, "there is no node %" PRId64, number[i]);
    if (s->chosen[node[i]])
      return pb_fail(err, PB_ERR_ARGUMENT, where, "node %" PRId64 " is named twice", number[i]);
    s->chosen[node[i]] = true;
  }
  return PB_OK;
}

// ---- all keys -----------------------------------------------------------------------------------

static pb_status choose_listed(const frame_source *s, const pb_reader *r, pb_fem_frame *frame,
                               bool *listed, pb_error *err) {
  char where[256], set_where[256];
  const cJSON *nodes = pb_reader_find(r, "nodes", where);
  const cJSON *set = pb_reader_find(r, "set", set_where);
  int64_t *number = NULL;
  size_t count = 0;
  pb_status st = PB_OK;
  *listed = nodes || set;
  if (!*listed) return PB_OK;
  if (nodes && set) return pb_fail(err, PB_ERR_SCHEMA, set_where, "nodes are given already");
  if (nodes) {
    st = list_nodes(nodes, where, &number, &count, err);
  } else if (!cJSON_IsString(set)) {
    st = pb_fail(err, PB_ERR_SCHEMA, set_where, "expected the name of a node set");
  } else if (!s->sets) {
    st = pb_fail(err, PB_ERR_REFERENCE, set_where,
                 "no file with node sets is given (\"sets\", --sets)");
  } else {
    st = pb_node_set_read(s->sets, set->valuestring, &number, &count, err);
  }
  if (!st) {
    frame->node = malloc((count + 1) * sizeof *frame->node);
    st = frame->node ? find_nodes(s, number, count, nodes ? where : set_where, frame->node, err)
                     : pb_fail_memory(err, where);
  }
  frame->nodes = count;
  free(number);
  return st;
}

// Selections by place, and their nodes in the order of the model, or of the list they narrow.
pb_status frame_choose_nodes(const frame_source *s, const pb_reader *r, pb_fem_frame *frame,
                             pb_error *err) {
  char where[256];
  bool listed, placed = false;
  pb_status st = choose_listed(s, r, frame, &listed, err);
  for (size_t i = 0; !st && !listed && i < s->fem->nodes; i++) {
    const int64_t *dof = s->fem->dof + 3 * i;  // nodes of no element are no part of a face
    s->chosen[i] = dof[0] >= 0 || dof[1] >= 0 || dof[2] >= 0;
  }
  static const char *const by_place[] = {"box", "plane", "cylinder"};
  for (size_t k = 0; !st && k < 3; k++) {
    const cJSON *value = pb_reader_find(r, by_place[k], where);
    if (!value) continue;
    placed = true;
    st = k == 0 ? select_box(s, value, where, err) : select_surface(s, value, where, k == 2, err);
  }
  if (st) return st;
  if (!listed && !placed)
    return pb_fail(err, PB_ERR_SCHEMA, r->own_pointer,
                   "says of no nodes: expected nodes, set, box, plane or cylinder");
  if (!listed) {
    frame->node = malloc((s->fem->nodes + 1) * sizeof *frame->node);
    if (!frame->node) return pb_fail_memory(err, frame->name);
    for (size_t i = 0; i < s->fem->nodes; i++) frame->node[i] = i;
    frame->nodes = s->fem->nodes;
  }
  size_t kept = 0;
  for (size_t i = 0; i < frame->nodes; i++)
    if (s->chosen[frame->node[i]]) frame->node[kept++] = frame->node[i];
  frame->nodes = kept;
  return kept ? PB_OK : pb_fail(err, PB_ERR_ARGUMENT, r->own_pointer, "no node is selected");
}
