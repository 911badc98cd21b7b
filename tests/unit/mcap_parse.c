// See mcap_parse.h. https://mcap.dev/spec
#include "mcap_parse.h"

#include "support/check.h"

typedef struct file {
  uint8_t *p;
  uint64_t size;
} file;

static file load(const char *path) {
  file f = {0};
  FILE *stream = fopen(path, "rb");
  assert_non_null(stream);
  fseek(stream, 0, SEEK_END);
  f.size = (uint64_t)ftell(stream);
  rewind(stream);
  f.p = malloc(f.size);
  assert_non_null(f.p);
  assert_int_equal(fread(f.p, 1, f.size, stream), f.size);
  fclose(stream);
  return f;
}

static uint64_t le(const uint8_t *p, int octets) {
  uint64_t value = 0;
  while (octets-- > 0) value = value << 8 | p[octets];
  return value;
}

// Bit by bit.
static uint32_t crc(const uint8_t *p, uint64_t size) {
  uint32_t r = 0xffffffff;
  for (uint64_t i = 0; i < size; i++) {
    r ^= p[i];
    for (int k = 0; k < 8; k++) r = r & 1 ? r >> 1 ^ 0xedb88320 : r >> 1;
  }
  return ~r;
}

static uint64_t text_end(const uint8_t *p, uint64_t at) {
  return at + 4 + le(p + at, 4);
}

// The message index that follows a chunk: each entry points at a message of that channel and time.
static void check_index(const uint8_t *records, const uint8_t *index, uint64_t *entries) {
  const uint64_t channel = le(index, 2), size = le(index + 2, 4);
  assert_int_equal(size % 16, 0);
  for (uint64_t i = 0; i < size; i += 16) {
    const uint8_t *m = records + le(index + 6 + i + 8, 8);
    assert_int_equal(m[0], 5);
    assert_int_equal(le(m + 9, 2), channel);
    assert_int_equal(le(m + 9 + 6, 8), le(index + 6 + i, 8));
    ++*entries;
  }
}

static uint64_t chunk_messages(const uint8_t *p, uint64_t size, uint64_t first, uint64_t last,
                               mcap_parse_counts *n) {
  uint64_t messages = 0, at = 0, low = UINT64_MAX, high = 0;
  while (at < size) {
    const uint8_t opcode = p[at];
    const uint64_t length = le(p + at + 1, 8), time = le(p + at + 9 + 6, 8);
    assert_true(opcode >= 3 && opcode <= 5);
    if (opcode == 3) n->schemas++;
    if (opcode == 4) n->channels++;
    if (opcode == 5) {
      messages++;
      low = time < low ? time : low;
      high = time > high ? time : high;
    }
    at += 9 + length;
  }
  assert_int_equal(at, size);
  assert_int_equal(first, messages ? low : 0);
  assert_int_equal(last, messages ? high : 0);
  return messages;
}

// A chunk at `at` and its indexes, against its Chunk Index record. Where the indexes end.
static uint64_t check_chunk(const file *f, uint64_t at, const uint8_t *index,
                            mcap_parse_counts *n) {
  const uint8_t *c = f->p + at + 9;
  const uint64_t records = 28 + 4 + 8, size = le(c + 32, 8), map = le(index + 32, 4);
  assert_int_equal(f->p[at], 6);
  assert_int_equal(le(c + 28, 4), 0);  // not compressed
  assert_int_equal(le(c + 16, 8), size);
  assert_int_equal(le(c + 24, 4), crc(c + records, size));
  assert_int_equal(le(index, 8), le(c, 8));
  assert_int_equal(le(index + 8, 8), le(c + 8, 8));
  assert_int_equal(le(index + 16, 8), at);
  assert_int_equal(le(index + 24, 8), 9 + le(f->p + at + 1, 8));
  const uint64_t messages = chunk_messages(c + records, size, le(c, 8), le(c + 8, 8), n);
  uint64_t next = at + 9 + le(f->p + at + 1, 8), entries = 0;
  const uint64_t begin = next;
  for (uint64_t i = 0; i < map; i += 10) {
    assert_int_equal(le(index + 36 + i + 2, 8), next);
    assert_int_equal(f->p[next], 7);
    assert_int_equal(le(f->p + next + 9, 2), le(index + 36 + i, 2));
    check_index(c + records, f->p + next + 9, &entries);
    next += 9 + le(f->p + next + 1, 8);
  }
  assert_int_equal(entries, messages);
  assert_int_equal(le(index + 36 + map, 8), next - begin);
  assert_int_equal(le(index + 36 + map + 12, 8), size);
  assert_int_equal(le(index + 36 + map + 20, 8), size);
  n->messages += messages;
  n->chunks++;
  return next;
}

static void check_attachment(const file *f, const uint8_t *index) {
  const uint64_t at = le(index, 8), length = le(index + 8, 8);
  const uint8_t *a = f->p + at + 9;
  assert_int_equal(f->p[at], 9);
  assert_int_equal(length, 9 + le(f->p + at + 1, 8));
  assert_int_equal(le(a + length - 9 - 4, 4), crc(a, length - 9 - 4));
  const uint64_t data = text_end(a, text_end(a, 16));
  assert_int_equal(le(a + data, 8), le(index + 32, 8));
  assert_int_equal(data + 8 + le(a + data, 8) + 4, length - 9);
}

static void check_statistics(const uint8_t *s, const mcap_parse_counts *n) {
  assert_int_equal(le(s, 8), n->messages);
  assert_int_equal(le(s + 8, 2), n->schemas);
  assert_int_equal(le(s + 10, 4), n->channels);
  assert_int_equal(le(s + 14, 4), n->attachments);
  assert_int_equal(le(s + 18, 4), n->metadata);
  assert_int_equal(le(s + 22, 4), n->chunks);
  uint64_t sum = 0;
  for (uint64_t i = 0; i < le(s + 42, 4); i += 10) sum += le(s + 46 + i + 2, 8);
  assert_int_equal(sum, n->messages);
}

// The summary's records; those of the data section that they point at are checked with them.
static void check_summary(const file *f, uint64_t from, uint64_t to, mcap_parse_counts *n) {
  uint64_t schemas = 0, channels = 0;
  const uint8_t *statistics = NULL;
  for (uint64_t at = from; at < to; at += 9 + le(f->p + at + 1, 8)) {
    const uint8_t *content = f->p + at + 9;
    switch (f->p[at]) {
    case 3:
      schemas++;
      break;
    case 4:
      channels++;
      break;
    case 8:
      check_chunk(f, le(content + 16, 8), content, n);
      break;
    case 10:
      check_attachment(f, content), n->attachments++;
      break;
    case 11:
      statistics = content;
      break;
    case 13:
      assert_int_equal(f->p[le(content, 8)], 12);
      assert_int_equal(le(f->p + le(content, 8) + 1, 8) + 9, le(content + 8, 8));
      n->metadata++;
      break;
    default:
      fail_msg("opcode %d in the summary", f->p[at]);
    }
  }
  assert_int_equal(schemas, n->schemas);
  assert_int_equal(channels, n->channels);
  assert_non_null(statistics);
  check_statistics(statistics, n);
}

// Every group of the summary is named once, and together they are all of it.
static void check_offsets(const file *f, uint64_t summary, uint64_t from, uint64_t to) {
  uint64_t next = summary;
  for (uint64_t at = from; at < to; at += 9 + 17) {
    const uint8_t *o = f->p + at + 9;
    assert_int_equal(f->p[at], 14);
    assert_int_equal(le(f->p + at + 1, 8), 17);
    assert_int_equal(le(o + 1, 8), next);
    const uint64_t end = next + le(o + 9, 8);
    for (; next < end; next += 9 + le(f->p + next + 1, 8)) assert_int_equal(f->p[next], o[0]);
    assert_int_equal(next, end);
  }
  assert_int_equal(next, from);
}

mcap_parse_counts mcap_parse(const char *path) {
  static const uint8_t magic[] = {0x89, 'M', 'C', 'A', 'P', 0x30, '\r', '\n'};
  mcap_parse_counts n = {0};
  file f = load(path);
  assert_memory_equal(f.p, magic, 8);
  assert_memory_equal(f.p + f.size - 8, magic, 8);
  assert_int_equal(f.p[8], 1);
  const uint64_t footer = f.size - 8 - 29;
  const uint8_t *foot = f.p + footer;
  assert_int_equal(foot[0], 2);
  assert_int_equal(le(foot + 1, 8), 20);
  const uint64_t summary = le(foot + 9, 8), offsets = le(foot + 17, 8);
  assert_int_equal(le(foot + 25, 4), crc(f.p + summary, footer + 25 - summary));
  const uint64_t data_end = summary - 13;
  assert_int_equal(f.p[data_end], 15);
  assert_int_equal(le(f.p + data_end + 9, 4), crc(f.p, data_end));
  check_summary(&f, summary, offsets, &n);
  check_offsets(&f, summary, offsets, footer);
  free(f.p);
  return n;
}
