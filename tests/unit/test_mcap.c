// MCAP files: written and read back, read by an independent parser, cut at every byte, and with
// every single bit turned.
#include "mcap_parse.h"
#include "mcap_reader.h"
#include "mcap_writer.h"
#include "spans.h"
#include "support/check.h"

static const pb_mcap_writer_options plain = {.library = "test"};

static char folder[] = "/tmp/pb-mcap-XXXXXX";

static const char *path_of(const char *name) {
  static char path[512];
  snprintf(path, sizeof path, "%s/%s", folder, name);
  return path;
}

static int make_folder(void **state) {
  (void)state;
  return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state) {
  (void)state;
  unlink(path_of("a.mcap"));
  unlink(path_of("b.mcap"));
  return rmdir(folder);
}

// What a reader saw, as one text: order and content.
typedef struct seen {
  char text[4096];
  uint64_t messages, octets, sum;
} seen;

static void tell(seen *s, const char *kind, pb_view a, pb_view b) {
  const size_t n = strlen(s->text);
  snprintf(s->text + n, sizeof s->text - n, "%s %.*s|%.*s\n", kind, (int)a.size, (const char *)a.p,
           (int)b.size, (const char *)b.p);
}

static pb_status see_schema(void *context, const pb_mcap_schema *x, pb_error *err) {
  (void)err;
  tell(context, "schema", x->name, x->data);
  return PB_OK;
}

static pb_status see_channel(void *context, const pb_mcap_channel_record *x, pb_error *err) {
  (void)err;
  pb_cursor pairs = {x->metadata.p, x->metadata.size, false};
  pb_view key, value;
  tell(context, "channel", x->topic, x->encoding);
  while (pb_mcap_pair_next(&pairs, &key, &value)) tell(context, "pair", key, value);
  return pairs.bad ? PB_ERR_SYNTAX : PB_OK;
}

static pb_status see_message(void *context, const pb_mcap_message *x, pb_error *err) {
  (void)err;
  seen *s = context;
  char head[64];
  s->messages++;
  s->octets += x->data.size;
  for (size_t i = 0; i < x->data.size; i++) s->sum += x->data.p[i] * (i % 251 + 1);
  snprintf(head, sizeof head, "message %u %u %llu %llu", x->channel, x->sequence,
           (unsigned long long)x->log_time, (unsigned long long)x->publish_time);
  if (x->data.size < 100) tell(s, head, x->data, (pb_view){(const uint8_t *)"", 0});
  return PB_OK;
}

static pb_status see_attachment(void *context, const pb_mcap_attachment *x, pb_error *err) {
  (void)err;
  tell(context, "attachment", x->name, x->data);
  tell(context, "media", x->media_type, x->media_type);
  return PB_OK;
}

static pb_status see_metadata(void *context, const pb_mcap_metadata *x, pb_error *err) {
  (void)err;
  pb_cursor pairs = {x->pairs.p, x->pairs.size, false};
  pb_view key, value;
  while (pb_mcap_pair_next(&pairs, &key, &value)) tell(context, "meta", key, value);
  return pairs.bad ? PB_ERR_SYNTAX : PB_OK;
}

static pb_status see(const char *path, seen *s, pb_mcap_report *report, pb_error *err) {
  *s = (seen){0};
  const pb_mcap_visitor visitor = {
      s, see_schema, see_channel, see_message, see_attachment, see_metadata, false};
  return pb_mcap_read(path, &visitor, report, err);
}

static void put_message(pb_mcap_writer *w, uint16_t channel, uint32_t number, const char *text) {
  pb_error err = {0};
  const pb_mcap_stamp stamp = {number, 1000 + number, 7 * number};
  uint8_t *at = pb_mcap_writer_message(w, channel, stamp, strlen(text), &err);
  assert_non_null(at);
  memcpy(at, text, strlen(text));
}

static void write_example(const char *path) {
  const pb_mcap_pair pairs[] = {{"plant", "bench"}, {"unit", "m/s²"}};
  pb_mcap_writer *w = NULL;
  uint16_t schema, one, two;
  REQUIRE(pb_mcap_writer_create(path, &plain, &w, &err));
  REQUIRE(pb_mcap_writer_schema(w, "T", "omgidl", "struct T {};", &schema, &err));
  REQUIRE(pb_mcap_writer_channel(w, schema, "a", "cdr", pairs, 2, &one, &err));
  put_message(w, one, 0, "first");
  REQUIRE(pb_mcap_writer_metadata(w, "about", pairs, 2, &err));
  REQUIRE(pb_mcap_writer_attach(w, "plant.json", "application/json", 5, "{\"x\": 1}", 8, &err));
  REQUIRE(pb_mcap_writer_channel(w, 0, "b", "json", NULL, 0, &two, &err));
  put_message(w, two, 2, "{}");
  put_message(w, one, 1, "");
  REQUIRE(pb_mcap_writer_flush(w, &err));
  put_message(w, one, 3, "last");
  REQUIRE(pb_mcap_writer_close(w, &err));
}

static const char example_seen[] = "schema T|struct T {};\n"
                                   "channel a|cdr\n"
                                   "pair plant|bench\n"
                                   "pair unit|m/s²\n"
                                   "message 1 0 1000 0 first|\n"
                                   "meta plant|bench\n"
                                   "meta unit|m/s²\n"
                                   "attachment plant.json|{\"x\": 1}\n"
                                   "media application/json|application/json\n"
                                   "channel b|json\n"
                                   "message 2 2 1002 14 {}|\n"
                                   "message 1 1 1001 7 |\n"
                                   "message 1 3 1003 21 last|\n";

static void crc_is_the_common_one(void **state) {
  (void)state;
  assert_int_equal(pb_crc32(0, "123456789", 9), 0xcbf43926);
  assert_int_equal(pb_crc32(pb_crc32(0, "12345", 5), "6789", 4), 0xcbf43926);
  assert_int_equal(pb_crc32(0, "", 0), 0);
}

static void what_is_written_reads_back(void **state) {
  (void)state;
  seen s;
  pb_mcap_report report;
  write_example(path_of("a.mcap"));
  REQUIRE(see(path_of("a.mcap"), &s, &report, &err));
  assert_string_equal(s.text, example_seen);
  assert_true(report.complete);
  assert_int_equal(report.messages, 4);
  assert_int_equal(report.chunks, 3);
  assert_int_equal(report.read_to, report.bytes);
}

static void an_independent_parser_agrees(void **state) {
  (void)state;
  write_example(path_of("a.mcap"));
  const mcap_parse_counts n = mcap_parse(path_of("a.mcap"));
  assert_int_equal(n.messages, 4);
  assert_int_equal(n.chunks, 3);
  assert_int_equal(n.attachments, 1);
  assert_int_equal(n.metadata, 1);
  assert_int_equal(n.schemas, 1);
  assert_int_equal(n.channels, 2);
}

// ---- damage -------------------------------------------------------------------------------------

static uint8_t *load(const char *path, size_t *size) {
  static uint8_t content[65536];
  FILE *stream = fopen(path, "rb");
  assert_non_null(stream);
  *size = fread(content, 1, sizeof content, stream);
  fclose(stream);
  assert_true(*size > 0 && *size < sizeof content);
  return content;
}

static void store(const char *path, const uint8_t *content, size_t size) {
  FILE *stream = fopen(path, "wb");
  assert_non_null(stream);
  assert_int_equal(fwrite(content, 1, size, stream), size);
  assert_int_equal(fclose(stream), 0);
}

// What is read is always a beginning of the whole, in whole records, and never called complete.
static void a_cut_file_is_read_up_to_the_cut(void **state) {
  (void)state;
  size_t size;
  seen s;
  pb_mcap_report report;
  pb_error err;
  write_example(path_of("a.mcap"));
  const uint8_t *content = load(path_of("a.mcap"), &size);
  uint64_t messages = 0;
  const size_t header = 8 + 9 + 4 + 4 + 4;  // magic and header
  for (size_t cut = 0; cut < size; cut++) {
    store(path_of("b.mcap"), content, cut);
    const pb_status status = see(path_of("b.mcap"), &s, &report, &err);
    if (cut < header) {
      if (status != PB_ERR_SYNTAX) fail_msg("cut at %zu: status %d", cut, status);
      continue;
    }
    if (status) fail_msg("cut at %zu: %s", cut, err.message);
    assert_false(report.complete);
    assert_true(report.read_to <= cut);
    assert_memory_equal(s.text, example_seen, strlen(s.text));
    assert_true(s.messages >= messages);
    messages = s.messages;
  }
  assert_int_equal(messages, 4);
}

static void every_turned_bit_is_found(void **state) {
  (void)state;
  size_t size;
  seen s;
  pb_mcap_report report;
  pb_error err;
  write_example(path_of("a.mcap"));
  uint8_t *content = load(path_of("a.mcap"), &size);
  for (size_t bit = 0; bit < 8 * size; bit++) {
    content[bit / 8] ^= (uint8_t)(1u << bit % 8);
    store(path_of("b.mcap"), content, size);
    content[bit / 8] ^= (uint8_t)(1u << bit % 8);
    const pb_status status = see(path_of("b.mcap"), &s, &report, &err);
    if (status != PB_ERR_SYNTAX)
      fail_msg("bit %zu of byte %zu turned: status %d", bit % 8, bit / 8, status);
  }
}

static void foreign_files_are_refused(void **state) {
  (void)state;
  seen s;
  pb_mcap_report report;
  pb_error err = {0};
  assert_int_equal(see(path_of("none.mcap"), &s, &report, &err), PB_ERR_IO);
  assert_int_equal(see(folder, &s, &report, &err), PB_ERR_IO);
  store(path_of("b.mcap"), (const uint8_t *)"time,y\n0,1\n", 11);
  assert_int_equal(see(path_of("b.mcap"), &s, &report, &err), PB_ERR_SYNTAX);
  assert_non_null(strstr(err.message, "not an MCAP file"));
}

// ---- size ---------------------------------------------------------------------------------------

// Chunks of a megabyte, and one message that is larger than a chunk. Of a file that is cut within a
// chunk all whole messages come back.
static void large_file(pb_mcap_compression compression) {
  enum { COUNT = 3000, SIZE = 1000, LARGE = 3 * PB_MCAP_CHUNK_BYTES };
  const pb_mcap_writer_options options = {.library = "test", .compression = compression};
  pb_mcap_writer *w = NULL;
  pb_error failed = {0};
  uint16_t channel;
  uint64_t sum = 0;
  REQUIRE(pb_mcap_writer_create(path_of("a.mcap"), &options, &w, &err));
  REQUIRE(pb_mcap_writer_channel(w, 0, "a", "x-test", NULL, 0, &channel, &err));
  for (uint32_t k = 0; k < COUNT; k++) {
    const size_t size = k == COUNT / 2 ? LARGE : SIZE;
    uint8_t *at = pb_mcap_writer_message(w, channel, (pb_mcap_stamp){k, k, k}, size, &failed);
    assert_non_null(at);
    for (size_t i = 0; i < size; i++) {
      at[i] = (uint8_t)(k * 31 + i * 7 + (i * k) % 13);
      sum += at[i] * (i % 251 + 1);
    }
  }
  REQUIRE(pb_mcap_writer_close(w, &err));
  seen s;
  pb_mcap_report report;
  REQUIRE(see(path_of("a.mcap"), &s, &report, &err));
  assert_int_equal(s.messages, COUNT);
  assert_int_equal(s.octets, (COUNT - 1) * SIZE + LARGE);
  assert_int_equal(s.sum, sum);
  assert_true(report.chunks >= 4);
  if (compression == PB_MCAP_NONE) assert_int_equal(mcap_parse(path_of("a.mcap")).messages, COUNT);
  // Into the last chunk: the summary takes less than the chunk does.
  assert_int_equal(truncate(path_of("a.mcap"), (off_t)(report.bytes - report.bytes / 16)), 0);
  REQUIRE(see(path_of("a.mcap"), &s, &report, &err));
  const uint64_t whole = s.messages;
  const pb_mcap_visitor salvage = {.salvage = true};
  REQUIRE(pb_mcap_read(path_of("a.mcap"), &salvage, &report, &err));
  assert_int_equal(report.messages, whole + report.salvaged);
  assert_true(report.salvaged > 100);
  assert_true(report.messages < COUNT);
}

static void large_files_keep_every_octet(void **state) {
  (void)state;
  for (int kind = 0; kind < PB_MCAP_COMPRESSIONS; kind++) large_file((pb_mcap_compression)kind);
}

static void a_full_disk_is_told(void **state) {
  (void)state;
  pb_mcap_writer *w = NULL;
  pb_error failed = {0};
  uint16_t channel;
  assert_int_equal(pb_mcap_writer_create(path_of("no/a.mcap"), &plain, &w, &failed), PB_ERR_IO);
  assert_null(w);
  REQUIRE(pb_mcap_writer_create("/dev/full", &plain, &w, &err));
  REQUIRE(pb_mcap_writer_channel(w, 0, "a", "json", NULL, 0, &channel, &err));
  put_message(w, channel, 0, "{}");
  assert_int_equal(pb_mcap_writer_flush(w, &failed), PB_ERR_IO);
  pb_mcap_writer_discard(w);
  REQUIRE(pb_mcap_writer_create("/dev/full", &plain, &w, &err));
  assert_int_equal(pb_mcap_writer_close(w, &failed), PB_ERR_IO);
}

// ---- spans --------------------------------------------------------------------------------------

static bool add(pb_spans *s, uint32_t epoch, uint64_t step, uint32_t decimation) {
  const plantbus_Sample x = {.epoch = epoch, .step = step, .revision = 1, .decimation = decimation};
  bool fresh = false;
  REQUIRE(pb_spans_add(s, &x, &fresh, &err));
  return fresh;
}

static void gaps_and_repetitions_are_counted(void **state) {
  (void)state;
  pb_spans s = {0};
  assert_true(add(&s, 1, 0, 1));
  assert_true(add(&s, 1, 1, 1));
  assert_false(add(&s, 1, 1, 1));  // lockstep says it again
  assert_true(add(&s, 1, 5, 10));  // 2, 3, 4 are missing
  assert_true(add(&s, 1, 15, 10));
  assert_true(add(&s, 1, 45, 1));  // 25 and 35 are missing
  assert_true(add(&s, 2, 0, 1));
  assert_false(add(&s, 1, 46, 1));  // from before the reset
  assert_true(add(&s, 2, 1, 1));
  assert_int_equal(s.count, 2);
  assert_int_equal(s.samples, 7);
  assert_int_equal(s.repeats, 2);
  assert_int_equal(s.gaps, 2);
  assert_int_equal(s.missing, 5);
  assert_int_equal(s.span[0].last_step, 45);
  assert_true(s.span[0].decimated && !s.span[1].decimated);
  assert_int_equal(s.span[1].missing, 0);
  ASSERT_NEAR(pb_spans_seconds(&s, 2.0), (46 + 2) / 2.0, 0.0);
  pb_spans_free(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(crc_is_the_common_one),
      cmocka_unit_test(what_is_written_reads_back),
      cmocka_unit_test(an_independent_parser_agrees),
      cmocka_unit_test(a_cut_file_is_read_up_to_the_cut),
      cmocka_unit_test(every_turned_bit_is_found),
      cmocka_unit_test(foreign_files_are_refused),
      cmocka_unit_test(large_files_keep_every_octet),
      cmocka_unit_test(a_full_disk_is_told),
      cmocka_unit_test(gaps_and_repetitions_are_counted),
  };
  return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
