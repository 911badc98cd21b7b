// Laying out a model's matrices for the step's kernels: see step_kernel.h.
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "model/step_kernel.h"

enum { LANES = PB_STEP_LANES, ALIGNMENT = 64 };

// One entry of the two diagonals of A_d or of B_d: what row r multiplies for this state.
static double advance_entry(const pb_model *m, size_t state, size_t r) {
  const double *ad = m->ad + 4 * (state / 2);
  if (r == 0) return state % 2 ? ad[3] : ad[0];
  if (r == 1) return state % 2 ? ad[1] : ad[2];
  return m->bd[state + (r - 2) * m->nx];
}

// `groups` groups from state `first` on, row by row.
static void pack_groups(const pb_model *m, size_t states, size_t first, size_t groups, double *to) {
  for (size_t r = 0; r < 2 + m->nu; r++)
    for (size_t l = 0; l < groups * LANES; l++, to++)
      *to = first + l < states ? advance_entry(m, first + l, r) : 0;
}

static void pack_advance(const pb_model *m, size_t states, double *to) {
  const size_t whole = states / LANES * LANES, at_once = PB_STEP_AT_ONCE * LANES;
  size_t first = 0;
  for (size_t width; first < whole; first += width) {
    width = whole - first < at_once ? whole - first : at_once;
    pack_groups(m, states, first, width / LANES, to);
    to += (2 + m->nu) * width;
  }
  if (first < states) pack_groups(m, states, first, 1, to);
}

// `width` outputs from `first` on, state by state.
static void pack_panels(const pb_model *m, size_t first, size_t width, double *to) {
  for (size_t j = 0; j < m->nx + m->nu; j++) {
    const double *column = j < m->nx ? m->c + j * m->ny : m->d + (j - m->nx) * m->ny;
    for (size_t o = first; o < first + width; o++) *to++ = o < m->ny ? column[o] : 0;
  }
}

static void pack_output(const pb_model *m, size_t panels, size_t tail, double *to) {
  const size_t whole = panels * LANES, at_once = PB_STEP_AT_ONCE * LANES;
  size_t first = 0;
  for (size_t width; first < whole; first += width) {
    width = whole - first < at_once ? whole - first : at_once;
    pack_panels(m, first, width, to);
    to += (m->nx + m->nu) * width;
  }
  pack_panels(m, first, tail, to);
}

pb_status pb_step_pack_model(pb_model *m, pb_error *err) {
  const size_t nz = m->nx + m->nu, states = 2 * m->pairs, left = m->ny % LANES;
  const size_t groups = (states + LANES - 1) / LANES, panels = m->ny / LANES + (left > 4);
  const size_t tail = left > 4 || !left ? 0 : left > 2 ? 4 : 2;
  const size_t advance = groups * (2 + m->nu) * LANES, output = nz * (panels * LANES + tail);
  unsigned char *memory =
      malloc(sizeof(pb_step_pack) + ALIGNMENT + (advance + output) * sizeof(double));
  if (!memory) return pb_fail_memory(err, "");
  const size_t past = (uintptr_t)(memory + sizeof(pb_step_pack)) % ALIGNMENT;
  double *array = (double *)(memory + sizeof(pb_step_pack) + (past ? ALIGNMENT - past : 0));
  pack_advance(m, states, array);
  pack_output(m, panels, tail, array + advance);
  const pb_step_kernel *kernel[3];
  const size_t kernels = pb_step_kernels(kernel);
  pb_step_pack *pack = (pb_step_pack *)memory;
  *pack = (pb_step_pack){.kernel = kernel[kernels - 1],
                         .nu = m->nu,
                         .ny = m->ny,
                         .nz = nz,
                         .states = states,
                         .panels = panels,
                         .tail = tail,
                         .advance = array,
                         .output = array + advance};
  pb_step_pack_free(m->step);
  m->step = pack;
  return PB_OK;
}

void pb_step_pack_free(pb_step_pack *pack) {
  free(pack);
}
