// See handover.h.
#include "model/handover.h"

#include <stdlib.h>
#include <string.h>

#include "base/array.h"
#include "base/product.h"

// A_d^j B_d, j = 0 … L − 1, one after the other: nx × (nu · L).
static double *responses(const pb_handover *h) {
  const pb_model *m = h->transfer->from;
  const size_t block = m->nx * m->nu;
  double *v = pb_array_new(block * h->steps + 1, sizeof *v);
  if (!v) return NULL;
  memcpy(v, m->bd, block * sizeof *v);
  for (size_t j = 1; j < h->steps; j++) {
    memcpy(v + j * block, v + (j - 1) * block, block * sizeof *v);
    for (size_t i = 0; i < m->nu; i++)
      pb_step_state(m, v + j * block + i * m->nx, h->rest, h->scratch);
  }
  return v;
}

pb_status pb_handover_new(pb_transfer *transfer, size_t steps, const pb_workers *workers,
                          pb_handover **out, pb_error *err) {
  const size_t nx = transfer->from->nx, nu = transfer->from->nu, mx = transfer->to->nx;
  pb_handover *h = calloc(1, sizeof *h);
  *out = NULL;
  if (!h) return pb_fail_memory(err, "handover");
  h->transfer = transfer;
  h->steps = steps;
  h->g = pb_array_new(mx * nu * steps + 1, sizeof(double));
  h->base = pb_array_zero(nx + 1, sizeof(double));
  h->scratch = pb_array_zero(transfer->from->widest + 1, sizeof(double));
  h->rest = pb_array_zero(nu + 1, sizeof(double));
  h->carried = pb_array_zero(mx + 1, sizeof(double));
  h->driven = pb_array_zero(mx + 1, sizeof(double));
  const bool ok = h->g && h->base && h->scratch && h->rest && h->carried && h->driven;
  double *v = ok ? responses(h) : NULL;
  if (!v) {
    pb_handover_free(h);
    return pb_fail_memory(err, "handover");
  }
  const pb_product product = {"N", "N", mx, nu * steps, nx, transfer->x, v, mx, nx, 0, h->g, mx};
  pb_product_make(&product, workers);
  free(v);
  *out = h;
  return PB_OK;
}

void pb_handover_free(pb_handover *h) {
  if (!h) return;
  free(h->g);
  free(h->base);
  free(h->scratch);
  free(h->rest);
  free(h->carried);
  free(h->driven);
  free(h);
}

void pb_handover_begin(pb_handover *h, const pb_state *before) {
  memcpy(h->base, before->data, h->transfer->from->nx * sizeof *h->base);
  memset(h->driven, 0, h->transfer->to->nx * sizeof *h->driven);
  h->taken = 0;
}

void pb_handover_carry(pb_handover *h) {
  const pb_model *m = h->transfer->from;
  const size_t mx = h->transfer->to->nx;
  for (size_t k = 0; k < h->steps; k++) pb_step_state(m, h->base, h->rest, h->scratch);
  memset(h->carried, 0, mx * sizeof *h->carried);
  pb_add_columns(mx, m->nx, h->transfer->x, h->base, h->carried);
}

void pb_handover_follow(pb_handover *h, const pb_state *before) {
  const pb_model *m = h->transfer->from;
  const size_t mx = h->transfer->to->nx, left = h->steps - 1 - h->taken++;
  pb_add_columns(mx, m->nu, h->g + left * mx * m->nu, before->data + m->nx, h->driven);
}

void pb_handover_apply(pb_handover *h, const pb_state *before, pb_state *after) {
  const size_t mx = h->transfer->to->nx;
  for (size_t i = 0; i < mx; i++) h->driven[i] += h->carried[i];
  pb_transfer_apply_moved(h->transfer, before, h->driven, after);
}
