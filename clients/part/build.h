// plantbus-part build: what its parts share.
#ifndef PB_CLIENTS_PART_BUILD_H
#define PB_CLIENTS_PART_BUILD_H

#include <stdbool.h>

#include "element_out.h"
#include "options.h"
#include "part/characteristics.h"

typedef struct build_options {
  const char *file;
  const char *out;
  pb_element_format format;
  bool json;
  size_t sets;
  const char **set;     // [sets] "/pointer=value"
  const char *sweep;    // "/pointer=v1,v2,…", or NULL
  size_t densities;     // of a convergence table; 0: none asked for
  double *density;      // [densities]
  const char *plot;     // of a sweep or a convergence table
  const char *picture;  // .svg or .png
  size_t picture_mode;  // 0: the part at rest
  const char *full;     // directory for the full model
} build_options;

// One part from its description to its element.
typedef struct build {
  cJSON *json;
  pb_part part;
  pb_mesh mesh;
  pb_fem fem;
  pb_reduction *element;
  size_t values;
  pb_characteristic value[PB_CHARACTERISTICS];
  double rigid_hz, flexible_hz;  // of the free element: rigid motions at most, first deforming mode
  double seconds[2];             // mesh and matrices; reduction
} build;

// Reads the part file and applies --set. *json is owned by the caller (cJSON_Delete).
pb_status build_read(const build_options *options, cJSON **json, pb_error *err);

// A copy of the description with `text` (JSON, or a bare word as a string) at a pointer.
pb_status build_set(const cJSON *json, const char *pointer, const char *text, cJSON **out,
                    pb_error *err);

// Mesh and full model only (out->element NULL), then the element. keep_shapes: for mode pictures.
// *out is to be cleared by build_clear, also after a failure.
pb_status build_model(const cJSON *json, build *out, pb_error *err);
pb_status build_reduce(build *out, bool keep_shapes, pb_error *err);
void build_clear(build *b);

// Tables or JSON about one element, beside the published values.
pb_status build_report(const build *b, const build_options *options, pb_error *err);

// The element as a file, with the part's description in it.
pb_status build_write(const build *b, const build_options *options, pb_error *err);

// Many elements in one table: a dimension swept, or the mesh refined.
pb_status build_sweep(const build_options *options, pb_error *err);
pb_status build_converge(const build_options *options, pb_error *err);

// The meshed part, at rest or in a mode.
pb_status build_picture(const build *b, const build_options *options, pb_error *err);

// Full matrices, nodes and a CalculiX deck.
pb_status build_full(const build *b, const char *directory, pb_error *err);

#endif
