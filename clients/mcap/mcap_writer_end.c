// The end of a chunk and of the file. See mcap_writer.h.
#include <errno.h>
#include <string.h>

#include "mcap_writer_internal.h"

// ---- chunk --------------------------------------------------------------------------------------

static pb_status chunk_put(pb_mcap_writer *w, pb_error *err) {
  pb_bytes *b = &w->record;
  pb_view records = {w->chunk.p, w->chunk.size};
  if (w->compression != PB_MCAP_NONE) {
    w->packed.size = 0;
    const pb_status status = pb_mcap_compress(w->compression, records, &w->packed, err);
    if (status) return status;
    records = (pb_view){w->packed.p, w->packed.size};
  }
  w->packed_size = records.size;
  const size_t begin = pb_mcap_record_begin(b, PB_MCAP_CHUNK);
  pb_bytes_u64(b, w->chunk_first);
  pb_bytes_u64(b, w->chunk_last);
  pb_bytes_u64(b, w->chunk.size);
  pb_bytes_u32(b, pb_crc32(0, w->chunk.p, w->chunk.size));
  pb_bytes_text(b, pb_mcap_compression_name(w->compression));
  pb_bytes_u64(b, records.size);
  // The records follow from their own buffer.
  pb_bytes_set_u64(b, begin - 8, b->size - begin + records.size);
  if (b->failed) return pb_fail_memory(err, w->path);
  pb_status status = pb_mcap_put(w, b->p, b->size, err);
  b->size = 0;
  return status ? status : pb_mcap_put(w, records.p, records.size, err);
}

// Message Index records; where each begins goes into the chunk's index.
static pb_status indexes_put(pb_mcap_writer *w, pb_bytes *index, pb_error *err) {
  pb_bytes *b = &w->record;
  for (uint16_t i = 0; i < w->channels; i++) {
    pb_bytes *rows = &w->channel[i].index;
    if (rows->size == 0) continue;
    pb_bytes_u16(index, (uint16_t)(i + 1));
    pb_bytes_u64(index, w->offset + b->size);
    const size_t begin = pb_mcap_record_begin(b, PB_MCAP_MESSAGE_INDEX);
    pb_bytes_u16(b, (uint16_t)(i + 1));
    pb_bytes_u32(b, (uint32_t)rows->size);
    pb_bytes_raw(b, rows->p, rows->size);
    pb_mcap_record_end(b, begin);
    rows->size = 0;
  }
  if (b->failed) return pb_fail_memory(err, w->path);
  const pb_status status = pb_mcap_put(w, b->p, b->size, err);
  b->size = 0;
  return status;
}

pb_status pb_mcap_chunk_end(pb_mcap_writer *w, pb_error *err) {
  if (w->chunk.failed) return pb_fail_memory(err, w->path);
  if (w->chunk.size == 0) return PB_OK;
  pb_bytes *index = &w->group[PB_MCAP_GROUP_CHUNK];
  const uint64_t start = w->offset;
  pb_status status = chunk_put(w, err);
  if (status) return status;
  const uint64_t after = w->offset;
  const size_t begin = pb_mcap_record_begin(index, PB_MCAP_CHUNK_INDEX);
  pb_bytes_u64(index, w->chunk_first);
  pb_bytes_u64(index, w->chunk_last);
  pb_bytes_u64(index, start);
  pb_bytes_u64(index, after - start);
  pb_bytes_u32(index, 0);
  const size_t map = index->size;
  status = indexes_put(w, index, err);
  pb_bytes_set_u32(index, map - 4, (uint32_t)(index->size - map));
  pb_bytes_u64(index, w->offset - after);
  pb_bytes_text(index, pb_mcap_compression_name(w->compression));
  pb_bytes_u64(index, w->packed_size);
  pb_bytes_u64(index, w->chunk.size);
  pb_mcap_record_end(index, begin);
  w->chunk.size = 0;
  w->chunk_messages = w->chunk_first = w->chunk_last = 0;
  w->chunks++;
  return status;
}

// ---- file ---------------------------------------------------------------------------------------

static void statistics_make(pb_mcap_writer *w) {
  pb_bytes *b = &w->group[PB_MCAP_GROUP_STATISTICS];
  const size_t begin = pb_mcap_record_begin(b, PB_MCAP_STATISTICS);
  pb_bytes_u64(b, w->messages);
  pb_bytes_u16(b, w->schemas);
  pb_bytes_u32(b, w->channels);
  pb_bytes_u32(b, w->attachments);
  pb_bytes_u32(b, w->metadata);
  pb_bytes_u32(b, w->chunks);
  pb_bytes_u64(b, w->first);
  pb_bytes_u64(b, w->last);
  pb_bytes_u32(b, 10u * w->channels);
  for (uint16_t i = 0; i < w->channels; i++) {
    pb_bytes_u16(b, (uint16_t)(i + 1));
    pb_bytes_u64(b, w->channel[i].messages);
  }
  pb_mcap_record_end(b, begin);
}

// The groups one after the other, and where each is. *offsets: where these are told.
static void summary_make(pb_mcap_writer *w, pb_bytes *b, uint64_t *offsets) {
  uint64_t start[PB_MCAP_GROUPS];
  for (int i = 0; i < PB_MCAP_GROUPS; i++) {
    start[i] = w->offset + b->size;
    if (w->group[i].failed) b->failed = true;
    pb_bytes_raw(b, w->group[i].p, w->group[i].size);
  }
  *offsets = w->offset + b->size;
  for (int i = 0; i < PB_MCAP_GROUPS; i++) {
    if (w->group[i].size == 0) continue;
    const size_t begin = pb_mcap_record_begin(b, PB_MCAP_SUMMARY_OFFSET);
    pb_bytes_u8(b, w->group[i].p ? w->group[i].p[0] : 0);
    pb_bytes_u64(b, start[i]);
    pb_bytes_u64(b, w->group[i].size);
    pb_mcap_record_end(b, begin);
  }
}

static pb_status end_put(pb_mcap_writer *w, pb_error *err) {
  pb_bytes *b = &w->record;
  size_t begin = pb_mcap_record_begin(b, PB_MCAP_DATA_END);
  pb_bytes_u32(b, w->crc);
  pb_mcap_record_end(b, begin);
  if (b->failed) return pb_fail_memory(err, w->path);
  pb_status status = pb_mcap_put(w, b->p, b->size, err);
  b->size = 0;
  if (status) return status;
  uint64_t offsets;
  statistics_make(w);
  summary_make(w, b, &offsets);
  begin = pb_mcap_record_begin(b, PB_MCAP_FOOTER);
  pb_bytes_u64(b, w->offset);
  pb_bytes_u64(b, offsets);
  if (b->failed) return pb_fail_memory(err, w->path);
  pb_bytes_set_u64(b, begin - 8, PB_MCAP_FOOTER_SIZE);
  pb_bytes_u32(b, pb_crc32(0, b->p, b->size));
  pb_bytes_raw(b, PB_MCAP_MAGIC, PB_MCAP_MAGIC_SIZE);
  return b->failed ? pb_fail_memory(err, w->path) : pb_mcap_put(w, b->p, b->size, err);
}

pb_status pb_mcap_writer_close(pb_mcap_writer *w, pb_error *err) {
  pb_status status = pb_mcap_chunk_end(w, err);
  if (!status) status = end_put(w, err);
  const int closed = fclose(w->stream);
  w->stream = NULL;
  if (!status && closed)
    status = pb_fail(err, PB_ERR_IO, w->path, "cannot be written: %s", strerror(errno));
  pb_mcap_writer_discard(w);
  return status;
}
