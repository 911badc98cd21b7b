// See mcap_reader.h.
#include "mcap_reader.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "mcap_compress.h"

typedef struct reader {
  const char *path;
  const pb_mcap_visitor *visitor;
  pb_mcap_report *report;
  FILE *stream;
  uint64_t size, at;  // of the file; of the record that is read
  uint32_t crc;       // of the data section or of the summary, before this record
  bool begun;         // the header was read
  bool ended;         // the end of the file's proper form is there: what is cut short is damaged
  uint64_t summary;   // where it begins; 0: still in the data section
  bool done;
  bool is_damaged;  // why a record could not be read
  uint8_t head[PB_MCAP_HEAD_SIZE];
  pb_bytes content;
  pb_bytes records;  // of a compressed chunk
} reader;

static pb_status damaged(reader *r, const char *what, pb_error *err) {
  r->is_damaged = true;
  return pb_fail(err, PB_ERR_SYNTAX, r->path, "is damaged: %s (record at byte %llu)", what,
                 (unsigned long long)r->at);
}

bool pb_mcap_pair_next(pb_cursor *pairs, pb_view *key, pb_view *value) {
  if (pairs->bad || pairs->left == 0) return false;
  *key = pb_cursor_text(pairs);
  *value = pb_cursor_text(pairs);
  return !pairs->bad;
}

// ---- what records hold --------------------------------------------------------------------------

static pb_status schema_read(reader *r, pb_cursor c, pb_error *err) {
  pb_mcap_schema out = {.id = pb_cursor_u16(&c)};
  out.name = pb_cursor_text(&c);
  out.encoding = pb_cursor_text(&c);
  out.data = pb_cursor_text(&c);
  if (c.bad) return damaged(r, "a schema", err);
  return r->visitor->schema ? r->visitor->schema(r->visitor->context, &out, err) : PB_OK;
}

static pb_status channel_read(reader *r, pb_cursor c, pb_error *err) {
  pb_mcap_channel_record out = {.id = pb_cursor_u16(&c)};
  out.schema = pb_cursor_u16(&c);
  out.topic = pb_cursor_text(&c);
  out.encoding = pb_cursor_text(&c);
  out.metadata = pb_cursor_text(&c);
  if (c.bad) return damaged(r, "a channel", err);
  return r->visitor->channel ? r->visitor->channel(r->visitor->context, &out, err) : PB_OK;
}

static pb_status message_read(reader *r, pb_cursor c, pb_error *err) {
  pb_mcap_message out = {.channel = pb_cursor_u16(&c)};
  out.sequence = pb_cursor_u32(&c);
  out.log_time = pb_cursor_u64(&c);
  out.publish_time = pb_cursor_u64(&c);
  out.data = pb_cursor_take(&c, c.left);
  if (c.bad) return damaged(r, "a message", err);
  r->report->messages++;
  return r->visitor->message ? r->visitor->message(r->visitor->context, &out, err) : PB_OK;
}

static pb_status attachment_read(reader *r, pb_cursor c, pb_error *err) {
  const uint8_t *begin = c.p;
  pb_mcap_attachment out = {.log_time = pb_cursor_u64(&c)};
  pb_cursor_u64(&c);
  out.name = pb_cursor_text(&c);
  out.media_type = pb_cursor_text(&c);
  out.data = pb_cursor_take(&c, pb_cursor_u64(&c));
  const size_t covered = (size_t)(c.p - begin);
  const uint32_t crc = pb_cursor_u32(&c);
  if (c.bad) return damaged(r, "an attachment", err);
  if (crc != 0 && crc != pb_crc32(0, begin, covered))
    return damaged(r, "the CRC of an attachment does not match", err);
  return r->visitor->attachment ? r->visitor->attachment(r->visitor->context, &out, err) : PB_OK;
}

static pb_status metadata_read(reader *r, pb_cursor c, pb_error *err) {
  pb_mcap_metadata out = {.name = pb_cursor_text(&c)};
  out.pairs = pb_cursor_text(&c);
  if (c.bad) return damaged(r, "metadata", err);
  return r->visitor->metadata ? r->visitor->metadata(r->visitor->context, &out, err) : PB_OK;
}

// Schemas, channels and messages stand in chunks or by themselves.
static pb_status inner_read(reader *r, uint8_t opcode, pb_cursor c, pb_error *err) {
  switch (opcode) {
  case PB_MCAP_SCHEMA:
    return schema_read(r, c, err);
  case PB_MCAP_CHANNEL:
    return channel_read(r, c, err);
  case PB_MCAP_MESSAGE:
    return message_read(r, c, err);
  default:
    return PB_OK;  // of a later edition of the format
  }
}

// *records: compressed on entry. A size that no recorder makes is damage, not a reason to take
// memory.
static pb_status chunk_expand(reader *r, pb_view compression, uint64_t size, pb_view *records,
                              pb_error *err) {
  const pb_mcap_compression kind = pb_mcap_compression_of(compression);
  bool whole;
  if (kind == PB_MCAP_NONE) return PB_OK;
  if (kind == PB_MCAP_COMPRESSIONS)
    return pb_fail(err, PB_ERR_SYNTAX, r->path,
                   "has chunks compressed with '%.*s'; known are lz4 and zstd",
                   compression.size > 16 ? 16 : (int)compression.size, (const char *)compression.p);
  r->records.size = 0;
  pb_status status = pb_mcap_expand(
      kind, *records, size < SIZE_MAX / 2 ? (size_t)size : SIZE_MAX / 2, &r->records, &whole, err);
  *records = (pb_view){r->records.p, r->records.size};
  return status || whole ? status : damaged(r, "a compressed chunk", err);
}

// What a chunk holds. cut: it may break off within a record.
static pb_status records_hand_out(reader *r, pb_view records, bool cut, pb_error *err) {
  pb_cursor inner = {records.p, records.size, false};
  while (inner.left > 0) {
    const uint8_t opcode = pb_cursor_u8(&inner);
    const pb_view content = pb_cursor_take(&inner, pb_cursor_u64(&inner));
    if (inner.bad) return cut ? PB_OK : damaged(r, "a record in a chunk", err);
    const pb_status status =
        inner_read(r, opcode, (pb_cursor){content.p, content.size, false}, err);
    if (status) return status;
  }
  return PB_OK;
}

static pb_status chunk_read(reader *r, pb_cursor c, pb_error *err) {
  pb_cursor_u64(&c);
  pb_cursor_u64(&c);
  const uint64_t size = pb_cursor_u64(&c);
  const uint32_t crc = pb_cursor_u32(&c);
  const pb_view compression = pb_cursor_text(&c);
  pb_view records = pb_cursor_take(&c, pb_cursor_u64(&c));
  if (c.bad) return damaged(r, "a chunk", err);
  pb_status status = chunk_expand(r, compression, size, &records, err);
  if (status) return status;
  if (records.size != size || (crc != 0 && crc != pb_crc32(0, records.p, records.size)))
    return damaged(r, "the CRC of a chunk does not match", err);
  r->report->chunks++;
  return records_hand_out(r, records, false, err);
}

// A chunk that the end of the file cuts: `have` octets of it are there.
static pb_status chunk_salvage(reader *r, size_t have, pb_error *err) {
  pb_cursor c = {r->content.p, have, false};
  pb_cursor_u64(&c);
  pb_cursor_u64(&c);
  const uint64_t size = pb_cursor_u64(&c);
  pb_cursor_u32(&c);
  const pb_view compression = pb_cursor_text(&c);
  pb_cursor_u64(&c);
  if (c.bad) return PB_OK;
  pb_view records = {c.p, c.left};
  const pb_mcap_compression kind = pb_mcap_compression_of(compression);
  if (kind == PB_MCAP_COMPRESSIONS) return PB_OK;
  if (kind != PB_MCAP_NONE) {
    bool whole;
    r->records.size = 0;
    const pb_status status = pb_mcap_expand(
        kind, records, size < SIZE_MAX / 2 ? (size_t)size : SIZE_MAX / 2, &r->records, &whole, err);
    if (status) return status;
    records = (pb_view){r->records.p, r->records.size};
  }
  const uint64_t before = r->report->messages;
  const pb_status status = records_hand_out(r, records, true, err);
  r->report->salvaged += r->report->messages - before;
  return status;
}

// ---- the end ------------------------------------------------------------------------------------

static pb_status data_end_read(reader *r, pb_cursor c, pb_error *err) {
  const uint32_t crc = pb_cursor_u32(&c);
  if (c.bad || (crc != 0 && crc != r->crc))
    return damaged(r, "the CRC of the data section does not match", err);
  r->summary = r->at + PB_MCAP_HEAD_SIZE + r->content.size;
  return PB_OK;
}

static pb_status footer_read(reader *r, pb_cursor c, pb_error *err) {
  uint8_t magic[PB_MCAP_MAGIC_SIZE];
  const uint8_t *begin = c.p;
  const uint64_t summary = pb_cursor_u64(&c);
  pb_cursor_u64(&c);
  const uint32_t covered = pb_crc32(pb_crc32(r->crc, r->head, sizeof r->head), begin, 16);
  const uint32_t crc = pb_cursor_u32(&c);
  if (r->content.size != PB_MCAP_FOOTER_SIZE || r->summary == 0)
    return damaged(r, "the footer", err);
  if (summary != (r->at == r->summary ? 0 : r->summary) && summary != r->summary)
    return damaged(r, "the footer does not point at the summary", err);
  if (crc != 0 && crc != covered) return damaged(r, "the CRC of the summary does not match", err);
  r->done = true;
  if (fread(magic, 1, sizeof magic, r->stream) != sizeof magic) return PB_OK;
  if (memcmp(magic, PB_MCAP_MAGIC, sizeof magic) != 0 || fgetc(r->stream) != EOF)
    return damaged(r, "the end is not that of an MCAP file", err);
  r->report->complete = true;
  return PB_OK;
}

static pb_status record_read(reader *r, pb_error *err) {
  const pb_cursor c = {r->content.p, r->content.size, false};
  const uint8_t opcode = r->head[0];
  if (!r->begun && opcode != PB_MCAP_HEADER) return damaged(r, "it has no header", err);
  r->begun = true;
  if (opcode == PB_MCAP_FOOTER) return footer_read(r, c, err);
  if (r->summary > 0) return PB_OK;  // copies of what the data section has told, and indexes
  switch (opcode) {
  case PB_MCAP_CHUNK:
    return chunk_read(r, c, err);
  case PB_MCAP_ATTACHMENT:
    return attachment_read(r, c, err);
  case PB_MCAP_METADATA:
    return metadata_read(r, c, err);
  case PB_MCAP_DATA_END:
    return data_end_read(r, c, err);
  default:
    return inner_read(r, opcode, c, err);
  }
}

// ---- the file -----------------------------------------------------------------------------------

// *whole false: the file ends before the record does; *have octets of its content are there.
static pb_status record_fetch(reader *r, bool *whole, size_t *have, pb_error *err) {
  *whole = false;
  *have = 0;
  r->content.size = 0;
  if (r->size - r->at < sizeof r->head) return PB_OK;
  if (fread(r->head, 1, sizeof r->head, r->stream) != sizeof r->head)
    return pb_fail(err, PB_ERR_IO, r->path, "cannot be read");
  pb_cursor c = {r->head + 1, 8, false};
  const uint64_t size = pb_cursor_u64(&c), left = r->size - r->at - sizeof r->head;
  *whole = size <= left;
  if (!*whole && !r->visitor->salvage) return PB_OK;
  *have = (size_t)(*whole ? size : left);
  uint8_t *at = pb_bytes_grow(&r->content, *have);
  if (!at) return pb_fail_memory(err, r->path);
  if (fread(at, 1, *have, r->stream) != *have)
    return pb_fail(err, PB_ERR_IO, r->path, "cannot be read");
  return PB_OK;
}

// What cannot be read of it is left out, where that is wanted.
static pb_status record_salvage(reader *r, pb_status status) {
  if (!r->visitor->salvage || !r->is_damaged || status != PB_ERR_SYNTAX || !r->begun) return status;
  r->is_damaged = false;
  r->report->damaged++;
  return PB_OK;
}

static pb_status records_read(reader *r, pb_error *err) {
  while (!r->done) {
    bool whole;
    size_t have;
    pb_status status = record_fetch(r, &whole, &have, err);
    if (!status && !whole && r->begun && r->visitor->salvage)
      return r->head[0] == PB_MCAP_CHUNK && r->summary == 0 ? chunk_salvage(r, have, err) : PB_OK;
    if (!status && !whole && r->ended) status = damaged(r, "a record has the wrong length", err);
    if (!status && !whole && !r->begun) status = damaged(r, "it holds nothing", err);
    if (!status && !whole) return PB_OK;
    const bool end = r->head[0] == PB_MCAP_DATA_END && r->summary == 0;
    if (!status) status = record_salvage(r, record_read(r, err));
    if (status) return status;
    r->crc = pb_crc32(pb_crc32(end ? 0 : r->crc, r->head, end ? 0 : sizeof r->head), r->content.p,
                      end ? 0 : r->content.size);
    r->at += sizeof r->head + r->content.size;
    r->report->read_to = r->done && r->report->complete ? r->size : r->at;
  }
  return PB_OK;
}

// Both magics. A file of another kind is refused.
static pb_status form_check(reader *r, pb_error *err) {
  uint8_t magic[PB_MCAP_MAGIC_SIZE], last[PB_MCAP_MAGIC_SIZE];
  struct stat info;
  if (fstat(fileno(r->stream), &info) || !S_ISREG(info.st_mode))
    return pb_fail(err, PB_ERR_IO, r->path, "is not a file");
  r->size = r->report->bytes = (uint64_t)info.st_size;
  const size_t got = fread(magic, 1, sizeof magic, r->stream);
  if (got != sizeof magic || memcmp(magic, PB_MCAP_MAGIC, sizeof magic) != 0)
    return pb_fail(err, PB_ERR_SYNTAX, r->path, "is not an MCAP file");
  if (fseeko(r->stream, -(off_t)sizeof last, SEEK_END) ||
      fread(last, 1, sizeof last, r->stream) != sizeof last ||
      fseeko(r->stream, sizeof magic, SEEK_SET))
    return pb_fail(err, PB_ERR_IO, r->path, "cannot be read");
  r->ended = r->size > sizeof magic && memcmp(last, PB_MCAP_MAGIC, sizeof last) == 0;
  r->at = sizeof magic;
  r->crc = pb_crc32(0, magic, sizeof magic);
  return PB_OK;
}

pb_status pb_mcap_read(const char *path, const pb_mcap_visitor *visitor, pb_mcap_report *report,
                       pb_error *err) {
  *report = (pb_mcap_report){0};
  reader r = {.path = path, .visitor = visitor, .report = report};
  r.stream = fopen(path, "rb");
  if (!r.stream) return pb_fail(err, PB_ERR_IO, path, "cannot be read: %s", strerror(errno));
  pb_status status = form_check(&r, err);
  if (!status) status = records_read(&r, err);
  fclose(r.stream);
  pb_bytes_free(&r.content);
  pb_bytes_free(&r.records);
  return status;
}
