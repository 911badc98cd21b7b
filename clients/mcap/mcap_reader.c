// See mcap_reader.h.
#include "mcap_reader.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

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
  uint8_t head[PB_MCAP_HEAD_SIZE];
  pb_bytes content;
} reader;

static pb_status damaged(const reader *r, const char *what, pb_error *err) {
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

static pb_status chunk_read(reader *r, pb_cursor c, pb_error *err) {
  pb_cursor_u64(&c);
  pb_cursor_u64(&c);
  const uint64_t size = pb_cursor_u64(&c);
  const uint32_t crc = pb_cursor_u32(&c);
  const pb_view compression = pb_cursor_text(&c);
  const pb_view records = pb_cursor_take(&c, pb_cursor_u64(&c));
  if (c.bad) return damaged(r, "a chunk", err);
  if (compression.size > 0)
    return pb_fail(err, PB_ERR_SYNTAX, r->path, "has chunks compressed with '%.*s': not supported",
                   compression.size > 16 ? 16 : (int)compression.size, (const char *)compression.p);
  if (records.size != size || (crc != 0 && crc != pb_crc32(0, records.p, records.size)))
    return damaged(r, "the CRC of a chunk does not match", err);
  r->report->chunks++;
  pb_cursor inner = {records.p, records.size, false};
  while (inner.left > 0) {
    const uint8_t opcode = pb_cursor_u8(&inner);
    const pb_view content = pb_cursor_take(&inner, pb_cursor_u64(&inner));
    if (inner.bad) return damaged(r, "a record in a chunk", err);
    const pb_status status =
        inner_read(r, opcode, (pb_cursor){content.p, content.size, false}, err);
    if (status) return status;
  }
  return PB_OK;
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

// *whole false: the file ends before the record does.
static pb_status record_fetch(reader *r, bool *whole, pb_error *err) {
  *whole = false;
  r->content.size = 0;
  if (r->size - r->at < sizeof r->head) return PB_OK;
  if (fread(r->head, 1, sizeof r->head, r->stream) != sizeof r->head)
    return pb_fail(err, PB_ERR_IO, r->path, "cannot be read");
  pb_cursor c = {r->head + 1, 8, false};
  const uint64_t size = pb_cursor_u64(&c);
  if (size > r->size - r->at - sizeof r->head) return PB_OK;
  uint8_t *at = pb_bytes_grow(&r->content, (size_t)size);
  if (!at) return pb_fail_memory(err, r->path);
  if (fread(at, 1, (size_t)size, r->stream) != size)
    return pb_fail(err, PB_ERR_IO, r->path, "cannot be read");
  *whole = true;
  return PB_OK;
}

static pb_status records_read(reader *r, pb_error *err) {
  while (!r->done) {
    bool whole;
    pb_status status = record_fetch(r, &whole, err);
    if (!status && !whole && r->ended) status = damaged(r, "a record has the wrong length", err);
    if (!status && !whole && !r->begun) status = damaged(r, "it holds nothing", err);
    if (!status && !whole) return PB_OK;
    const bool end = r->head[0] == PB_MCAP_DATA_END && r->summary == 0;
    if (!status) status = record_read(r, err);
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
  return status;
}
