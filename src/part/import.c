// An element out of other programs' matrices and node lists: see import.h.
#include "part/import.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "plant/element_doctor.h"

enum { LARGEST = 20000 };

typedef struct job {
  const pb_import_request *r;
  pb_import *out;
  pb_matrix_file k, m;
  pb_node_file nodes;
  pb_dof_file masters;
  pb_row_label *label;  // [k.rows]
  size_t frames;
  int64_t *frame;  // [frames]
  size_t *place;   // [k.rows] where a row of K goes in the element
  size_t modes;
  pb_error *err;
} job;

static pb_status misfit(job *j, const char *file, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

static pb_status misfit(job *j, const char *file, const char *format, ...) {
  char message[400];
  va_list args;
  va_start(args, format);
  vsnprintf(message, sizeof message, format, args);
  va_end(args);
  return pb_fail(j->err, PB_ERR_ELEMENT, file, "%s", message);
}

// ---- reading ------------------------------------------------------------------------------------

static bool both_triangles(const pb_matrix_file *f) {
  bool upper = false, lower = false;
  for (size_t e = 0; e < f->count; e++) {
    upper |= f->row[e] < f->col[e];
    lower |= f->row[e] > f->col[e];
  }
  return upper && lower;
}

static pb_status read_matrices(job *j) {
  const pb_import_request *r = j->r;
  bool same = !strcmp(r->k_file, r->m_file);
  pb_status st = pb_matrix_file_read(r->k_file, "K", &j->k, j->err);
  if (!st) st = pb_matrix_file_read(r->m_file, "M", &j->m, j->err);
  if (st) return st;
  if (j->k.rows != j->k.cols || j->m.rows != j->m.cols)
    return misfit(j, r->k_file, "K is %zu × %zu and M is %zu × %zu; expected square matrices",
                  j->k.rows, j->k.cols, j->m.rows, j->m.cols);
  if (j->k.rows != j->m.rows)
    return misfit(j, same ? r->k_file : r->m_file, "M has %zu rows, K has %zu", j->m.rows,
                  j->k.rows);
  if (r->half && (both_triangles(&j->k) || both_triangles(&j->m)))
    return misfit(j, both_triangles(&j->k) ? r->k_file : r->m_file,
                  "--half, but entries lie on both sides of the diagonal");
  if (j->k.rows > LARGEST)
    return misfit(j, r->k_file,
                  "%zu rows are no element but a full model: reduce it (plantbus-part reduce)",
                  j->k.rows);
  return PB_OK;
}

static pb_status read_lists(job *j) {
  const pb_import_request *r = j->r;
  const char *nodes = r->node_file;
  if (!nodes && j->k.format == PB_FORMAT_MAT5) nodes = r->k_file;
  if (!nodes)
    return misfit(j, r->k_file, "the frames' coordinates are missing: give a file with nodes");
  pb_status st = pb_node_file_read(nodes, &j->nodes, j->err);
  if (st) return st;
  j->out->listed = j->nodes.count;
  if (r->master_file) return pb_dof_file_read(r->master_file, &j->masters, j->err);
  if (j->k.label || j->k.format == PB_FORMAT_MAT5) return PB_OK;
  bool masters;
  st = pb_dof_file_has_masters(nodes, &masters, j->err);
  if (!st && masters) st = pb_dof_file_read(nodes, &j->masters, j->err);
  return st;
}

// ---- rows ---------------------------------------------------------------------------------------

static size_t place_of(const job *j, int64_t node) {
  return pb_node_index(j->nodes.number, j->nodes.count, node);
}

static pb_status labels_of_frames(job *j, size_t frames, const int64_t *frame) {
  if (6 * frames > j->k.rows)
    return misfit(j, j->r->k_file,
                  "%zu rows are too few for %zu frames of six: name the frames with --frames, or "
                  "list the masters",
                  j->k.rows, frames);
  for (size_t i = 0; i < 6 * frames; i++)
    j->label[i] = (pb_row_label){frame[i / 6], (int)(i % 6) + 1};
  size_t rest = j->k.rows - 6 * frames;
  if (rest && j->r->modal < 0 && j->k.format != PB_FORMAT_MAT5)
    return misfit(j, j->r->k_file,
                  "%zu rows are %zu frames of six and %zu more: --modal %zu, if those are modes",
                  j->k.rows, frames, rest, rest);
  return PB_OK;
}

// A label for each row of K; direction 0 beyond what the lists explain.
static pb_status label_rows(job *j) {
  const pb_import_request *r = j->r;
  j->label = calloc(j->k.rows, sizeof *j->label);
  if (!j->label) return pb_fail_memory(j->err, r->k_file);
  if (j->k.label) {
    j->out->rows_by = "labels";
    memcpy(j->label, j->k.label, j->k.rows * sizeof *j->label);
    return PB_OK;
  }
  if (j->masters.count) {
    j->out->rows_by = "the list of masters";
    if (j->masters.count > j->k.rows)
      return misfit(j, r->k_file, "%zu rows, but %zu masters are listed", j->k.rows,
                    j->masters.count);
    memcpy(j->label, j->masters.label, j->masters.count * sizeof *j->label);
    return PB_OK;
  }
  j->out->rows_by = r->frames ? "--frames" : "the list of nodes";
  return labels_of_frames(j, r->frames ? r->frames : j->nodes.count,
                          r->frames ? r->frame : j->nodes.number);
}

// Rows of M in the order of K's, by their labels.
static pb_status align_mass(job *j) {
  if (!j->k.label != !j->m.label)
    return misfit(j, j->r->m_file, "only one of K and M has labels of its rows");
  if (!j->m.label) return PB_OK;
  int64_t *to = malloc(j->m.rows * sizeof *to);
  if (!to) return pb_fail_memory(j->err, j->r->m_file);
  pb_status st = PB_OK;
  for (size_t i = 0; !st && i < j->m.rows; i++) {
    pb_row_label want = j->m.label[i];
    size_t at = i, tried = 0;  // the same place as a rule
    while (tried < j->k.rows &&
           (j->label[at].node != want.node || j->label[at].direction != want.direction)) {
      at = (at + 1) % j->k.rows;
      tried++;
    }
    to[i] = (int64_t)at;
    if (tried == j->k.rows)
      st = misfit(j, j->r->m_file, "direction %d of node %jd is a row of M, but none of K",
                  want.direction, (intmax_t)want.node);
  }
  if (!st) pb_matrix_file_reorder(&j->m, to);
  free(to);
  return st;
}

// ---- frames and modes ---------------------------------------------------------------------------

static bool frame_index(const job *j, int64_t node, size_t *at) {
  for (*at = 0; *at < j->frames; (*at)++)
    if (j->frame[*at] == node) return true;
  return false;
}

// Modes: rows without a direction, and, where --modal says that there are some, rows of points that
// have no coordinates.
static bool is_modal(const job *j, size_t row) {
  bool told = j->k.label && j->r->modal > 0;
  return !j->label[row].direction || (told && place_of(j, j->label[row].node) == SIZE_MAX);
}

static pb_status collect_frames(job *j) {
  j->frame = calloc(j->k.rows + j->r->frames + 1, sizeof *j->frame);
  if (!j->frame) return pb_fail_memory(j->err, j->r->k_file);
  for (size_t f = 0; f < j->r->frames; f++) {
    size_t at;
    if (frame_index(j, j->r->frame[f], &at))
      return misfit(j, j->r->k_file, "node %jd is named twice by --frames",
                    (intmax_t)j->r->frame[f]);
    j->frame[j->frames++] = j->r->frame[f];
  }
  for (size_t i = 0; i < j->k.rows; i++) {
    size_t at;
    int64_t node = j->label[i].node;
    if (is_modal(j, i) || frame_index(j, node, &at)) continue;
    if (j->r->frames)
      return misfit(j, j->r->k_file, "row %zu belongs to node %jd, which --frames does not name",
                    i + 1, (intmax_t)node);
    if (place_of(j, node) == SIZE_MAX)
      return misfit(j, j->r->k_file,
                    "row %zu belongs to node %jd, which the node list lacks (modal coordinates? "
                    "--modal tells how many)",
                    i + 1, (intmax_t)node);
    j->frame[j->frames++] = node;
  }
  if (!j->frames) return misfit(j, j->r->k_file, "no row belongs to a frame");
  return PB_OK;
}

static pb_status check_directions(job *j, const unsigned char *seen) {
  for (size_t f = 0; f < j->frames; f++) {
    if (seen[f] == 63) continue;
    char have[16] = "";
    for (int d = 0, n = 0; d < 6; d++)
      if (seen[f] >> d & 1) n += snprintf(have + n, sizeof have - (size_t)n, " %d", d + 1);
    return misfit(j, j->r->k_file,
                  "node %jd has the directions%s: a frame has six (a full model is for "
                  "plantbus-part reduce)",
                  (intmax_t)j->frame[f], have[0] ? have : " none");
  }
  return PB_OK;
}

static pb_status place_rows(job *j) {
  j->place = calloc(j->k.rows, sizeof *j->place);
  unsigned char *seen = calloc(j->frames, 1);
  pb_status st = j->place && seen ? PB_OK : pb_fail_memory(j->err, j->r->k_file);
  for (size_t i = 0; !st && i < j->k.rows; i++) {
    size_t f;
    int d = j->label[i].direction;
    if (is_modal(j, i)) {
      j->place[i] = 6 * j->frames + j->modes++;
    } else if (frame_index(j, j->label[i].node, &f)) {
      seen[f] |= (unsigned char)(1 << (d - 1));
      j->place[i] = 6 * f + (size_t)d - 1;
    }
  }
  if (!st) st = check_directions(j, seen);
  if (!st && j->r->modal >= 0 && j->modes != (size_t)j->r->modal)
    st = misfit(j, j->r->k_file, "%zu modal coordinates, but --modal says %jd", j->modes,
                (intmax_t)j->r->modal);
  free(seen);
  return st;
}

// ---- element ------------------------------------------------------------------------------------

static void fill(const job *j, const pb_matrix_file *f, double *x) {
  size_t n = j->k.rows;
  for (size_t e = 0; e < f->count; e++) {
    size_t row = j->place[f->row[e]], col = j->place[f->col[e]];
    x[row + col * n] += f->value[e];
    if (row != col && (f->half || j->r->half)) x[col + row * n] += f->value[e];
  }
}

static pb_status make_element(job *j) {
  pb_element_data *e = &j->out->element;
  size_t n = j->k.rows;
  *e = (pb_element_data){.frames = j->frames, .size = n};
  e->position = calloc(3 * j->frames, sizeof *e->position);
  e->k = calloc(n * n, sizeof *e->k);
  e->m = calloc(n * n, sizeof *e->m);
  if (!e->position || !e->k || !e->m) return pb_fail_memory(j->err, j->r->k_file);
  for (size_t f = 0; f < j->frames; f++) {
    size_t at = place_of(j, j->frame[f]);
    if (at == SIZE_MAX)
      return misfit(j, j->r->node_file ? j->r->node_file : j->r->k_file,
                    "frame %jd is not among the nodes", (intmax_t)j->frame[f]);
    memcpy(e->position + 3 * f, j->nodes.xyz + 3 * at, 3 * sizeof *e->position);
  }
  fill(j, &j->k, e->k);
  fill(j, &j->m, e->m);
  return PB_OK;
}

static void drop_entries(pb_matrix_file *f) {
  pb_matrix_file kept = *f;
  kept.row = kept.col = NULL;
  kept.value = NULL;
  kept.label = NULL;
  pb_matrix_file_clear(f);
  *f = kept;
}

pb_status pb_import_read(const pb_import_request *request, pb_import *out, pb_error *err) {
  job j = {.r = request, .out = out, .err = err};
  *out = (pb_import){0};
  pb_status st = read_matrices(&j);
  if (!st) st = read_lists(&j);
  if (!st) st = label_rows(&j);
  if (!st) st = align_mass(&j);
  if (!st) st = collect_frames(&j);
  if (!st) st = place_rows(&j);
  if (!st) st = make_element(&j);
  if (!st) {
    pb_element_convert(&out->element, request->length, request->force, request->time);
    out->node = j.frame;
    j.frame = NULL;
    out->k = j.k;
    out->m = j.m;
    drop_entries(&out->k);
    drop_entries(&out->m);
    j.k = j.m = (pb_matrix_file){0};
  }
  pb_matrix_file_clear(&j.k);
  pb_matrix_file_clear(&j.m);
  pb_node_file_clear(&j.nodes);
  pb_dof_file_clear(&j.masters);
  free(j.label);
  free(j.frame);
  free(j.place);
  if (st) pb_import_clear(out);
  return st;
}

void pb_import_clear(pb_import *import) {
  pb_element_data_clear(&import->element);
  free(import->node);
  pb_matrix_file_clear(&import->k);
  pb_matrix_file_clear(&import->m);
  *import = (pb_import){0};
}
