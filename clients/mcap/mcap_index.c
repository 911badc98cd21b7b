// Finding one's way by the summary of a file. See mcap_reader.h.
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "mcap_compress.h"
#include "mcap_reader.h"

enum { CHANNELS = 64 };
static const uint64_t most = 1u << 30;  // octets of a record that is read as a whole

typedef struct indexed {
  const char *path;
  const pb_mcap_visitor *visitor;
  pb_mcap_summary *out;
  FILE *stream;
  uint64_t size;  // of the file
  bool lost;      // something is not there, or not as it should be
  bool known[CHANNELS + 1], wanted[CHANNELS + 1];
  char topic[CHANNELS + 1][128];
  bool counted;
  pb_bytes summary_bytes, record, chunk;
} indexed;

// `size` octets at `at`; *out is the reader's buffer.
static pb_status fetch(indexed *x, uint64_t at, uint64_t size, pb_bytes *buffer, pb_view *out,
                       pb_error *err) {
  *out = (pb_view){NULL, 0};
  buffer->size = 0;
  if (size > most || at > x->size || size > x->size - at) {
    x->lost = true;
    return PB_OK;
  }
  uint8_t *p = pb_bytes_grow(buffer, (size_t)size);
  if (!p) return pb_fail_memory(err, x->path);
  if (fseeko(x->stream, (off_t)at, SEEK_SET) != 0 || fread(p, 1, (size_t)size, x->stream) != size)
    return pb_fail(err, PB_ERR_IO, x->path, "cannot be read: %s", strerror(errno));
  *out = (pb_view){p, (size_t)size};
  return PB_OK;
}

// The record at `at`, of `size` octets with its head, must have this opcode.
static pb_status fetch_record(indexed *x, uint64_t at, uint64_t size, uint8_t opcode,
                              pb_cursor *out, pb_error *err) {
  pb_view bytes;
  const pb_status status = fetch(x, at, size, &x->record, &bytes, err);
  *out = (pb_cursor){bytes.p, bytes.size, false};
  if (status || x->lost) return status;
  const uint8_t found = pb_cursor_u8(out);
  const uint64_t length = pb_cursor_u64(out);
  x->lost = out->bad || found != opcode || length != out->left;
  return PB_OK;
}

// ---- what the summary holds ---------------------------------------------------------------------

static void channel_note(indexed *x, pb_cursor c, const char *topic) {
  const uint16_t id = pb_cursor_u16(&c);
  pb_cursor_u16(&c);
  const pb_view name = pb_cursor_text(&c);
  if (c.bad || id < 1 || id > CHANNELS || name.size >= sizeof x->topic[0]) {
    x->lost = true;
    return;
  }
  x->known[id] = true;
  x->wanted[id] = topic && pb_view_is(name, topic);
  memcpy(x->topic[id], name.p, name.size);
  x->topic[id][name.size] = 0;
}

static void statistics_note(indexed *x, pb_cursor c) {
  pb_cursor_u64(&c);
  pb_cursor_u16(&c);
  for (int i = 0; i < 4; i++) pb_cursor_u32(&c);
  x->out->first = pb_cursor_u64(&c);
  x->out->last = pb_cursor_u64(&c);
  const pb_view map = pb_cursor_text(&c);
  pb_cursor rows = {map.p, map.size, c.bad};
  while (rows.left > 0 && !rows.bad && x->out->channels < CHANNELS) {
    const uint16_t id = pb_cursor_u16(&rows);
    const uint64_t count = pb_cursor_u64(&rows);
    if (id < 1 || id > CHANNELS || !x->known[id]) {
      x->lost = true;
      return;
    }
    pb_mcap_count *row = &x->out->channel[x->out->channels++];
    memcpy(row->topic, x->topic[id], sizeof row->topic);
    row->messages = count;
  }
  x->counted = !rows.bad;
}

static pb_status metadata_call(indexed *x, pb_cursor c, pb_error *err) {
  const uint64_t at = pb_cursor_u64(&c), size = pb_cursor_u64(&c);
  pb_cursor record;
  if (c.bad) x->lost = true;
  if (x->lost || !x->visitor->metadata) return PB_OK;
  const pb_status status = fetch_record(x, at, size, PB_MCAP_METADATA, &record, err);
  if (status || x->lost) return status;
  pb_mcap_metadata m = {.name = pb_cursor_text(&record)};
  m.pairs = pb_cursor_text(&record);
  if (record.bad) x->lost = true;
  return x->lost ? PB_OK : x->visitor->metadata(x->visitor->context, &m, err);
}

static pb_status attachment_call(indexed *x, pb_cursor c, pb_error *err) {
  const uint64_t at = pb_cursor_u64(&c), size = pb_cursor_u64(&c);
  pb_cursor record;
  if (c.bad) x->lost = true;
  if (x->lost || !x->visitor->attachment) return PB_OK;
  const pb_status status = fetch_record(x, at, size, PB_MCAP_ATTACHMENT, &record, err);
  if (status || x->lost) return status;
  pb_mcap_attachment a = {.log_time = pb_cursor_u64(&record)};
  pb_cursor_u64(&record);
  a.name = pb_cursor_text(&record);
  a.media_type = pb_cursor_text(&record);
  a.data = pb_cursor_take(&record, pb_cursor_u64(&record));
  if (record.bad) x->lost = true;
  return x->lost ? PB_OK : x->visitor->attachment(x->visitor->context, &a, err);
}

// ---- messages of one topic ----------------------------------------------------------------------

static bool chunk_has_wanted(const indexed *x, pb_view map) {
  pb_cursor rows = {map.p, map.size, false};
  while (rows.left > 0 && !rows.bad) {
    const uint16_t id = pb_cursor_u16(&rows);
    pb_cursor_u64(&rows);
    if (!rows.bad && id <= CHANNELS && x->wanted[id]) return true;
  }
  return false;
}

static pb_status messages_call(indexed *x, pb_view records, pb_error *err) {
  pb_cursor c = {records.p, records.size, false};
  while (c.left > 0 && !c.bad) {
    const uint8_t opcode = pb_cursor_u8(&c);
    const pb_view content = pb_cursor_take(&c, pb_cursor_u64(&c));
    pb_cursor m = {content.p, content.size, c.bad};
    if (c.bad || opcode != PB_MCAP_MESSAGE) continue;
    pb_mcap_message out = {.channel = pb_cursor_u16(&m)};
    out.sequence = pb_cursor_u32(&m);
    out.log_time = pb_cursor_u64(&m);
    out.publish_time = pb_cursor_u64(&m);
    out.data = pb_cursor_take(&m, m.left);
    if (m.bad || out.channel > CHANNELS || !x->wanted[out.channel]) continue;
    const pb_status status = x->visitor->message(x->visitor->context, &out, err);
    if (status) return status;
  }
  x->lost = x->lost || c.bad;
  return PB_OK;
}

static pb_status chunk_call(indexed *x, pb_cursor c, pb_error *err) {
  pb_cursor_u64(&c);
  pb_cursor_u64(&c);
  const uint64_t at = pb_cursor_u64(&c), size = pb_cursor_u64(&c);
  const pb_view map = pb_cursor_text(&c);
  pb_cursor record;
  if (c.bad) x->lost = true;
  if (x->lost || !x->visitor->message || !chunk_has_wanted(x, map)) return PB_OK;
  pb_status status = fetch_record(x, at, size, PB_MCAP_CHUNK, &record, err);
  if (status || x->lost) return status;
  pb_cursor_u64(&record);
  pb_cursor_u64(&record);
  const uint64_t length = pb_cursor_u64(&record);
  pb_cursor_u32(&record);
  const pb_mcap_compression kind = pb_mcap_compression_of(pb_cursor_text(&record));
  pb_view records = pb_cursor_take(&record, pb_cursor_u64(&record));
  x->lost = record.bad || kind == PB_MCAP_COMPRESSIONS || length > most;
  if (!x->lost && kind != PB_MCAP_NONE) {
    bool whole;
    x->chunk.size = 0;
    status = pb_mcap_expand(kind, records, (size_t)length, &x->chunk, &whole, err);
    records = (pb_view){x->chunk.p, x->chunk.size};
    x->lost = !whole;
  }
  return status || x->lost ? status : messages_call(x, records, err);
}

// ---- the whole ----------------------------------------------------------------------------------

// What others refer to comes first: channels, then metadata.
static int round_of(uint8_t opcode) {
  return opcode == PB_MCAP_CHANNEL ? 0 : opcode == PB_MCAP_ATTACHMENT_INDEX ? 2 : 1;
}

static pb_status round_read(indexed *x, int round, const char *topic, pb_error *err) {
  pb_cursor c = {x->summary_bytes.p, x->summary_bytes.size, false};
  pb_status status = PB_OK;
  while (c.left > 0 && !status && !x->lost) {
    const uint8_t opcode = pb_cursor_u8(&c);
    const pb_view content = pb_cursor_take(&c, pb_cursor_u64(&c));
    const pb_cursor record = {content.p, content.size, false};
    if (c.bad) x->lost = true;
    if (c.bad || round != round_of(opcode)) continue;
    if (opcode == PB_MCAP_CHANNEL) channel_note(x, record, topic);
    if (opcode == PB_MCAP_STATISTICS) statistics_note(x, record);
    if (opcode == PB_MCAP_METADATA_INDEX) status = metadata_call(x, record, err);
    if (opcode == PB_MCAP_ATTACHMENT_INDEX) status = attachment_call(x, record, err);
    if (opcode == PB_MCAP_CHUNK_INDEX) status = chunk_call(x, record, err);
  }
  return status;
}

static pb_status summary_fetch(indexed *x, pb_error *err) {
  enum { TAIL = PB_MCAP_HEAD_SIZE + PB_MCAP_FOOTER_SIZE + PB_MCAP_MAGIC_SIZE };
  pb_view bytes;
  if (fseeko(x->stream, 0, SEEK_END) != 0 || ftello(x->stream) < TAIL + PB_MCAP_MAGIC_SIZE) {
    x->lost = true;
    return PB_OK;
  }
  x->size = x->out->bytes = (uint64_t)ftello(x->stream);
  pb_status status = fetch(x, x->size - TAIL, TAIL, &x->record, &bytes, err);
  if (status) return status;
  pb_cursor c = {bytes.p, bytes.size, false};
  const uint8_t opcode = pb_cursor_u8(&c);
  pb_cursor_u64(&c);
  const uint64_t begin = pb_cursor_u64(&c);
  pb_cursor_u64(&c);
  const uint32_t crc = pb_cursor_u32(&c);
  const bool ended = memcmp(c.p, PB_MCAP_MAGIC, PB_MCAP_MAGIC_SIZE) == 0;
  x->lost = !ended || opcode != PB_MCAP_FOOTER || begin == 0 || begin > x->size - TAIL;
  if (x->lost) return PB_OK;
  // The CRC covers the summary and the footer up to itself.
  const uint64_t covered = x->size - TAIL + PB_MCAP_HEAD_SIZE + PB_MCAP_FOOTER_SIZE - 4 - begin;
  status = fetch(x, begin, covered, &x->summary_bytes, &bytes, err);
  if (status || x->lost) return status;
  x->lost = crc != 0 && crc != pb_crc32(0, bytes.p, bytes.size);
  x->summary_bytes.size -= PB_MCAP_HEAD_SIZE + PB_MCAP_FOOTER_SIZE - 4;
  return PB_OK;
}

pb_status pb_mcap_read_index(const char *path, const pb_mcap_visitor *visitor, const char *topic,
                             pb_mcap_summary *summary, bool *found, pb_error *err) {
  *summary = (pb_mcap_summary){0};
  *found = false;
  indexed *x = calloc(1, sizeof *x);
  if (!x) return pb_fail_memory(err, path);
  x->path = path;
  x->visitor = visitor;
  x->out = summary;
  x->stream = fopen(path, "rb");
  pb_status status = PB_OK;
  if (!x->stream) status = pb_fail(err, PB_ERR_IO, path, "cannot be read: %s", strerror(errno));
  if (!status) status = summary_fetch(x, err);
  for (int round = 0; round < 3 && !status && !x->lost; round++)
    status = round_read(x, round, topic, err);
  *found = !status && !x->lost && x->counted;
  if (x->stream) fclose(x->stream);
  pb_bytes_free(&x->summary_bytes);
  pb_bytes_free(&x->record);
  pb_bytes_free(&x->chunk);
  free(x);
  return status;
}
