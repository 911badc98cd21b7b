// Pictures of meshes: shaded polygons, and their files (internal to plantbus-part build).
#ifndef PB_CLIENTS_PART_BUILD_PICTURE_H
#define PB_CLIENTS_PART_BUILD_PICTURE_H

#include "build.h"

typedef struct polygon {
  double x[8], y[8];  // on the screen, m, y upwards
  double depth;       // towards the eye
  unsigned char rgb[3];
} polygon;

typedef struct drawing {
  char title[256];
  size_t polygons;
  polygon *polygon;  // [polygons] farthest first
} drawing;

// Both fail with PB_ERR_IO, PB_ERR_MEMORY; the file appears whole.
pb_status drawing_svg(const drawing *d, const char *path, pb_error *err);
pb_status drawing_png(const drawing *d, const char *path, pb_error *err);  // by gnuplot

#endif
