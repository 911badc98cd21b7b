// The hash of a run, and snapshot files: whole and the same, or refused with the reason.
#include "support/check.h"

#include <errno.h>
#include <fcntl.h>
#include <openssl/evp.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "base/text.h"
#include "hash.h"
#include "modal_model.h"
#include "snapshot.h"

// A value worked out apart from this program, so that runs of different builds can be compared.
static void test_hash_value(void **state) {
  (void)state;
  const double u[2] = {1, -2.5}, y[3] = {0, 3.25, 1e-3};
  const uint64_t first = pb_hash_step(PB_HASH_START, 7, 1, u, 2, y, 3);
  assert_true(first == UINT64_C(0x58bf7e98ec408491));
  assert_true(pb_hash_step(first, 8, 1, u, 2, y, 3) == UINT64_C(0x7b5ae7184b802c94));
}

static void test_hash_tells_apart(void **state) {
  (void)state;
  double v[5] = {1, -2.5, 0, 3.25, 1e-3};
  const uint64_t h = pb_hash_step(1, 7, 1, v, 2, v + 2, 3);
  assert_true(pb_hash_step(2, 7, 1, v, 2, v + 2, 3) != h);
  assert_true(pb_hash_step(1, 8, 1, v, 2, v + 2, 3) != h);
  assert_true(pb_hash_step(1, 7, 2, v, 2, v + 2, 3) != h);
  assert_true(pb_hash_step(1, 7, 1, v, 3, v + 3, 2) != h);
  const double swapped[5] = {-2.5, 1, 0, 3.25, 1e-3}, negative[5] = {1, -2.5, -0.0, 3.25, 1e-3};
  assert_true(pb_hash_step(1, 7, 1, swapped, 2, swapped + 2, 3) != h);
  assert_true(pb_hash_step(1, 7, 1, negative, 2, negative + 2, 3) != h);
  // Each bit of each value moves about half of the bits of the hash.
  int moved = 0;
  for (int i = 0; i < 5 * 64; i++) {
    uint64_t word;
    const double kept = v[i / 64];
    memcpy(&word, &kept, sizeof word);
    word ^= UINT64_C(1) << i % 64;
    memcpy(&v[i / 64], &word, sizeof word);
    const uint64_t other = pb_hash_step(1, 7, 1, v, 2, v + 2, 3);
    v[i / 64] = kept;
    const int bits = __builtin_popcountll(h ^ other);
    assert_true(bits >= 8 && bits <= 56);
    moved += bits;
  }
  ASSERT_NEAR(moved / (5 * 64.0), 32, 1);
}

static void sha256_hex(const char *text, char hex[65]) {
  unsigned char sum[32];
  assert_int_equal(EVP_Digest(text, strlen(text), sum, NULL, EVP_sha256(), NULL), 1);
  for (int i = 0; i < 32; i++) snprintf(hex + 2 * i, 3, "%02x", sum[i]);
}

static char directory[64], path[96];

static int set_up(void **state) {
  (void)state;
  strcpy(directory, "/tmp/pb-snapshot-XXXXXX");
  if (!mkdtemp(directory)) return -1;
  snprintf(path, sizeof path, "%s/a.snap", directory);
  return 0;
}

// Fails when the test left more than the file itself.
static int tear_down(void **state) {
  (void)state;
  unlink(path);
  return rmdir(directory);
}

// Odd lengths before the words, so that they lie unaligned; bits of all kinds in them.
static uint64_t plant_words[] = {
    12345, 2, 1, 0x7ff8000000001234, 0x8000000000000000, 1, 0x0123456789abcdef};
static uint64_t host_words[] = {0xfedcba9876543210, 17, 0x3ff0000000000000};
static char plant_text[] = "{\"name\": \"née\"}\n", host_text[] = "[{\"request\": \"excite\"}]";

static pb_snapshot_data example(void) {
  pb_snapshot_data data = {.step = (UINT64_C(1) << 53) + 7,
                           .hash = 0xdeadbeef00c0ffee,
                           .revision = 0x80000001,
                           .sample_rate = 1e4 / 3,
                           .nx = 2,
                           .nu = 1,
                           .ny = 5,
                           .plant_text = plant_text,
                           .state_bytes = sizeof plant_words,
                           .state = plant_words,
                           .host_text = host_text,
                           .host_bytes = sizeof host_words,
                           .host = host_words};
  sha256_hex(plant_text, data.plant_sha256);
  return data;
}

static void assert_equal_data(const pb_snapshot_data *a, const pb_snapshot_data *b) {
  assert_true(a->step == b->step && a->hash == b->hash && a->revision == b->revision);
  assert_true(a->sample_rate == b->sample_rate);
  assert_true(a->nx == b->nx && a->nu == b->nu && a->ny == b->ny);
  assert_string_equal(a->plant_sha256, b->plant_sha256);
  assert_string_equal(a->plant_text, b->plant_text);
  assert_string_equal(a->host_text, b->host_text);
  assert_int_equal(a->state_bytes, b->state_bytes);
  assert_int_equal(a->host_bytes, b->host_bytes);
  assert_memory_equal(a->state, b->state, a->state_bytes);
  if (a->host_bytes > 0) assert_memory_equal(a->host, b->host, a->host_bytes);
}

static void test_round_trip(void **state) {
  (void)state;
  pb_snapshot_data data = example(), out;
  REQUIRE(pb_snapshot_write(path, &data, &err));
  REQUIRE(pb_snapshot_read(path, &out, &err));
  assert_equal_data(&data, &out);
  pb_snapshot_clear(&out);
  assert_null(out.state);
  // Over what is there, and without a host.
  char nothing[] = "[]";
  data.host_text = nothing;
  data.host_bytes = 0;
  data.host = NULL;
  data.step = 3;
  REQUIRE(pb_snapshot_write(path, &data, &err));
  REQUIRE(pb_snapshot_read(path, &out, &err));
  assert_equal_data(&data, &out);
  pb_snapshot_clear(&out);
}

static unsigned char *file_read(size_t *size) {
  char *text;
  REQUIRE(pb_text_read(path, &text, size, &err));
  return (unsigned char *)text;
}

static void file_write(const void *data, size_t size) {
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  assert_int_equal(fwrite(data, 1, size, file), size);
  assert_int_equal(fclose(file), 0);
}

static void assert_refused(pb_status expected, const char *message) {
  pb_snapshot_data out, empty = {0};
  pb_error err = {0};
  memset(&out, 0x55, sizeof out);
  const pb_status status = pb_snapshot_read(path, &out, &err);
  if (status != expected || !strstr(err.message, message) || strcmp(err.where, path) != 0)
    fail_msg("%s: %s: %s, expected %s", pb_status_name(status), err.where, err.message, message);
  assert_memory_equal(&out, &empty, sizeof out);
}

// The octets that a reader on any machine finds.
static void test_layout(void **state) {
  (void)state;
  pb_snapshot_data data = example();
  REQUIRE(pb_snapshot_write(path, &data, &err));
  size_t size;
  unsigned char *file = file_read(&size), sum[32];
  const size_t words = 160 + strlen(plant_text), host = words + sizeof plant_words;
  assert_int_equal(size, host + strlen(host_text) + sizeof host_words + 32);
  assert_memory_equal(file, "\x89PBS\r\n\x1a\n\x01\0\0\0\x01\0\0\x80\x07\0\0\0\0\0\x20\0", 24);
  assert_memory_equal(file + 24, "\xee\xff\xc0\0\xef\xbe\xad\xde", 8);
  assert_memory_equal(file + 40, "\2\0\0\0\0\0\0\0\1\0\0\0\0\0\0\0\5\0\0\0\0\0\0\0", 24);
  assert_memory_equal(file + 64, data.plant_sha256, 64);
  assert_memory_equal(file + 160, plant_text, strlen(plant_text));
  assert_memory_equal(file + words + 48, "\xef\xcd\xab\x89\x67\x45\x23\x01", 8);
  assert_memory_equal(file + host, host_text, strlen(host_text));
  assert_int_equal(EVP_Digest(file, size - 32, sum, NULL, EVP_sha256(), NULL), 1);
  assert_memory_equal(file + size - 32, sum, 32);
  free(file);
}

static void test_altered_files(void **state) {
  (void)state;
  pb_snapshot_data data = example();
  REQUIRE(pb_snapshot_write(path, &data, &err));
  size_t size;
  unsigned char *file = file_read(&size);
  for (size_t i = 0; i < size; i++) {
    for (int bit = 0; bit < 8; bit += 7) {
      file[i] ^= 1u << bit;
      file_write(file, size);
      assert_refused(PB_ERR_SYNTAX, i < 8 ? "not a snapshot" : i < 12 ? "version" : "");
      if (i >= 12 && i < 128) assert_refused(PB_ERR_SYNTAX, "damaged");
      if (i >= 160) assert_refused(PB_ERR_SYNTAX, "damaged");
      file[i] ^= 1u << bit;
    }
  }
  for (size_t shorter = 0; shorter < size; shorter++) {
    file_write(file, shorter);
    assert_refused(PB_ERR_SYNTAX, shorter < 8 ? "not a snapshot" : "truncated");
  }
  unsigned char *longer = calloc(1, size + 1);
  memcpy(longer, file, size);
  file_write(longer, size + 1);
  assert_refused(PB_ERR_SYNTAX, "goes on");
  file_write(file, size);
  pb_snapshot_data out;
  REQUIRE(pb_snapshot_read(path, &out, &err));
  assert_equal_data(&data, &out);
  pb_snapshot_clear(&out);
  free(longer);
  free(file);
}

// Files with the right checksum that no writer made: octet `at` changed, or lengths moved.
static void forge(const unsigned char *file, size_t size, size_t at, unsigned char value,
                  const char *message) {
  unsigned char *copy = malloc(size);
  memcpy(copy, file, size);
  copy[at] = value;
  assert_int_equal(EVP_Digest(copy, size - 32, copy + size - 32, NULL, EVP_sha256(), NULL), 1);
  file_write(copy, size);
  assert_refused(PB_ERR_SYNTAX, message);
  free(copy);
}

static void test_forged_files(void **state) {
  (void)state;
  pb_snapshot_data data = example();
  REQUIRE(pb_snapshot_write(path, &data, &err));
  size_t size;
  unsigned char *file = file_read(&size);
  forge(file, size, 160, '[', "another plant");
  forge(file, size, 64, 'x', "another plant");
  forge(file, size, 165, '\0', "NUL");
  forge(file, size, 160 + strlen(plant_text) + sizeof plant_words, '\0', "NUL");
  forge(file, size, 39, 0xff, "sample rate");  // the sign of the rate
  forge(file, size, 135, 0xff, "truncated");   // lengths whose sum overflows
  forge(file, size, 143, 0xff, "truncated");
  file[144] += 1;  // one octet from the host's state to its text
  forge(file, size, 152, (unsigned char)(file[152] - 1), "words");
  free(file);
}

static void test_foreign_paths(void **state) {
  (void)state;
  char kept[sizeof path];
  file_write("{\"schema\": \"plantbus.plant/1\"}", 30);
  assert_refused(PB_ERR_SYNTAX, "not a snapshot");
  file_write("", 0);
  assert_refused(PB_ERR_SYNTAX, "not a snapshot");
  unlink(path);
  assert_refused(PB_ERR_IO, "No such file");
  assert_int_equal(mkfifo(path, 0600), 0);
  assert_refused(PB_ERR_IO, "not a regular file");
  unlink(path);
  strcpy(kept, path);
  strcpy(path, directory);
  assert_refused(PB_ERR_IO, "not a regular file");
  strcpy(path, kept);
}

static void test_data_that_are_refused(void **state) {
  (void)state;
  pb_snapshot_data good = example();
  char wrong[65], *no_text = NULL;
  sha256_hex("another", wrong);
  for (int i = 0; i < 9; i++) {
    pb_snapshot_data data = good;
    pb_error err = {0};
    if (i == 0) data.plant_text = no_text;
    if (i == 1) data.host_text = no_text;
    if (i == 2) data.state = NULL;
    if (i == 3) data.state_bytes -= 1;
    if (i == 4) data.host_bytes -= 4;
    if (i == 5) data.host = NULL;
    if (i == 6) data.sample_rate = 0;
    if (i == 7) data.sample_rate = NAN;
    if (i == 8) memcpy(data.plant_sha256, wrong, sizeof wrong);
    const pb_status status = pb_snapshot_write(path, &data, &err);
    if (status != PB_ERR_ARGUMENT) fail_msg("case %d: %s", i, pb_status_name(status));
    assert_int_equal(access(path, F_OK), -1);
  }
}

// What was there stays, and nothing is left beside it (tear_down sees to that).
static void test_failed_writes(void **state) {
  (void)state;
  pb_snapshot_data data = example(), next = example(), out;
  char elsewhere[128];
  pb_error err = {0};
  snprintf(elsewhere, sizeof elsewhere, "%s/none/a", directory);
  assert_int_equal(pb_snapshot_write(elsewhere, &data, &err), PB_ERR_IO);
  assert_string_equal(err.where, elsewhere);
  assert_int_equal(pb_snapshot_write(directory, &data, &err), PB_ERR_IO);
  for (int i = 0; i < 1000; i++) {
    snprintf(elsewhere, sizeof elsewhere, "%s.%03d", directory, i);
    assert_int_equal(access(elsewhere, F_OK), -1);
  }
  assert_int_equal(pb_snapshot_write(path, &data, &err), PB_OK);
  struct rlimit limit, small;
  signal(SIGXFSZ, SIG_IGN);
  assert_int_equal(getrlimit(RLIMIT_FSIZE, &limit), 0);
  small = limit;
  small.rlim_cur = 200;
  assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
  next.step = 99;
  const pb_status status = pb_snapshot_write(path, &next, &err);
  setrlimit(RLIMIT_FSIZE, &limit);
  signal(SIGXFSZ, SIG_DFL);
  assert_int_equal(status, PB_ERR_IO);
  assert_non_null(strstr(err.message, strerror(EFBIG)));
  assert_int_equal(pb_snapshot_read(path, &out, &err), PB_OK);
  assert_equal_data(&data, &out);
  pb_snapshot_clear(&out);
}

// A name that a killed writer left is passed over, not written to.
static void test_left_files_are_passed_over(void **state) {
  (void)state;
  pb_snapshot_data data = example(), out;
  char left[128];
  snprintf(left, sizeof left, "%s.000", path);
  const int fd = open(left, O_CREAT | O_EXCL | O_WRONLY, 0600);
  assert_true(fd >= 0);
  close(fd);
  REQUIRE(pb_snapshot_write(path, &data, &err));
  REQUIRE(pb_snapshot_read(path, &out, &err));
  pb_snapshot_clear(&out);
  struct stat info;
  assert_int_equal(stat(left, &info), 0);
  assert_int_equal(info.st_size, 0);
  unlink(left);
}

// The state of a model continues from the file bit for bit, and fits no other model.
static void test_state_of_a_model(void **state) {
  (void)state;
  static const double in[] = {1}, out_of[] = {1, 2};
  const test_mode mode[] = {{3, 0.01, in, out_of}, {40, 0.02, in, out_of}};
  pb_model *model = test_model(mode, 2, 1, 2, 1000, NULL);
  pb_model *fewer = test_model(mode, 1, 1, 2, 1000, NULL);
  pb_model *slower = test_model(mode, 2, 1, 2, 500, NULL);
  pb_state *x = pb_state_new(model);
  for (int k = 0; k < 100; k++) pb_step_advance(model, x, (double[]){sin(k)});
  char nothing[] = "[]";
  pb_snapshot_data data = example(), out;
  data.step = x->step;
  data.sample_rate = model->sample_rate;
  data.nx = model->nx, data.nu = model->nu, data.ny = model->ny;
  data.state = x;
  data.state_bytes = pb_state_bytes(model);
  data.host_text = nothing;
  data.host_bytes = 0;
  REQUIRE(pb_snapshot_write(path, &data, &err));
  REQUIRE(pb_snapshot_read(path, &out, &err));
  REQUIRE(pb_snapshot_check(&out, model, &err));
  pb_error err = {0};
  assert_int_equal(pb_snapshot_check(&out, fewer, &err), PB_ERR_STATE);
  assert_int_equal(pb_snapshot_check(&out, slower, &err), PB_ERR_STATE);
  out.step++;
  assert_int_equal(pb_snapshot_check(&out, model, &err), PB_ERR_STATE);
  for (int k = 100; k < 200; k++) {
    double y[2], z[2];
    pb_step_output(model, x, y);
    pb_step_output(model, out.state, z);
    assert_memory_equal(y, z, sizeof y);
    pb_step_advance(model, x, (double[]){sin(k)});
    pb_step_advance(model, out.state, (double[]){sin(k)});
  }
  pb_snapshot_clear(&out);
  free(x);
  pb_model_free(model);
  pb_model_free(fewer);
  pb_model_free(slower);
}

static void test_names(void **state) {
  (void)state;
  static const char *const good[] = {"a", "run-1.snap", "_", "-x", "A.B_c-9", "a..b"};
  static const char *const bad[] = {"",    ".",    "..",   ".a",        "a/b", "/a",
                                    "a b", "a\\b", "a\nb", "n\xc3\xa9", "a:b", "a%"};
  for (size_t i = 0; i < sizeof good / sizeof *good; i++)
    if (!pb_snapshot_name_valid(good[i])) fail_msg("'%s' is refused", good[i]);
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
    if (pb_snapshot_name_valid(bad[i])) fail_msg("'%s' is accepted", bad[i]);
  char name[102];
  memset(name, 'a', sizeof name);
  name[101] = '\0';
  assert_false(pb_snapshot_name_valid(name));
  name[100] = '\0';
  assert_true(pb_snapshot_name_valid(name));
}

#define IN_DIRECTORY(test) cmocka_unit_test_setup_teardown(test, set_up, tear_down)

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_hash_value),
      cmocka_unit_test(test_hash_tells_apart),
      cmocka_unit_test(test_names),
      IN_DIRECTORY(test_round_trip),
      IN_DIRECTORY(test_layout),
      IN_DIRECTORY(test_altered_files),
      IN_DIRECTORY(test_forged_files),
      IN_DIRECTORY(test_foreign_paths),
      IN_DIRECTORY(test_data_that_are_refused),
      IN_DIRECTORY(test_failed_writes),
      IN_DIRECTORY(test_left_files_are_passed_over),
      IN_DIRECTORY(test_state_of_a_model),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
