// The meshed part as a picture: the faces of its surface, flat-shaded, nearest last.
//
// A face's outline runs through its mid-side nodes, so that curved edges look curved. The view is
// parallel, from the front, right and above; z points upwards.
#include "build_picture.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

// Screen axes and view direction (towards the eye) in part axes, orthonormal.
static void view_axes(double right[3], double up[3], double eye[3]) {
  double azimuth = -60 * 3.14159265358979323846 / 180,
         elevation = 25 * 3.14159265358979323846 / 180;
  eye[0] = cos(elevation) * cos(azimuth);
  eye[1] = cos(elevation) * sin(azimuth);
  eye[2] = sin(elevation);
  right[0] = -sin(azimuth), right[1] = cos(azimuth), right[2] = 0;
  up[0] = -sin(elevation) * cos(azimuth);
  up[1] = -sin(elevation) * sin(azimuth);
  up[2] = cos(elevation);
}

static double dot(const double a[3], const double b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Material colours (shell or body, stack, spacer), darker where the light falls flat.
static void shade(int region, double light, unsigned char rgb[3]) {
  static const double base[PB_PART_MATERIALS][3] = {
      {150, 170, 195}, {235, 165, 70}, {120, 130, 120}};
  double factor = 0.45 + 0.6 * light;
  for (int a = 0; a < 3; a++) rgb[a] = (unsigned char)fmin(255, factor * base[region][a]);
}

// One face as a polygon; false: seen from behind.
static bool project(double xyz[8][3], int region, polygon *out) {
  static const int order[8] = {0, 4, 1, 5, 2, 6, 3, 7};
  static const double sun[3] = {0.35, -0.75, 0.56};
  double right[3], up[3], eye[3], a[3], b[3], normal[3];
  view_axes(right, up, eye);
  for (int i = 0; i < 3; i++) a[i] = xyz[2][i] - xyz[0][i], b[i] = xyz[3][i] - xyz[1][i];
  for (int i = 0; i < 3; i++)
    normal[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
  double size = sqrt(dot(normal, normal));
  if (!(size > 0) || dot(normal, eye) <= 0) return false;
  shade(region, fmax(0, dot(normal, sun) / size), out->rgb);
  out->depth = 0;
  for (int i = 0; i < 8; i++) {
    const double *p = xyz[order[i]];
    out->x[i] = dot(p, right);
    out->y[i] = dot(p, up);
    out->depth += dot(p, eye) / 8;
  }
  return true;
}

static int farther_first(const void *a, const void *b) {
  double x = ((const polygon *)a)->depth, y = ((const polygon *)b)->depth;
  return (x > y) - (x < y);
}

// Places of the nodes: at rest, or with `motion` (3 × nodes) added, scaled so that the largest one
// is 8 % of the part's size.
static double motion_scale(const pb_mesh *mesh, const double *motion) {
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  double largest = 0, size = 0;
  for (size_t i = 0; i < mesh->nodes; i++) {
    for (int a = 0; a < 3; a++) {
      low[a] = fmin(low[a], mesh->xyz[3 * i + (size_t)a]);
      high[a] = fmax(high[a], mesh->xyz[3 * i + (size_t)a]);
    }
    largest = fmax(largest, sqrt(dot(motion + 3 * i, motion + 3 * i)));
  }
  for (int a = 0; a < 3; a++) size = fmax(size, high[a] - low[a]);
  return largest > 0 ? 0.08 * size / largest : 0;
}

static pb_status collect(const pb_mesh *mesh, const double *motion, drawing *out, pb_error *err) {
  pb_mesh_face *face = NULL;
  size_t faces = 0;
  pb_status st = pb_mesh_faces(mesh, &face, &faces, err);
  if (st) return st;
  double scale = motion ? motion_scale(mesh, motion) : 0;
  out->polygon = malloc((faces + 1) * sizeof *out->polygon);
  if (!out->polygon) st = pb_fail_memory(err, "picture");
  for (size_t f = 0; !st && f < faces; f++) {
    double xyz[8][3];
    if (!face[f].surface) continue;
    pb_mesh_face_places(mesh, face + f, xyz);
    for (int i = 0; motion && i < 8; i++) {
      size_t node = mesh->node[face[f].element][pb_hex20_face[face[f].face][i]];
      for (int a = 0; a < 3; a++) xyz[i][a] += scale * motion[3 * node + (size_t)a];
    }
    out->polygons += project(xyz, mesh->region[face[f].element], out->polygon + out->polygons);
  }
  free(face);
  if (!st) qsort(out->polygon, out->polygons, sizeof *out->polygon, farther_first);
  return st;
}

// The full motion in mode k (from 1) of the element held at its bottom frame, and its frequency.
static pb_status mode_motion(const build *b, size_t k, double *motion, double *hz, pb_error *err) {
  const pb_reduction *r = b->element;
  size_t modes = r->size - 6, held = b->part.type == PB_PART_FLEXIBLE_JOINT ? 1 : 0;
  if (k > modes)
    return pb_fail(err, PB_ERR_ARGUMENT, "--picture-mode", "the held element has %zu modes", modes);
  double *frequency = malloc(modes * sizeof *frequency);
  double *shape = malloc(r->size * modes * sizeof *shape);
  pb_status st = frequency && shape ? PB_OK : pb_fail_memory(err, "picture");
  if (!st) st = pb_element_held_modes(r, held, frequency, shape, err);
  for (size_t j = 0; !st && j < r->size; j++)
    for (size_t i = 0; i < r->full_dof; i++)
      motion[i] += shape[j + (k - 1) * r->size] * r->shape[i + j * r->full_dof];
  if (!st) *hz = frequency[k - 1];
  free(frequency);
  free(shape);
  return st;
}

pb_status build_picture(const build *b, const build_options *options, pb_error *err) {
  drawing d = {0};
  double hz = 0, *motion = NULL;
  pb_status st = PB_OK;
  snprintf(d.title, sizeof d.title, "%s: %zu elements, %zu degrees of freedom", b->part.name,
           b->mesh.elements, b->element->full_dof);
  if (options->picture_mode) {
    motion = calloc(b->element->full_dof, sizeof *motion);
    st = motion ? mode_motion(b, options->picture_mode, motion, &hz, err)
                : pb_fail_memory(err, "picture");
    snprintf(d.title, sizeof d.title, "%s, held at its bottom frame: mode %zu at %.4g Hz",
             b->part.name, options->picture_mode, hz);
  }
  if (!st) st = collect(&b->mesh, motion, &d, err);
  const char *dot_at = strrchr(options->picture, '.');
  if (!st)
    st = !strcmp(dot_at, ".svg") ? drawing_svg(&d, options->picture, err)
                                 : drawing_png(&d, options->picture, err);
  free(motion);
  free(d.polygon);
  return st;
}
