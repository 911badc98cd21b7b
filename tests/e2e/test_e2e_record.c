// plantbus-record and plantbus-replay with the real daemon: a lockstep run recorded completely,
// exported and played back; real time without gaps; a reset on the way; ends of every kind.
#include <matio.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "harness.h"
#include "plant/plant.h"
#include "recording.h"
#include "session_internal.h"
#include "unit/mcap_parse.h"

enum { STEPS = 2000 };
static double last_output;  // of the run that is recorded first
static char folder[] = "/tmp/pb-record-XXXXXX";

static const char *path_of(const char *name) {
  static char path[8][256];
  static int next;
  char *p = path[next++ % 8];
  snprintf(p, sizeof path[0], "%s/%s", folder, name);
  return p;
}

static int make_folder(void **state) {
  (void)state;
  return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state) {
  (void)state;
  const char *const name[] = {"a.mcap", "a-2.mcap", "a-3.mcap", "a-4.mcap",  "a-5.mcap",
                              "b.mcap", "a.csv",    "a.mat",    "plant.json"};
  for (size_t i = 0; i < sizeof name / sizeof *name; i++) unlink(path_of(name[i]));
  return rmdir(folder);  // fails when a temporary file was left
}

// ---- helpers ------------------------------------------------------------------------------------

// A tool on the daemon's domain, with more arguments (NULL-terminated).
static e2e_child tool(const char *name, const e2e_daemon *daemon, const char *const *more) {
  char file[256], domain[16];
  const char *argv[24] = {file, "--domain", domain};
  snprintf(file, sizeof file, PB_BIN "/%s", name);
  snprintf(domain, sizeof domain, "%u", daemon->domain);
  for (int n = 3; *more && n < 23; n++) argv[n] = *more++;
  return e2e_spawn(argv);
}

static e2e_child recorder_start(const e2e_daemon *daemon, const char *const *more) {
  char line[256];
  const char *argv[20] = {"--force"};
  for (int n = 1; *more && n < 19; n++) argv[n] = *more++;
  e2e_child child = tool("plantbus-record", daemon, argv);
  e2e_expect_line(&child, "recording bus-bench", line);
  return child;
}

static double excitation(uint64_t step) {
  return (double)((step * 7919u) % 1000u) / 333.0 - 1.5;
}

// What a client saw: samples 0 … STEPS.
typedef struct witness {
  uint64_t count, last;
  double u[STEPS + 1][2], y[STEPS + 1][2];
} witness;

static bool drive(void *context, const pb_sample *sample, double *command) {
  witness *w = context;
  if (sample->step > w->last) return false;
  assert_int_equal(sample->step, w->count);
  memcpy(w->u[w->count], sample->input, sizeof w->u[0]);
  memcpy(w->y[w->count], sample->output, sizeof w->y[0]);
  w->count++;
  command[0] = excitation(sample->step);
  return sample->step < w->last;
}

// The daemon and a recorder of commands: a writer sends only to the readers that it knows.
static bool two_hear_commands(void *context) {
  const pb_session *session = context;
  dds_publication_matched_status_t status;
  return dds_get_publication_matched_status(session->command, &status) == DDS_RETCODE_OK &&
         status.current_count == 2;
}

// A reader answers for what was written only when it knows the writer, too; what comes before is
// lost on it. The command is nobody's, and refused.
static void recorder_hears(pb_session *session) {
  const plantbus_Command nobodys = {.session = UINT64_MAX};
  e2e_until(two_hear_commands, session, "a recorder of commands");
  assert_int_equal(dds_write(session->command, &nobodys), DDS_RETCODE_OK);
  assert_int_equal(dds_wait_for_acks(session->command, (dds_duration_t)(E2E_CAP * 1e9)),
                   DDS_RETCODE_OK);
}

static void drive_to(pb_session *session, witness *w, uint64_t last, bool commands_recorded) {
  const pb_run_options options = {.on_sample = drive, .context = w, .stall = E2E_CAP};
  pb_error err = {PB_OK, "", ""};
  w->count = 0;
  w->last = last;
  e2e_attach(session, "test", "Va", 0.0);
  if (commands_recorded) recorder_hears(session);
  if (pb_session_run(session, &options, NULL, &err)) fail_msg("%s: %s", err.where, err.message);
  pb_session_detach(session);
  assert_int_equal(w->count, last + 1);
}

static pb_recording *open_recording(void) {
  pb_recording *r = NULL;
  pb_error err = {PB_OK, "", ""};
  if (pb_recording_open(path_of("a.mcap"), &r, &err)) fail_msg("%s: %s", err.where, err.message);
  return r;
}

// ---- the complete run ---------------------------------------------------------------------------

typedef struct comparison {
  const witness *witness;
  uint64_t count;
} comparison;

static pb_status compare(void *context, const plantbus_Sample *x, pb_error *err) {
  (void)err;
  comparison *c = context;
  assert_int_equal(x->step, c->count);
  assert_int_equal(x->time_ns, (int64_t)c->count * 100000);
  assert_int_equal(x->input_count, 2);
  assert_memory_equal(x->input, c->witness->u[c->count], sizeof c->witness->u[0]);
  assert_memory_equal(x->output, c->witness->y[c->count], sizeof c->witness->y[0]);
  c->count++;
  return PB_OK;
}

static void check_recording(const witness *w, pb_session *session) {
  pb_recording *r = open_recording();
  pb_error err;
  const pb_description *d = pb_session_description(session);
  assert_true(r->file.complete);
  assert_string_equal(r->plant, "bus-bench");
  assert_int_equal(r->revisions, 1);
  assert_string_equal(r->revision[0].plant_text, d->plant_text);
  assert_string_equal(r->revision[0].sha256, d->plant_sha256);
  assert_string_equal(r->revision[0].software, PB_VERSION);
  assert_true(r->revision[0].sample_rate == 10000.0);
  assert_string_equal(r->revision[0].inputs.name[1], "F");
  assert_string_equal(r->revision[0].outputs.unit[1], "m");
  assert_int_equal(r->spans.count, 1);
  assert_int_equal(r->spans.gaps, 0);
  assert_int_equal(r->spans.samples, STEPS + 1);
  assert_true(r->events >= 1 && r->statuses >= 1);
  assert_string_equal(r->event[0].kind, "attached");
  if (r->commands < STEPS) fail_msg("%llu commands of %d", (unsigned long long)r->commands, STEPS);
  comparison c = {w, 0};
  assert_int_equal(pb_recording_samples(r, compare, &c, &err), PB_OK);
  assert_int_equal(c.count, STEPS + 1);
  assert_true(w->y[STEPS][1] != 0.0);  // the plant did move
  pb_recording_free(r);
}

static void check_csv(const witness *w) {
  FILE *stream = fopen(path_of("a.csv"), "r");
  char line[512];
  assert_non_null(stream);
  assert_non_null(fgets(line, sizeof line, stream));
  assert_string_equal(line, "time [s],step,epoch,revision,flags,Va [V],F [N],Vs [V],y [m]\n");
  for (uint64_t k = 0; k <= STEPS; k++) {
    assert_non_null(fgets(line, sizeof line, stream));
    char *at = line;
    double cell[9];
    for (int i = 0; i < 9; i++) cell[i] = strtod(at, &at), at++;
    assert_true(cell[0] == (double)k / 10000.0 && cell[1] == (double)k);
    assert_memory_equal(&cell[5], w->u[k], sizeof w->u[0]);
    assert_memory_equal(&cell[7], w->y[k], sizeof w->y[0]);
  }
  assert_null(fgets(line, sizeof line, stream));
  fclose(stream);
}

static void check_matrix(mat_t *mat, const char *name, const double *wanted, size_t rows) {
  matvar_t *v = Mat_VarRead(mat, name);
  assert_non_null(v);
  assert_int_equal(v->dims[0], rows);
  assert_int_equal(v->dims[1], 2);
  const double *data = v->data;  // column-major; wanted row by row
  for (size_t k = 0; k < rows; k++)
    for (size_t i = 0; i < 2; i++)
      assert_memory_equal(&data[i * rows + k], &wanted[2 * k + i], sizeof *data);
  Mat_VarFree(v);
}

static void check_mat(const witness *w) {
  mat_t *mat = Mat_Open(path_of("a.mat"), MAT_ACC_RDONLY);
  assert_non_null(mat);
  check_matrix(mat, "u", w->u[0], STEPS + 1);
  check_matrix(mat, "y", w->y[0], STEPS + 1);
  matvar_t *names = Mat_VarRead(mat, "output_names");
  assert_non_null(names);
  assert_int_equal(names->dims[0], 2);
  Mat_VarFree(names);
  Mat_Close(mat);
}

static void expect_identical(const e2e_daemon *daemon, const char *command) {
  char line[256];
  const char *const more[] = {command, path_of("a.mcap"), "--tolerance", "0", NULL};
  e2e_child child = tool("plantbus-replay", daemon, more);
  e2e_expect_line(&child, "2001 samples: identical to the bit", line);
  assert_int_equal(e2e_reap(&child), 0);
}

static void a_lockstep_run_is_recorded_and_repeated(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  const char *const more[] = {"-o",       path_of("a.mcap"),
                              "--csv",    path_of("a.csv"),
                              "--mat",    path_of("a.mat"),
                              "--steps",  "2001",
                              "--topics", "sample,event,status,command",
                              NULL};
  e2e_child recorder = recorder_start(&daemon, more);
  pb_session *session = e2e_open(&daemon);
  witness *w = calloc(1, sizeof *w);
  assert_non_null(w);
  drive_to(session, w, STEPS, true);
  assert_int_equal(e2e_reap(&recorder), 0);
  const mcap_parse_counts n = mcap_parse(path_of("a.mcap"));
  assert_int_equal(n.schemas, 4);
  assert_int_equal(n.channels, 4);
  assert_int_equal(n.attachments, 2);
  assert_int_equal(n.metadata, 2);
  check_recording(w, session);
  check_csv(w);
  check_mat(w);
  last_output = w->y[STEPS][1];
  expect_identical(&daemon, "verify");
  expect_identical(&daemon, "play");
  free(w);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

// Turns a bit of the last output in the file and gives up the CRCs that cover it (0: not checked).
static void falsify(const char *path, double value) {
  FILE *stream = fopen(path, "r+b");
  assert_non_null(stream);
  static uint8_t content[8 << 20];
  const size_t size = fread(content, 1, sizeof content, stream);
  uint8_t *found = NULL;
  for (size_t at = 8; at + 9 < size;) {
    uint64_t length;
    memcpy(&length, content + at + 1, 8);
    uint8_t *inside = content + at + 9;
    if (content[at] == 6) memset(inside + 24, 0, 4);  // chunk
    if (content[at] == 15) memset(inside, 0, 4);      // end of the data section
    uint8_t *hit = content[at] == 6 ? memmem(inside, length, &value, sizeof value) : NULL;
    found = hit ? hit : found;
    at += 9 + length;
    if (content[at - 9 - length] == 15) break;
  }
  assert_non_null(found);
  found[0] ^= 1;
  rewind(stream);
  assert_int_equal(fwrite(content, 1, size, stream), size);
  assert_int_equal(fclose(stream), 0);
}

// The recording of the first test, with one bit of one output turned.
static void a_deviation_of_one_bit_is_told(void **state) {
  (void)state;
  const e2e_daemon nowhere = {.domain = 0};
  const char *const judged[] = {"verify", path_of("a.mcap"), "--tolerance", "0", NULL};
  const char *const told[] = {"verify", path_of("a.mcap"), NULL};
  char line[256];
  falsify(path_of("a.mcap"), last_output);
  e2e_child child = tool("plantbus-replay", &nowhere, told);
  e2e_expect_line(&child, "1 of 2001 samples differ", line);
  assert_int_equal(e2e_reap(&child), 0);
  child = tool("plantbus-replay", &nowhere, judged);
  assert_int_equal(e2e_reap(&child), 1);
}

// The recording of the first test, on a plant that is not the same.
static void play_refuses_another_plant_file(void **state) {
  (void)state;
  FILE *from = fopen(E2E_BENCH, "r"), *to = fopen(path_of("plant.json"), "w");
  char text[4096];
  assert_true(from && to);
  text[fread(text, 1, sizeof text - 1, from)] = '\0';
  char *mass = strstr(text, "\"mass\": 5");
  assert_non_null(mass);
  mass[8] = '6';
  fputs(text, to);
  fclose(from);
  assert_int_equal(fclose(to), 0);
  e2e_daemon daemon = e2e_daemon_start(path_of("plant.json"), NULL);
  const char *const more[] = {"play", path_of("a.mcap"), NULL};
  e2e_child child = tool("plantbus-replay", &daemon, more);
  assert_int_equal(e2e_reap(&child), 1);
  e2e_daemon_end(&daemon);
}

static void export_chooses_and_writes_the_plant_file(void **state) {
  (void)state;
  const e2e_daemon nowhere = {.domain = 0};
  const char *const more[] = {"export",      path_of("a.mcap"),
                              "--csv",       path_of("a.csv"),
                              "--from",      "0.01",
                              "--to",        "0.0102",
                              "--signals",   "y,Va",
                              "--plant-out", path_of("plant.json"),
                              NULL};
  e2e_child child = tool("plantbus-replay", &nowhere, more);
  assert_int_equal(e2e_reap(&child), 0);
  FILE *stream = fopen(path_of("a.csv"), "r");
  char line[512];
  assert_non_null(stream);
  assert_non_null(fgets(line, sizeof line, stream));
  assert_string_equal(line, "time [s],step,epoch,revision,flags,Va [V],y [m]\n");
  for (int k = 100; k <= 102; k++) {
    assert_non_null(fgets(line, sizeof line, stream));
    assert_int_equal(atoi(strchr(line, ',') + 1), k);
  }
  assert_null(fgets(line, sizeof line, stream));
  fclose(stream);
  pb_plant *wrote = NULL, *original = NULL;
  assert_int_equal(pb_plant_load(path_of("plant.json"), NULL, &wrote, NULL), PB_OK);
  assert_int_equal(pb_plant_load(E2E_BENCH, NULL, &original, NULL), PB_OK);
  assert_string_equal(wrote->text, original->text);
  pb_plant_free(wrote);
  pb_plant_free(original);
}

// ---- resets, real time, ends --------------------------------------------------------------------

static void a_reset_begins_a_second_epoch(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  const char *const more[] = {"-o", path_of("a.mcap"), "--steps", "302", "--compression", "zstd",
                              NULL};
  e2e_child recorder = recorder_start(&daemon, more);
  pb_session *session = e2e_open(&daemon);
  witness *w = calloc(1, sizeof *w);
  assert_non_null(w);
  drive_to(session, w, 100, false);
  e2e_request(session, "reset", NULL);
  drive_to(session, w, 200, false);
  assert_int_equal(e2e_reap(&recorder), 0);
  pb_recording *r = open_recording();
  assert_int_equal(r->spans.count, 2);
  assert_int_equal(r->spans.gaps, 0);
  assert_int_equal(r->spans.span[0].last_step, 100);
  assert_int_equal(r->spans.span[1].last_step, 200);
  assert_int_equal(r->spans.span[1].first_step, 0);
  assert_true(r->spans.span[1].epoch > r->spans.span[0].epoch);
  pb_recording_free(r);
  free(w);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

// What a second writer of descriptions says, another daemon of this name, is left out.
static void a_changed_description_is_a_second_revision(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  const char *const more[] = {"-o", path_of("a.mcap"), NULL};
  e2e_child recorder = recorder_start(&daemon, more);
  pb_session *session = e2e_open(&daemon);
  e2e_raw raw = e2e_raw_join(&daemon);
  const dds_entity_t writer = e2e_raw_writer(&raw, PB_TOPIC_DESCRIPTION);
  const plantbus_PlantDescription other = {.name = "bus-bench",
                                           .revision = 7,
                                           .sample_rate = 5000,
                                           .plant_text = "{}",
                                           .plant_sha256 = "02",
                                           .software_version = "other"};
  assert_int_equal(dds_write(writer, &other), DDS_RETCODE_OK);
  assert_int_equal(dds_wait_for_acks(writer, DDS_SECS(5)), DDS_RETCODE_OK);
  e2e_change(
      session, "configure",
      "{\"patch\": {\"outputs\": [{\"name\": \"y\", \"type\": \"displacement\", \"frame\": "
      "\"mass\","
      " \"direction\": [0, 0, 1]}, {\"name\": \"v\", \"type\": \"velocity\", \"frame\": \"mass\","
      " \"direction\": [0, 0, 1]}]}}",
      "revision");
  pb_session_close(session);
  assert_int_equal(kill(recorder.pid, SIGINT), 0);
  assert_int_equal(e2e_reap(&recorder), 0);
  pb_recording *r = open_recording();
  assert_int_equal(r->revisions, 2);
  assert_string_equal(r->revision[0].attachment, "plant.json");
  assert_string_equal(r->revision[1].attachment, "plant-r2.json");
  assert_non_null(strstr(r->revision[1].plant_text, "velocity"));
  assert_string_equal(r->revision[1].outputs.name[1], "v");
  assert_string_equal(r->revision[1].outputs.unit[1], "m/s");
  assert_true(r->revision[1].packed_count > 0);
  pb_recording_free(r);
  dds_delete(raw.participant);
  e2e_daemon_end(&daemon);
}

static bool file_is_there(void *context) {
  return access(path_of(context), F_OK) == 0;
}

// ---- all of it ----------------------------------------------------------------------------------

// The plant's step is the same as a moment ago, but for the first.
static bool stands_still(void *context) {
  static double last;
  const double step = e2e_number(context, "ping", NULL, "step");
  const bool same = step > 0 && step == last;
  last = step;
  return same;
}

// More than the middleware holds back: the plant waits for a recorder that stands still, and in a
// block, where every sample is recorded too.
static void lockstep_waits_for_a_recorder(void **state) {
  (void)state;
  enum { COUNT = 60000, BLOCK = 500 };
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  const char *const more[] = {"-o", path_of("a.mcap"), "--compression", "lz4", NULL};
  e2e_child recorder = recorder_start(&daemon, more);
  pb_session *session = e2e_open(&daemon);
  e2e_raw raw = e2e_raw_join(&daemon);
  const dds_entity_t event = e2e_raw_reader(&raw, PB_TOPIC_EVENT);
  char message[320];
  assert_int_equal(kill(recorder.pid, SIGSTOP), 0);
  e2e_request(session, "step", "{\"n\": 60000}");
  e2e_until(stands_still, session, "a plant that waits");
  assert_true(e2e_number(session, "ping", NULL, "step") < COUNT);
  assert_int_equal(kill(recorder.pid, SIGCONT), 0);
  e2e_event_wait(event, "stepped", message);
  pb_block block = {0};
  pb_error err;
  assert_int_equal(pb_session_block(session, NULL, 0, NULL, BLOCK, E2E_CAP, &block, &err), PB_OK);
  pb_block_clear(&block);
  e2e_request(session, "ping", NULL);
  assert_int_equal(kill(recorder.pid, SIGINT), 0);
  assert_int_equal(e2e_reap(&recorder), 0);
  pb_recording *r = open_recording();
  assert_int_equal(r->spans.samples, COUNT + BLOCK + 1);
  assert_int_equal(r->spans.gaps, 0);
  pb_recording_free(r);
  dds_delete(raw.participant);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
}

static void expect_part(const char *name, uint64_t samples, uint64_t first) {
  pb_recording *whole = NULL, *told = NULL;
  pb_error err;
  if (pb_recording_open(path_of(name), &whole, &err)) fail_msg("%s: %s", err.where, err.message);
  assert_int_equal(pb_recording_open_index(path_of(name), &told, &err), PB_OK);
  assert_true(whole->file.complete);
  assert_int_equal(whole->spans.count, 1);
  assert_int_equal(whole->spans.samples, samples);
  assert_int_equal(whole->spans.span[0].first_step, first);
  assert_int_equal(whole->spans.gaps, 0);
  assert_non_null(whole->revision[0].plant_text);
  assert_memory_equal(whole->spans.span, told->spans.span, sizeof *told->spans.span);
  assert_int_equal(told->spans.samples, samples);
  assert_int_equal(told->events, whole->events);
  assert_int_equal(told->statuses, whole->statuses);
  assert_string_equal(told->plant, whole->plant);
  assert_string_equal(told->revision[0].plant_text, whole->revision[0].plant_text);
  pb_recording_free(whole);
  pb_recording_free(told);
}

// A daemon that is started anew counts its steps anew, and gets a file of its own; each file is
// also split where it is long.
static void the_recorder_waits_for_another_daemon(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  const char *const more[] = {"-o", path_of("a.mcap"), "--split-time", "0.01", "--sync", "0.1",
                              NULL};
  e2e_child recorder = recorder_start(&daemon, more);
  pb_session *session = e2e_open(&daemon);
  witness *w = calloc(1, sizeof *w);
  assert_non_null(w);
  drive_to(session, w, 250, false);
  pb_session_close(session);
  e2e_daemon_end(&daemon);
  daemon = e2e_daemon_start_on(daemon.domain, E2E_BENCH, NULL);
  session = e2e_open(&daemon);
  e2e_until(file_is_there, "a-4.mcap", "a file for the other daemon");
  drive_to(session, w, 50, false);
  pb_session_close(session);
  assert_int_equal(kill(recorder.pid, SIGINT), 0);
  assert_int_equal(e2e_reap(&recorder), 0);
  expect_part("a.mcap", 100, 0);
  expect_part("a-2.mcap", 100, 100);
  expect_part("a-3.mcap", 51, 200);
  expect_part("a-4.mcap", 51, 0);
  free(w);
  e2e_daemon_end(&daemon);
}

// A file that is there, a disk that is too full: nothing is lost, and it is told.
static void what_is_there_is_kept(void **state) {
  (void)state;
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
  const char *const there[] = {"-o", path_of("plant.json"), NULL};
  e2e_child child = tool("plantbus-record", &daemon, there);
  assert_int_equal(e2e_reap(&child), 1);
  pb_plant *plant = NULL;
  assert_int_equal(pb_plant_load(path_of("plant.json"), NULL, &plant, NULL), PB_OK);
  pb_plant_free(plant);
  const char *const full[] = {"-o", path_of("a.mcap"), "--min-free", "9000000G", NULL};
  child = recorder_start(&daemon, full);
  assert_int_equal(e2e_reap(&child), 1);
  pb_recording *r = open_recording();
  assert_true(r->file.complete);
  pb_recording_free(r);
  e2e_daemon_end(&daemon);
}

// 10 kHz of plant time at a tenth of its speed.
static void real_time_has_no_gaps(void **state) {
  (void)state;
  const char *const realtime[] = {"--mode", "realtime", "--speed", "0.1", NULL};
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, realtime);
  const char *const more[] = {"-o", path_of("a.mcap"), "--duration", "0.1", NULL};
  e2e_child recorder = recorder_start(&daemon, more);
  assert_int_equal(e2e_reap(&recorder), 0);
  pb_recording *r = open_recording();
  assert_int_equal(r->spans.samples, 1000);
  assert_int_equal(r->spans.gaps, 0);
  assert_int_equal(r->spans.span[0].last_step - r->spans.span[0].first_step, 999);
  assert_true(r->log_last > r->log_first);
  pb_recording_free(r);
  e2e_daemon_end(&daemon);
}

static bool file_has_grown(void *context) {
  (void)context;
  struct stat info;
  return stat(path_of("a.mcap"), &info) == 0 && info.st_size > 1200000;  // a whole chunk at least
}

// The file cut once more, within a chunk: whole, and with all of its whole messages.
static void expect_repaired(void) {
  struct stat info;
  pb_recording *cut = open_recording(), *mended = NULL;
  pb_error err;
  assert_int_equal(stat(path_of("a.mcap"), &info), 0);
  const uint64_t samples = cut->spans.samples;
  pb_recording_free(cut);
  assert_int_equal(truncate(path_of("a.mcap"), info.st_size - 5000), 0);
  const e2e_daemon nowhere = {.domain = 0};
  const char *const more[] = {"repair", path_of("a.mcap"), "-o", path_of("b.mcap"), NULL};
  e2e_child child = tool("plantbus-replay", &nowhere, more);
  assert_int_equal(e2e_reap(&child), 0);
  mcap_parse(path_of("b.mcap"));
  assert_int_equal(pb_recording_open(path_of("b.mcap"), &mended, &err), PB_OK);
  assert_true(mended->file.complete);
  assert_true(mended->spans.samples + 12 > samples);
  assert_int_equal(mended->spans.gaps, 0);
  assert_string_equal(mended->plant, "bus-bench");
  pb_recording_free(mended);
  child = tool("plantbus-replay", &nowhere, more);  // it is there already
  assert_int_equal(e2e_reap(&child), 1);
  unlink(path_of("b.mcap"));
}

// SIGINT ends the file in order; SIGKILL leaves what was flushed.
static void end_by_signal(int number, int status, bool complete) {
  const char *const realtime[] = {"--mode", "realtime", "--speed", "0.1", NULL};
  e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, realtime);
  const char *const more[] = {"-o", path_of("a.mcap"), NULL};
  unlink(path_of("a.mcap"));
  e2e_child recorder = recorder_start(&daemon, more);
  e2e_until(file_has_grown, NULL, "samples in the file");
  assert_int_equal(kill(recorder.pid, number), 0);
  assert_int_equal(e2e_reap(&recorder), status);
  pb_recording *r = open_recording();
  assert_int_equal(r->file.complete, complete);
  assert_non_null(r->revision[0].plant_text);
  assert_true(r->spans.samples > 0);
  if (complete) mcap_parse(path_of("a.mcap"));
  pb_recording_free(r);
  if (!complete) expect_repaired();
  e2e_daemon_end(&daemon);
}

static void an_interrupted_recording_is_complete(void **state) {
  (void)state;
  end_by_signal(SIGINT, 0, true);
}

static void a_killed_recorder_leaves_a_readable_file(void **state) {
  (void)state;
  end_by_signal(SIGKILL, -SIGKILL, false);
}

static void the_end_of_the_daemon_ends_the_recording(void **state) {
  (void)state;
  for (int limited = 0; limited < 2; limited++) {
    e2e_daemon daemon = e2e_daemon_start(E2E_BENCH, NULL);
    const char *const more[] = {
        "-o", path_of("a.mcap"), "--until-gone", limited ? "--steps" : NULL, "100", NULL};
    e2e_child recorder = recorder_start(&daemon, more);
    e2e_daemon_end(&daemon);
    assert_int_equal(e2e_reap(&recorder), limited);  // it did not get what it was to record
    pb_recording *r = open_recording();
    assert_true(r->file.complete);
    pb_recording_free(r);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_lockstep_run_is_recorded_and_repeated),
      cmocka_unit_test(play_refuses_another_plant_file),
      cmocka_unit_test(export_chooses_and_writes_the_plant_file),
      cmocka_unit_test(a_deviation_of_one_bit_is_told),
      cmocka_unit_test(a_reset_begins_a_second_epoch),
      cmocka_unit_test(a_changed_description_is_a_second_revision),
      cmocka_unit_test(lockstep_waits_for_a_recorder),
      cmocka_unit_test(the_recorder_waits_for_another_daemon),
      cmocka_unit_test(what_is_there_is_kept),
      cmocka_unit_test(real_time_has_no_gaps),
      cmocka_unit_test(an_interrupted_recording_is_complete),
      cmocka_unit_test(a_killed_recorder_leaves_a_readable_file),
      cmocka_unit_test(the_end_of_the_daemon_ends_the_recording),
  };
  return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
