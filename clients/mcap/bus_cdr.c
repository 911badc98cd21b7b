// See bus_cdr.h. The order of the fields is that of idl/plantbus.idl.
#include "bus_cdr.h"

#include <string.h>

typedef struct cdr {
  pb_cursor c;
  size_t begin;  // octets left at the origin of the alignment
  size_t widest;
} cdr;

static bool cdr_begin(pb_view data, cdr *out) {
  *out = (cdr){.c = {data.p, data.size, false}};
  const uint8_t first = pb_cursor_u8(&out->c), kind = pb_cursor_u8(&out->c);
  pb_cursor_u16(&out->c);
  out->begin = out->c.left;
  out->widest = kind == 1 ? 8 : 4;  // CDR_LE and CDR2_LE
  return !out->c.bad && first == 0 && (kind == 1 || kind == 7);
}

static void align(cdr *d, size_t size) {
  if (size > d->widest) size = d->widest;
  const size_t over = (d->begin - d->c.left) % size;
  if (over > 0) pb_cursor_take(&d->c, size - over);
}

static uint32_t u32(cdr *d) {
  align(d, 4);
  return pb_cursor_u32(&d->c);
}

static uint64_t u64(cdr *d) {
  align(d, 8);
  return pb_cursor_u64(&d->c);
}

static double real(cdr *d) {
  const uint64_t bits = u64(d);
  double value;
  memcpy(&value, &bits, sizeof value);
  return value;
}

// The length counts the terminating zero.
static pb_view text(cdr *d) {
  pb_view view = pb_cursor_take(&d->c, u32(d));
  if (view.size > 0) view.size--;
  return view;
}

bool pb_cdr_sample(pb_view data, plantbus_Sample *out) {
  cdr d;
  if (!cdr_begin(data, &d)) return false;
  out->step = u64(&d);
  out->time_ns = (int64_t)u64(&d);
  out->epoch = u32(&d);
  out->revision = u32(&d);
  out->flags = u32(&d);
  out->input_count = u32(&d);
  out->output_count = u32(&d);
  out->decimation = u32(&d);
  for (int i = 0; i < plantbus_MAX_INPUTS; i++) out->input[i] = real(&d);
  for (int i = 0; i < plantbus_MAX_OUTPUTS; i++) out->output[i] = real(&d);
  return !d.c.bad && out->input_count <= plantbus_MAX_INPUTS &&
         out->output_count <= plantbus_MAX_OUTPUTS;
}

bool pb_cdr_event(pb_view data, pb_cdr_event_view *out) {
  cdr d;
  if (!cdr_begin(data, &d)) return false;
  out->number = u64(&d);
  text(&d);  // the plant
  out->kind = text(&d);
  out->epoch = u32(&d);
  out->step = u64(&d);
  pb_cursor_take(&d.c, 16);
  out->client_name = text(&d);
  out->channel = text(&d);
  out->message = text(&d);
  return !d.c.bad;
}

bool pb_cdr_command(pb_view data, pb_cdr_place *out) {
  cdr d;
  *out = (pb_cdr_place){0};
  if (!cdr_begin(data, &d)) return false;
  u64(&d);  // the session
  out->step = u64(&d);
  return !d.c.bad;
}

bool pb_cdr_status(pb_view data, pb_cdr_place *out) {
  cdr d;
  *out = (pb_cdr_place){0};
  if (!cdr_begin(data, &d)) return false;
  text(&d);  // the plant
  u32(&d);   // mode
  u64(&d);   // speed
  u32(&d);   // decimation
  out->epoch = u32(&d);
  u32(&d);  // revision
  out->step = u64(&d);
  return !d.c.bad;
}
