// What import, doctor and truncate read: see source.h.
#include "source.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/text.h"
#include "options.h"
#include "plant/element_doctor.h"

enum { KEY_NODES = 0x500, KEY_MASTERS, KEY_FRAMES, KEY_MODAL, KEY_HALF, KEY_UNITS };

static const struct argp_option option_table[] = {
    {"nodes", KEY_NODES, "FILE", 0, "Coordinates of the nodes (else the last of the files)", 5},
    {"masters", KEY_MASTERS, "FILE", 0, "List of the rows, where the nodes' file has none", 5},
    {"frames", KEY_FRAMES, "N,N,...", 0,
     "Node numbers of the frames, in order, where the format cannot tell", 5},
    {"modal", KEY_MODAL, "P", 0, "The last P rows are modes, where the format cannot tell", 5},
    {"half", KEY_HALF, NULL, 0, "One triangle is stored, though the file does not say so", 5},
    {"units", KEY_UNITS, "L,M,F,T", 0, "Units of the files, as mm,t,N,s (default m,kg,N,s)", 5},
    {0},
};

// ---- units --------------------------------------------------------------------------------------

typedef struct unit {
  const char *name;
  double value;
} unit;

static double find_unit(const unit *list, const char *name, size_t length) {
  for (; list->name; list++)
    if (strlen(list->name) == length && !strncmp(list->name, name, length)) return list->value;
  return 0;
}

// Four consistent units: F = M L / T².
static void parse_units(source *s, const char *text, struct argp_state *state) {
  static const unit length[] = {{"m", 1},       {"mm", 1e-3},   {"cm", 1e-2}, {"um", 1e-6},
                                {"in", 0.0254}, {"ft", 0.3048}, {NULL, 0}};
  static const unit mass[] = {
      {"kg", 1}, {"g", 1e-3}, {"t", 1e3}, {"slinch", 175.1268352465}, {"slug", 14.59390294},
      {NULL, 0}};
  static const unit force[] = {
      {"N", 1}, {"mN", 1e-3}, {"uN", 1e-6}, {"kN", 1e3}, {"lbf", 4.4482216152605}, {NULL, 0}};
  static const unit time[] = {{"s", 1}, {"ms", 1e-3}, {NULL, 0}};
  static const unit *const kind[] = {length, mass, force, time};
  double value[4] = {0};
  const char *at = text;
  for (int k = 0; k < 4; k++) {
    size_t n = strcspn(at, ",");
    value[k] = find_unit(kind[k], at, n);
    at += n + (at[n] == ',' && k < 3);
  }
  if (!value[0] || !value[1] || !value[2] || !value[3] || *at)
    argp_error(
        state,
        "--units: '%s' is not length,mass,force,time of m mm cm um in ft, kg g t slinch slug, "
        "N mN uN kN lbf, s ms",
        text);
  double consistent = value[1] * value[0] / (value[3] * value[3]);
  if (fabs(consistent / value[2] - 1) > 1e-6)
    argp_error(state,
               "--units: %s are not consistent: mass·length/time² is %.6g N, the force %.6g N",
               text, consistent, value[2]);
  s->units = text;
  s->length = value[0];
  s->force = value[2];
  s->time = value[3];
}

// ---- options ------------------------------------------------------------------------------------

static void parse_frames(source *s, const char *text, struct argp_state *state) {
  double *value = NULL;
  pb_option_double_list(state, "--frames", text, &value, &s->frames);
  free(s->frame);
  s->frame = calloc(s->frames + 1, sizeof *s->frame);
  if (!s->frame) argp_failure(state, PB_EXIT_FAILED, 0, "out of memory");
  for (size_t i = 0; i < s->frames; i++) {
    if (value[i] != floor(value[i]) || value[i] < 1 || value[i] > 1e15)
      argp_error(state, "--frames: %g is no node number", value[i]);
    s->frame[i] = (int64_t)value[i];
  }
  free(value);
}

void source_frame_pair(const char *flag, const char *arg, size_t *a, size_t *b,
                       struct argp_state *state) {
  size_t frames[2];
  pb_option_frames(state, flag, arg, frames);
  *a = frames[0] - 1;
  *b = frames[1] - 1;
}

static error_t parse_option(int key, char *arg, struct argp_state *state) {
  source *s = state->input;
  switch (key) {
  case KEY_NODES:
    s->nodes = arg;
    break;
  case KEY_MASTERS:
    s->masters = arg;
    break;
  case KEY_FRAMES:
    parse_frames(s, arg, state);
    break;
  case KEY_MODAL:
    s->modal = (int64_t)pb_option_uint64(state, "--modal", arg, 0, 20000);
    break;
  case KEY_HALF:
    s->half = true;
    break;
  case KEY_UNITS:
    parse_units(s, arg, state);
    break;
  case ARGP_KEY_ARG:
    if (s->files == 3) argp_error(state, "more than three files");
    s->file[s->files++] = arg;
    break;
  case ARGP_KEY_END:
    if (!s->files) argp_error(state, "expected a file");
    if (s->files == 3 && s->nodes) argp_error(state, "nodes are given twice");
    break;
  default:
    return ARGP_ERR_UNKNOWN;
  }
  return 0;
}

const struct argp source_argp = {option_table, parse_option, NULL, NULL, NULL, NULL, NULL};

void source_begin(source *s) {
  *s = (source){.modal = -1, .length = 1, .force = 1, .time = 1};
}

void source_clear(source *s) {
  free(s->frame);
  *s = (source){0};
}

// ---- reading ------------------------------------------------------------------------------------

static bool is_plain(const source *s) {
  return s->files == 1 && !s->nodes && !s->masters && !s->frames && s->modal < 0 && !s->half;
}

static pb_status load_own(const source *s, loaded *out, pb_error *err) {
  pb_status st = pb_element_data_load(s->file[0], &out->import.element, err);
  if (!st) pb_element_convert(&out->import.element, s->length, s->force, s->time);
  out->own = !st;
  return st;
}

// Whether one file holds K and M, so that a second one is the nodes'.
static pb_status holds_both(const char *path, bool *both, pb_error *err) {
  pb_matrix_file f;
  pb_status st = pb_matrix_file_read(path, "M", &f, err);
  *both = !st;
  pb_matrix_file_clear(&f);
  if (st) return st;
  st = pb_matrix_file_read(path, "K", &f, err);
  *both = !st;
  pb_matrix_file_clear(&f);
  return st;
}

static bool has_names(pb_matrix_format format) {
  return format == PB_FORMAT_ANSYS_PRINT || format == PB_FORMAT_NASTRAN_DMIG ||
         format == PB_FORMAT_ABAQUS_MTX || format == PB_FORMAT_MAT5;
}

// K M, K M NODES, BOTH or BOTH NODES.
static pb_status choose_files(const source *s, pb_import_request *r, pb_error *err) {
  pb_matrix_format first, second = PB_FORMAT_UNKNOWN;
  pb_status st = pb_matrix_file_detect(s->file[0], &first, err);
  if (!st && s->files > 1) st = pb_matrix_file_detect(s->file[1], &second, err);
  if (st) return st;
  r->k_file = r->m_file = s->file[0];
  r->node_file = s->nodes;
  if (s->files == 3) {
    r->m_file = s->file[1];
    r->node_file = s->file[2];
  } else if (s->files == 2 && s->nodes) {
    r->m_file = s->file[1];
  } else if (s->files == 2) {
    bool both = false;
    pb_error none;
    if (has_names(first)) st = holds_both(s->file[0], &both, &none);
    if (st == PB_ERR_MEMORY) return pb_fail_memory(err, s->file[0]);
    if (both || second == PB_FORMAT_UNKNOWN)
      r->node_file = s->file[1];
    else
      r->m_file = s->file[1];
  }
  if (r->k_file == r->m_file && !has_names(first))
    return pb_fail(err, PB_ERR_ELEMENT, s->file[0], "holds one matrix (%s): give K and M",
                   pb_matrix_format_name(first));
  return PB_OK;
}

pb_status source_load(const source *s, loaded *out, pb_error *err) {
  *out = (loaded){0};
  pb_matrix_format format;
  pb_status st = pb_matrix_file_detect(s->file[0], &format, err);
  if (st) return st;
  if (format == PB_FORMAT_MAT5 && is_plain(s)) return load_own(s, out, err);
  pb_import_request r = {.master_file = s->masters,
                         .frames = s->frames,
                         .frame = s->frame,
                         .modal = s->modal,
                         .half = s->half,
                         .length = s->length,
                         .force = s->force,
                         .time = s->time};
  st = choose_files(s, &r, err);
  return st ? st : pb_import_read(&r, &out->import, err);
}

void source_unload(loaded *l) {
  pb_import_clear(&l->import);
  *l = (loaded){0};
}

// ---- provenance ---------------------------------------------------------------------------------

static const char *base_name(const char *path) {
  const char *slash = strrchr(path, '/');
  return slash ? slash + 1 : path;
}

char *source_provenance(const source *s, const loaded *l) {
  pb_text text = {0};
  pb_text_format(&text, "plantbus-part " PB_VERSION "\n");
  for (size_t k = 0; k < s->files; k++) pb_text_format(&text, "%s\n", base_name(s->file[k]));
  if (s->nodes) pb_text_format(&text, "nodes: %s\n", base_name(s->nodes));
  if (!l->own)
    pb_text_format(&text, "K: %s, M: %s, rows by %s\n", pb_matrix_format_name(l->import.k.format),
                   pb_matrix_format_name(l->import.m.format), l->import.rows_by);
  if (s->units) pb_text_format(&text, "converted from %s\n", s->units);
  return text.failed ? NULL : text.text;
}
