// The monitor's views (clients/monitor): percentiles, lines that fit, and what a status becomes.
#include <stdlib.h>
#include <string.h>

#include "histogram.h"
#include "monitor.h"
#include "support/check.h"

static void percentiles_lie_in_their_bin(void **state) {
  (void)state;
  plantbus_Histogram h = {.count = 100, .largest = 1.0};
  assert_true(isnan(pb_histogram_percentile(&h, 0.5)));
  h.bin[10] = 99;  // 16 ns · 2^5 = 512 ns to 512 ns · √2
  h.bin[20] = 1;   // 16 ns · 2^10 = 16.384 µs and up
  const double p50 = pb_histogram_percentile(&h, 0.5);
  assert_true(p50 > 512e-9 && p50 < 512e-9 * sqrt(2.0));
  ASSERT_RELATIVE(p50, 16e-9 * exp2(5.0 + 0.5 * 50.0 / 99.0), 1e-12);
  ASSERT_RELATIVE(pb_histogram_percentile(&h, 0.99), 512e-9 * sqrt(2.0), 1e-12);
  ASSERT_RELATIVE(pb_histogram_percentile(&h, 1.0), 16.384e-6 * sqrt(2.0), 1e-12);
  h.largest = 17e-6;  // measured: no percentile is above it
  ASSERT_RELATIVE(pb_histogram_percentile(&h, 1.0), 17e-6, 1e-12);
}

static void lines_are_cut_and_cleaned(void **state) {
  (void)state;
  screen s = {.width = 6, .height = 2};
  screen_put(&s, SCREEN_ALARM, "aéb\033[2Jc");
  screen_line(&s);
  screen_put(&s, SCREEN_PLAIN, "x\n\xc2\x9by");
  screen_line(&s);
  screen_put(&s, SCREEN_PLAIN, "no room");
  screen_line(&s);
  assert_string_equal(s.text.text, "aéb?[2\nx??y");
  assert_int_equal(s.left_out, 1);
  free(s.text.text);
}

static void a_terminal_gets_escapes(void **state) {
  (void)state;
  screen s = {.width = 10, .height = 3, .terminal = true};
  screen_put(&s, SCREEN_BOLD, "a");
  screen_line(&s);
  screen_line(&s);
  assert_string_equal(s.text.text, "\033[K\033[1ma\033[0m\r\n\033[K\r\n");
  free(s.text.text);
}

// ---- a status with everything in it -------------------------------------------------------------

static char *input_name[] = {"Va"}, *input_unit[] = {"V"};
static char *output_name[] = {"y\033c"}, *output_unit[] = {"m"};

static plantbus_PlantDescription description(void) {
  return (plantbus_PlantDescription){.name = "bench",
                                     .sample_rate = 1000.0,
                                     .input_names = {1, 1, input_name, false},
                                     .input_units = {1, 1, input_unit, false},
                                     .output_names = {1, 1, output_name, false},
                                     .output_units = {1, 1, output_unit, false}};
}

static plantbus_Attached attached[] = {{.client_name = "loop[1]",
                                        .channel = "fb",
                                        .barrier = true,
                                        .acting = true,
                                        .waited = true,
                                        .priority = 3,
                                        .commands = 41,
                                        .late = 2,
                                        .age = 5,
                                        .age_max = 9}};
static plantbus_Hosted hosted[] = {
    {.channel = "noise", .kind = "multisine", .done = true, .client_name = "id[2]"}};
static uint64_t fault_step[] = {0, 17, 0, 0, 0};

static plantbus_PlantStatus status(void) {
  plantbus_PlantStatus p = {.name = "bench",
                            .mode = plantbus_LOCKSTEP,
                            .speed = 2.0,
                            .epoch = 2,
                            .revision = 4,
                            .step = 1500,
                            .faults = plantbus_FLAG_LATE,
                            .fault_steps = {5, 5, fault_step, false},
                            .refused = {.stale = 6},
                            .late = 2,
                            .overrun_policy = "skip",
                            .hash = 0xfedcba9876543210ULL,
                            .hash_step = 1499,
                            .real_time = "SCHED_FIFO: refused",
                            .attached = {1, 1, attached, false},
                            .hosted = {1, 1, hosted, false}};
  p.step_time.count = p.step_time.bin[10] = 4;
  p.step_time.largest = 1e-6;
  return p;
}

static void expect(const char *text, const char *part) {
  if (!strstr(text, part)) fail_msg("expected '%s' in: %s", part, text);
}

static void the_view_shows_everything(void **state) {
  (void)state;
  const plantbus_PlantDescription d = description();
  const plantbus_PlantStatus p = status();
  monitor_state m = {.description = &d, .status = &p, .events = 1, .has_sample = true, .seen = 3};
  snprintf(m.event[0].kind, sizeof m.event[0].kind, "late");
  m.sample = (plantbus_Sample){.step = 7, .epoch = 1, .input_count = 1, .output_count = 1};
  m.sample.output[0] = -2.5;
  m.least[plantbus_MAX_INPUTS] = -3.0;
  screen s = {0};
  monitor_view(&m, &s);
  expect(s.text.text, "lockstep  0 / 1000 steps/s (0 %)  epoch 2  revision 4\n");
  expect(s.text.text, "step 1500  t = 1.500000 s  hash fedcba9876543210 at 1499\n");
  expect(s.text.text, "*loop[1]");
  expect(s.text.text, "stands still, waits for loop[1]\n");
  expect(s.text.text, "hosted  multisine on noise, by id[2], done\n");
  expect(s.text.text, "refused  stale 6   late 2   overruns 0");
  expect(s.text.text, "on overrun: skip");
  expect(s.text.text, "step time   p50 0.609 µs");
  expect(s.text.text, "max 1 µs  of 4\n");
  expect(s.text.text, "SCHED_FIFO: refused\n");
  expect(s.text.text, "fault late  first at step 17\n");
  expect(s.text.text, "y?c [m]");
  expect(s.text.text, "-2.500000e+00");
  assert_null(strchr(s.text.text, '\033'));
  assert_null(strstr(s.text.text, "jitter"));
  free(s.text.text);
}

static size_t characters(const char *text, const char *end) {
  size_t count = 0;
  for (; text < end; text++) count += ((unsigned char)*text & 0xc0) != 0x80;
  return count;
}

// Whatever the width, no line reaches it without its end, and nothing that one steers by is cut.
static void the_view_fits_its_width(void **state) {
  (void)state;
  const plantbus_PlantDescription d = description();
  const plantbus_PlantStatus p = status();
  monitor_state m = {.description = &d, .status = &p, .has_sample = true, .seen = 12};
  m.sample.input_count = m.sample.output_count = 1;
  m.least[0] = -1.5;
  for (size_t width = 40; width <= 120; width += 5) {
    screen s = {.width = width};
    monitor_view(&m, &s);
    for (const char *line = s.text.text, *end; (end = strchr(line, '\n')); line = end + 1)
      if (characters(line, end) > width) fail_msg("%zu: %.*s", width, (int)(end - line), line);
    expect(s.text.text, "loop[1]");
    expect(s.text.text, "skipped");
    if (width >= 50) expect(s.text.text, "-1.50e+00");
    if (width >= 80) expect(s.text.text, "oldest");
    if (width >= 80) expect(s.text.text, "--|--");
    free(s.text.text);
  }
  screen s = {.width = 20};
  screen_flow(&s, SCREEN_PLAIN, 2, "one two three four five");
  screen_flow(&s, SCREEN_PLAIN, 2, "  six sevensevensevenseven");
  screen_line(&s);
  assert_string_equal(s.text.text, "one two three four\n  five  six\n  sevensevensevensev\n");
  free(s.text.text);
}

// Without colours what has one is bold.
static void colours_may_be_unwanted(void **state) {
  (void)state;
  screen s = {.width = 10, .height = 3, .terminal = true, .plain = true};
  screen_put(&s, SCREEN_ALARM, "a");
  screen_put(&s, SCREEN_DIM, "b");
  assert_string_equal(s.text.text, "\033[K\033[1ma\033[0m\033[2mb\033[0m");
  free(s.text.text);
}

static void realtime_is_measured_against_its_speed(void **state) {
  (void)state;
  const plantbus_PlantDescription d = description();
  plantbus_PlantStatus p = status();
  p.mode = plantbus_REALTIME;
  p.steps_per_second = 1900.0;
  const monitor_state m = {.description = &d, .status = &p};
  screen s = {0};
  monitor_line(&m, &s);
  expect(s.text.text, "bench realtime epoch 2 step 1500 revision 4 rate 1900/2000 hash ");
  expect(s.text.text, " faults late waits for loop[1]\n");
  free(s.text.text);
}

static void json_holds_what_the_status_does(void **state) {
  (void)state;
  const plantbus_PlantDescription d = description();
  const plantbus_PlantStatus p = status();
  monitor_state m = {.description = &d, .status = &p};
  cJSON *json = monitor_json(&m);
  assert_non_null(json);
  assert_string_equal(cJSON_GetObjectItem(json, "hash")->valuestring, "fedcba9876543210");
  const cJSON *refused = cJSON_GetObjectItem(json, "refused");
  assert_int_equal(cJSON_GetObjectItem(refused, "stale")->valueint, 6);
  const cJSON *fault = cJSON_GetArrayItem(cJSON_GetObjectItem(json, "faults"), 0);
  assert_string_equal(cJSON_GetObjectItem(fault, "fault")->valuestring, "late");
  assert_int_equal(cJSON_GetObjectItem(fault, "first_step")->valueint, 17);
  const cJSON *times = cJSON_GetObjectItem(json, "step_time");
  ASSERT_RELATIVE(cJSON_GetObjectItem(times, "max")->valuedouble, 1e-6, 1e-12);
  assert_true(cJSON_IsNull(cJSON_GetObjectItem(cJSON_GetObjectItem(json, "jitter"), "max")));
  const cJSON *y = cJSON_GetArrayItem(cJSON_GetObjectItem(json, "outputs"), 0);
  assert_true(cJSON_IsNull(cJSON_GetObjectItem(y, "value")));  // no sample was seen
  cJSON_Delete(json);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(percentiles_lie_in_their_bin),
      cmocka_unit_test(lines_are_cut_and_cleaned),
      cmocka_unit_test(a_terminal_gets_escapes),
      cmocka_unit_test(the_view_shows_everything),
      cmocka_unit_test(the_view_fits_its_width),
      cmocka_unit_test(colours_may_be_unwanted),
      cmocka_unit_test(realtime_is_measured_against_its_speed),
      cmocka_unit_test(json_holds_what_the_status_does),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
