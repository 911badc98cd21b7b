// Recordings as clients/mcap reads them: two revisions, exports, what is not a recording; messages
// in both editions of CDR.
#include "bus_cdr.h"
#include "mcap_writer.h"
#include "recording_export.h"
#include "support/check.h"

static const pb_mcap_writer_options plain = {.library = "test"};

static char folder[] = "/tmp/pb-recording-XXXXXX";

static const char *path_of(const char *name) {
  static char path[4][512];
  static int next;
  char *p = path[next++ % 4];
  snprintf(p, sizeof path[0], "%s/%s", folder, name);
  return p;
}

static int make_folder(void **state) {
  (void)state;
  return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state) {
  (void)state;
  unlink(path_of("a.mcap"));
  unlink(path_of("a.csv"));
  return rmdir(folder);
}

// ---- messages, encoded here ---------------------------------------------------------------------

static void put_double(pb_bytes *b, double value) {
  uint64_t bits;
  memcpy(&bits, &value, sizeof bits);
  pb_bytes_u64(b, bits);
}

static void begin(pb_bytes *b, uint8_t edition) {
  b->size = 0;
  pb_bytes_u8(b, 0);
  pb_bytes_u8(b, edition);
  pb_bytes_u16(b, 0);
}

static void encode_sample(pb_bytes *b, const plantbus_Sample *x) {
  begin(b, 1);
  pb_bytes_u64(b, x->step);
  pb_bytes_u64(b, (uint64_t)x->time_ns);
  const uint32_t field[] = {x->epoch,       x->revision,     x->flags,
                            x->input_count, x->output_count, x->decimation};
  for (int i = 0; i < 6; i++) pb_bytes_u32(b, field[i]);
  for (int i = 0; i < plantbus_MAX_INPUTS; i++) put_double(b, x->input[i]);
  for (int i = 0; i < plantbus_MAX_OUTPUTS; i++) put_double(b, x->output[i]);
}

static void pad(pb_bytes *b, size_t size) {
  while ((b->size - 4) % size != 0) pb_bytes_u8(b, 0);
}

static void put_text(pb_bytes *b, const char *text) {
  pad(b, 4);
  pb_bytes_u32(b, (uint32_t)strlen(text) + 1);
  pb_bytes_raw(b, text, strlen(text) + 1);
}

// Edition 1 aligns the step to 8 octets, edition 7 (XCDR2) to 4.
static void encode_event(pb_bytes *b, uint8_t edition) {
  static const uint8_t client[16] = {1};
  begin(b, edition);
  pb_bytes_u64(b, 77);
  put_text(b, "bench two");
  put_text(b, "attached");
  pad(b, 4);
  pb_bytes_u32(b, 3);
  pad(b, edition == 1 ? 8 : 4);
  pb_bytes_u64(b, 1234567890123u);
  pb_bytes_raw(b, client, sizeof client);
  put_text(b, "tool[1]");
  put_text(b, "");
  put_text(b, "has attached");
}

static void events_of_both_editions_are_read(void **state) {
  (void)state;
  pb_bytes b = {0};
  size_t size[2];
  for (int i = 0; i < 2; i++) {
    pb_cdr_event_view e;
    encode_event(&b, i ? 7 : 1);
    size[i] = b.size;
    assert_true(pb_cdr_event((pb_view){b.p, b.size}, &e));
    assert_true(e.number == 77 && e.epoch == 3 && e.step == 1234567890123u);
    assert_true(pb_view_is(e.kind, "attached") && pb_view_is(e.client_name, "tool[1]"));
    assert_true(pb_view_is(e.channel, "") && pb_view_is(e.message, "has attached"));
    for (size_t cut = 0; cut < b.size; cut++) assert_false(pb_cdr_event((pb_view){b.p, cut}, &e));
  }
  assert_true(size[0] > size[1]);  // the editions do differ here
  pb_bytes_free(&b);
}

static void samples_are_read_and_bounded(void **state) {
  (void)state;
  pb_bytes b = {0};
  plantbus_Sample x = {.step = 5, .time_ns = -7, .input_count = 32, .output_count = 64}, back;
  x.input[31] = 0.1;
  x.output[63] = -0.0;
  encode_sample(&b, &x);
  assert_true(pb_cdr_sample((pb_view){b.p, b.size}, &back));
  assert_memory_equal(&back, &x, sizeof x);
  assert_false(pb_cdr_sample((pb_view){b.p, b.size - 1}, &back));
  x.output_count = 65;
  encode_sample(&b, &x);
  assert_false(pb_cdr_sample((pb_view){b.p, b.size}, &back));
  b.p[1] = 0;  // big-endian
  assert_false(pb_cdr_sample((pb_view){b.p, b.size}, &back));
  pb_bytes_free(&b);
}

// ---- files --------------------------------------------------------------------------------------

static void put_revision(pb_mcap_writer *w, const char *revision, const char *outputs,
                         const char *units, const char *file, const char *text) {
  const pb_mcap_pair pairs[] = {
      {"plant", "bench"},      {"revision", revision},     {"sample_rate", "1000"},
      {"inputs", "[\"F\"]"},   {"input_units", "[\"N\"]"}, {"outputs", outputs},
      {"output_units", units}, {"sha256", "00"},           {"attachment", file},
      {"model", "none"},       {"software", "0"}};
  REQUIRE(pb_mcap_writer_metadata(w, "plantbus/v1/revision", pairs, sizeof pairs / sizeof *pairs,
                                  &err));
  REQUIRE(pb_mcap_writer_attach(w, file, "application/json", 1, text, strlen(text), &err));
}

// Steps 0 … 9 of revision 1, from 10 on revision 2 with one output more.
static void write_two_revisions(void) {
  pb_mcap_writer *w = NULL;
  pb_bytes b = {0};
  pb_error failed = {0};
  uint16_t channel;
  REQUIRE(pb_mcap_writer_create(path_of("a.mcap"), &plain, &w, &err));
  REQUIRE(pb_mcap_writer_channel(w, 0, "plantbus/v1/sample", "cdr", NULL, 0, &channel, &err));
  put_revision(w, "1", "[\"y\"]", "[\"m\"]", "plant.json", "{\"n\": 1}");
  for (uint32_t k = 0; k < 20; k++) {
    if (k == 10)
      put_revision(w, "2", "[\"y\",\"v\"]", "[\"m\",\"m/s\"]", "plant-r2.json", "{\"n\": 2}");
    const plantbus_Sample x = {.step = k,
                               .epoch = 1,
                               .revision = k < 10 ? 1 : 2,
                               .input_count = 1,
                               .output_count = k < 10 ? 1 : 2,
                               .decimation = 1,
                               .output = {k * 0.1, -1.0 * k}};
    encode_sample(&b, &x);
    uint8_t *at = pb_mcap_writer_message(w, channel, (pb_mcap_stamp){k, k, k}, b.size, &failed);
    assert_non_null(at);
    memcpy(at, b.p, b.size);
  }
  REQUIRE(pb_mcap_writer_close(w, &err));
  pb_bytes_free(&b);
}

static size_t lines_of(const char *path, char *first, size_t size) {
  FILE *stream = fopen(path, "r");
  char line[512];
  size_t count = 0;
  assert_non_null(stream);
  assert_non_null(fgets(first, (int)size, stream));
  while (fgets(line, sizeof line, stream)) count++;
  fclose(stream);
  return count;
}

static void two_revisions_keep_their_own_signals(void **state) {
  (void)state;
  pb_recording *r = NULL;
  pb_error failed = {0};
  char head[256];
  write_two_revisions();
  REQUIRE(pb_recording_open(path_of("a.mcap"), &r, &err));
  assert_int_equal(r->revisions, 2);
  assert_string_equal(pb_recording_revision(r, 1)->plant_text, "{\"n\": 1}");
  assert_string_equal(pb_recording_revision(r, 2)->plant_text, "{\"n\": 2}");
  assert_null(pb_recording_revision(r, 3));
  assert_int_equal(r->spans.count, 1);
  assert_int_equal(r->spans.span[0].first_revision, 1);
  assert_int_equal(r->spans.span[0].last_revision, 2);
  pb_export_choice choice = {0};
  assert_int_equal(pb_export_csv(r, &choice, path_of("a.csv"), &failed), PB_ERR_STATE);
  assert_int_equal(access(path_of("a.csv"), F_OK), -1);
  choice.revision = 2;
  REQUIRE(pb_export_csv(r, &choice, path_of("a.csv"), &err));
  assert_int_equal(lines_of(path_of("a.csv"), head, sizeof head), 10);
  assert_string_equal(head, "time [s],step,epoch,revision,flags,F [N],y [m],v [m/s]\n");
  const char *const none[] = {"x"};
  choice.signal = none;
  choice.signals = 1;
  assert_int_equal(pb_export_csv(r, &choice, path_of("a.csv"), &failed), PB_ERR_REFERENCE);
  choice = (pb_export_choice){.revision = 1, .epoch = 2};
  assert_int_equal(pb_export_csv(r, &choice, path_of("a.csv"), &failed), PB_ERR_STATE);
  pb_recording_free(r);
}

// Files that are MCAP, but no recording.
static void other_files_are_refused(void **state) {
  (void)state;
  static const char *const outputs[] = {NULL, "[\"y\",\"v\"]", "[1]", "{}", "[\"y\"", "y"};
  for (size_t i = 0; i < sizeof outputs / sizeof *outputs; i++) {
    pb_mcap_writer *w = NULL;
    pb_recording *r = NULL;
    pb_error failed = {0};
    REQUIRE(pb_mcap_writer_create(path_of("a.mcap"), &plain, &w, &err));
    if (outputs[i]) put_revision(w, "1", outputs[i], "[\"m\"]", "plant.json", "{}");
    REQUIRE(pb_mcap_writer_close(w, &err));
    assert_int_equal(pb_recording_open(path_of("a.mcap"), &r, &failed), PB_ERR_SYNTAX);
    assert_null(r);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(events_of_both_editions_are_read),
      cmocka_unit_test(samples_are_read_and_bounded),
      cmocka_unit_test(two_revisions_keep_their_own_signals),
      cmocka_unit_test(other_files_are_refused),
  };
  return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
