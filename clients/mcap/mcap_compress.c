// See mcap_compress.h.
#include "mcap_compress.h"

#include <lz4frame.h>
#include <string.h>
#include <zstd.h>

enum { STEP = 1 << 16 };  // octets expanded at once
static const int zstd_level = 1;

const char *pb_mcap_compression_name(pb_mcap_compression kind) {
  static const char *const name[] = {"", "lz4", "zstd"};
  return kind < PB_MCAP_COMPRESSIONS ? name[kind] : "unknown";
}

pb_mcap_compression pb_mcap_compression_of(pb_view name) {
  int kind = 0;
  while (kind < PB_MCAP_COMPRESSIONS &&
         !pb_view_is(name, pb_mcap_compression_name((pb_mcap_compression)kind)))
    kind++;
  return (pb_mcap_compression)kind;
}

pb_status pb_mcap_compress(pb_mcap_compression kind, pb_view data, pb_bytes *out, pb_error *err) {
  const bool lz4 = kind == PB_MCAP_LZ4;
  const size_t bound =
      lz4 ? LZ4F_compressFrameBound(data.size, NULL) : ZSTD_compressBound(data.size);
  uint8_t *at = pb_bytes_grow(out, bound);
  if (!at) return pb_fail_memory(err, "chunk");
  const size_t size = lz4 ? LZ4F_compressFrame(at, bound, data.p, data.size, NULL)
                          : ZSTD_compress(at, bound, data.p, data.size, zstd_level);
  out->size -= bound;
  if (lz4 ? LZ4F_isError(size) : ZSTD_isError(size)) return pb_fail_memory(err, "chunk");
  out->size += size;
  return PB_OK;
}

// A decompressor: takes from *data, fills up to *room octets at `at`; sets *room to what it filled
// and *ended at the end of the frame. False: damaged.
typedef struct expander {
  LZ4F_dctx *lz4;
  ZSTD_DStream *zstd;
} expander;

static bool expand_some(expander *x, pb_view *data, uint8_t *at, size_t *room, bool *ended) {
  if (x->lz4) {
    size_t taken = data->size;
    const size_t left = LZ4F_decompress(x->lz4, at, room, data->p, &taken, NULL);
    data->p += taken;
    data->size -= taken;
    *ended = left == 0;
    return !LZ4F_isError(left);
  }
  ZSTD_inBuffer in = {data->p, data->size, 0};
  ZSTD_outBuffer out = {at, *room, 0};
  const size_t left = ZSTD_decompressStream(x->zstd, &out, &in);
  data->p += in.pos;
  data->size -= in.pos;
  *room = out.pos;
  *ended = left == 0;
  return !ZSTD_isError(left);
}

static pb_status expand(expander *x, pb_view data, size_t most, pb_bytes *out, bool *whole,
                        pb_error *err) {
  const size_t begin = out->size;
  while (!*whole) {
    const size_t before = data.size;
    size_t room = most - (out->size - begin) + 1;  // one more than there may be: to see it
    if (room > STEP) room = STEP;
    uint8_t *at = pb_bytes_grow(out, room);
    if (!at) return pb_fail_memory(err, "chunk");
    out->size -= room;
    const bool good = expand_some(x, &data, at, &room, whole);
    if (good) out->size += room;
    if (out->size - begin > most) out->size = begin + most, *whole = false;
    if (!good || out->size - begin >= most || (data.size == before && room == 0)) break;
  }
  return PB_OK;
}

pb_status pb_mcap_expand(pb_mcap_compression kind, pb_view data, size_t most, pb_bytes *out,
                         bool *whole, pb_error *err) {
  expander x = {NULL, NULL};
  *whole = false;
  if (kind == PB_MCAP_LZ4) LZ4F_createDecompressionContext(&x.lz4, LZ4F_VERSION);
  if (kind == PB_MCAP_ZSTD) x.zstd = ZSTD_createDStream();
  pb_status status =
      x.lz4 || x.zstd ? expand(&x, data, most, out, whole, err) : pb_fail_memory(err, "chunk");
  LZ4F_freeDecompressionContext(x.lz4);
  ZSTD_freeDStream(x.zstd);
  return status;
}
