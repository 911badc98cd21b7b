// See mcap_writer.h.
#include "mcap_writer.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "mcap_writer_internal.h"

// ---- records ------------------------------------------------------------------------------------

size_t pb_mcap_record_begin(pb_bytes *b, pb_mcap_opcode opcode) {
  pb_bytes_u8(b, (uint8_t)opcode);
  pb_bytes_u64(b, 0);
  return b->size;
}

void pb_mcap_record_end(pb_bytes *b, size_t begin) {
  pb_bytes_set_u64(b, begin - 8, b->size - begin);
}

static void put_pairs(pb_bytes *b, const pb_mcap_pair *pairs, size_t count) {
  pb_bytes_u32(b, 0);
  const size_t begin = b->size;
  for (size_t i = 0; i < count; i++) {
    pb_bytes_text(b, pairs[i].key);
    pb_bytes_text(b, pairs[i].value);
  }
  pb_bytes_set_u32(b, begin - 4, (uint32_t)(b->size - begin));
}

pb_status pb_mcap_put(pb_mcap_writer *w, const void *data, size_t size, pb_error *err) {
  if (fwrite(data, 1, size, w->stream) != size)
    return pb_fail(err, PB_ERR_IO, w->path, "cannot be written: %s", strerror(errno));
  w->crc = pb_crc32(w->crc, data, size);
  w->offset += size;
  return PB_OK;
}

// What has been put together in w->record.
static pb_status put_record(pb_mcap_writer *w, pb_error *err) {
  const pb_status status = w->record.failed ? pb_fail_memory(err, w->path)
                                            : pb_mcap_put(w, w->record.p, w->record.size, err);
  w->record.size = 0;
  return status;
}

// ---- begin --------------------------------------------------------------------------------------

pb_status pb_mcap_writer_create(const char *path, const pb_mcap_writer_options *options,
                                pb_mcap_writer **out, pb_error *err) {
  *out = NULL;
  pb_mcap_writer *w = calloc(1, sizeof *w);
  if (!w || !(w->path = strdup(path))) {
    free(w);
    return pb_fail_memory(err, path);
  }
  w->compression = options->compression;
  w->stream = fopen(path, options->exclusive ? "wbx" : "wb");
  pb_status status = PB_OK;
  if (!w->stream) status = pb_fail(err, PB_ERR_IO, path, "cannot be created: %s", strerror(errno));
  if (!status) {
    pb_bytes_raw(&w->record, PB_MCAP_MAGIC, PB_MCAP_MAGIC_SIZE);
    const size_t begin = pb_mcap_record_begin(&w->record, PB_MCAP_HEADER);
    pb_bytes_text(&w->record, options->profile ? options->profile : "");
    pb_bytes_text(&w->record, options->library ? options->library : "");
    pb_mcap_record_end(&w->record, begin);
    status = put_record(w, err);
  }
  if (status) {
    pb_mcap_writer_discard(w);
    return status;
  }
  *out = w;
  return PB_OK;
}

void pb_mcap_writer_discard(pb_mcap_writer *w) {
  if (!w) return;
  if (w->stream) fclose(w->stream);
  for (int i = 0; i < PB_MCAP_GROUPS; i++) pb_bytes_free(&w->group[i]);
  for (int i = 0; i < PB_MCAP_CHANNELS; i++) pb_bytes_free(&w->channel[i].index);
  pb_bytes_free(&w->chunk);
  pb_bytes_free(&w->packed);
  pb_bytes_free(&w->record);
  free(w->path);
  free(w);
}

// ---- schemas and channels: in the chunk that first needs them, and again in the summary ---------

static pb_status define(pb_mcap_writer *w, pb_mcap_group group, size_t begin, pb_error *err) {
  pb_mcap_record_end(&w->record, begin);
  if (!w->record.failed) {
    pb_bytes_raw(&w->chunk, w->record.p, w->record.size);
    pb_bytes_raw(&w->group[group], w->record.p, w->record.size);
  }
  const bool failed = w->record.failed || w->chunk.failed || w->group[group].failed;
  w->record.size = 0;
  return failed ? pb_fail_memory(err, w->path) : PB_OK;
}

pb_status pb_mcap_writer_schema(pb_mcap_writer *w, const char *name, const char *encoding,
                                const char *text, uint16_t *id, pb_error *err) {
  if (w->schemas == PB_MCAP_CHANNELS)
    return pb_fail(err, PB_ERR_ARGUMENT, name, "more than %d schemas", PB_MCAP_CHANNELS);
  const size_t begin = pb_mcap_record_begin(&w->record, PB_MCAP_SCHEMA);
  *id = ++w->schemas;
  pb_bytes_u16(&w->record, *id);
  pb_bytes_text(&w->record, name);
  pb_bytes_text(&w->record, encoding);
  pb_bytes_text(&w->record, text);
  return define(w, PB_MCAP_GROUP_SCHEMA, begin, err);
}

pb_status pb_mcap_writer_channel(pb_mcap_writer *w, uint16_t schema, const char *topic,
                                 const char *encoding, const pb_mcap_pair *metadata, size_t count,
                                 uint16_t *id, pb_error *err) {
  if (w->channels == PB_MCAP_CHANNELS)
    return pb_fail(err, PB_ERR_ARGUMENT, topic, "more than %d channels", PB_MCAP_CHANNELS);
  const size_t begin = pb_mcap_record_begin(&w->record, PB_MCAP_CHANNEL);
  *id = ++w->channels;
  pb_bytes_u16(&w->record, *id);
  pb_bytes_u16(&w->record, schema);
  pb_bytes_text(&w->record, topic);
  pb_bytes_text(&w->record, encoding);
  put_pairs(&w->record, metadata, count);
  return define(w, PB_MCAP_GROUP_CHANNEL, begin, err);
}

// ---- messages and chunks ------------------------------------------------------------------------

static void stretch(uint64_t *first, uint64_t *last, bool begun, uint64_t time) {
  if (!begun || time < *first) *first = time;
  if (!begun || time > *last) *last = time;
}

uint8_t *pb_mcap_writer_message(pb_mcap_writer *w, uint16_t channel, pb_mcap_stamp stamp,
                                size_t size, pb_error *err) {
  if (channel < 1 || channel > w->channels) {
    pb_fail(err, PB_ERR_ARGUMENT, w->path, "has no channel %u", channel);
    return NULL;
  }
  if (w->chunk.size >= PB_MCAP_CHUNK_BYTES && pb_mcap_chunk_end(w, err)) return NULL;
  struct pb_mcap_channel *c = &w->channel[channel - 1];
  pb_bytes_u64(&c->index, stamp.log_time);
  pb_bytes_u64(&c->index, w->chunk.size);
  pb_bytes_u8(&w->chunk, PB_MCAP_MESSAGE);
  pb_bytes_u64(&w->chunk, 2 + 4 + 8 + 8 + (uint64_t)size);
  pb_bytes_u16(&w->chunk, channel);
  pb_bytes_u32(&w->chunk, stamp.sequence);
  pb_bytes_u64(&w->chunk, stamp.log_time);
  pb_bytes_u64(&w->chunk, stamp.publish_time);
  uint8_t *at = pb_bytes_grow(&w->chunk, size);
  if (!at || c->index.failed) {
    pb_fail_memory(err, w->path);
    return NULL;
  }
  stretch(&w->chunk_first, &w->chunk_last, w->chunk_messages > 0, stamp.log_time);
  stretch(&w->first, &w->last, w->messages > 0, stamp.log_time);
  w->chunk_messages++;
  w->messages++;
  c->messages++;
  return at;
}

pb_status pb_mcap_writer_flush(pb_mcap_writer *w, pb_error *err) {
  const pb_status status = pb_mcap_chunk_end(w, err);
  if (!status && fflush(w->stream))
    return pb_fail(err, PB_ERR_IO, w->path, "cannot be written: %s", strerror(errno));
  return status;
}

pb_status pb_mcap_writer_sync(pb_mcap_writer *w, pb_error *err) {
  const pb_status status = pb_mcap_writer_flush(w, err);
  // A pipe or a device has no disk to wait for.
  if (!status && fsync(fileno(w->stream)) != 0 && errno != EINVAL && errno != EROFS)
    return pb_fail(err, PB_ERR_IO, w->path, "cannot be brought to the disk: %s", strerror(errno));
  return status;
}

uint64_t pb_mcap_writer_bytes(const pb_mcap_writer *w) {
  return w->offset + w->chunk.size;
}

// ---- attachments and metadata -------------------------------------------------------------------

pb_status pb_mcap_writer_attach(pb_mcap_writer *w, const char *name, const char *media_type,
                                uint64_t log_time, const void *data, size_t size, pb_error *err) {
  pb_status status = pb_mcap_chunk_end(w, err);
  if (status) return status;
  const size_t begin = pb_mcap_record_begin(&w->record, PB_MCAP_ATTACHMENT);
  pb_bytes_u64(&w->record, log_time);
  pb_bytes_u64(&w->record, 0);
  pb_bytes_text(&w->record, name);
  pb_bytes_text(&w->record, media_type);
  pb_bytes_u64(&w->record, size);
  pb_bytes_raw(&w->record, data, size);
  if (w->record.failed) return pb_fail_memory(err, name);
  pb_bytes_u32(&w->record, pb_crc32(0, w->record.p + begin, w->record.size - begin));
  pb_mcap_record_end(&w->record, begin);
  pb_bytes *index = &w->group[PB_MCAP_GROUP_ATTACHMENT];
  const size_t at = pb_mcap_record_begin(index, PB_MCAP_ATTACHMENT_INDEX);
  pb_bytes_u64(index, w->offset);
  pb_bytes_u64(index, w->record.size);
  pb_bytes_u64(index, log_time);
  pb_bytes_u64(index, 0);
  pb_bytes_u64(index, size);
  pb_bytes_text(index, name);
  pb_bytes_text(index, media_type);
  pb_mcap_record_end(index, at);
  w->attachments++;
  return put_record(w, err);
}

pb_status pb_mcap_writer_metadata(pb_mcap_writer *w, const char *name, const pb_mcap_pair *pairs,
                                  size_t count, pb_error *err) {
  pb_status status = pb_mcap_chunk_end(w, err);
  if (status) return status;
  const size_t begin = pb_mcap_record_begin(&w->record, PB_MCAP_METADATA);
  pb_bytes_text(&w->record, name);
  put_pairs(&w->record, pairs, count);
  pb_mcap_record_end(&w->record, begin);
  pb_bytes *index = &w->group[PB_MCAP_GROUP_METADATA];
  const size_t at = pb_mcap_record_begin(index, PB_MCAP_METADATA_INDEX);
  pb_bytes_u64(index, w->offset);
  pb_bytes_u64(index, w->record.size);
  pb_bytes_text(index, name);
  pb_mcap_record_end(index, at);
  w->metadata++;
  return put_record(w, err);
}
