// Text tables and the progress line.
#include "table.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "interrupt.h"
#include "progress.h"

#include <signal.h>

static void test_layout(void **state) {
  (void)state;
  pb_table table = {0};
  pb_table_text_column(&table, "mode");
  pb_table_number_column(&table, "frequency", "Hz", 5);
  pb_table_number_column(&table, "ζ", "", 3);
  pb_table_text(&table, "été");
  pb_table_number(&table, 93.7123456);
  pb_table_number(&table, 0.01);
  pb_table_text(&table, "b");
  pb_table_number(&table, 12345678.9);
  pb_table_number(&table, INFINITY);
  pb_table_text(&table, NULL);
  pb_table_number(&table, 0);
  pb_table_number(&table, -2.5e-7);
  char *text = NULL;
  size_t size = 0;
  FILE *stream = open_memstream(&text, &size);
  pb_error err = {0};
  assert_int_equal(pb_table_print(&table, stream, 2, &err), PB_OK);
  fclose(stream);
  assert_string_equal(text, "  mode  frequency [Hz]          ζ\n"
                            "  ────  ──────────────  ─────────\n"
                            "  été           93.712     0.0100\n"
                            "  b         1.2346e+07          –\n"
                            "                     0  -2.50e-07\n");
  free(text);
  pb_table_free(&table);
}

static void test_unfinished_row(void **state) {
  (void)state;
  pb_table table = {0};
  pb_table_number_column(&table, "a", NULL, 3);
  pb_table_number_column(&table, "b", NULL, 3);
  pb_table_number(&table, 1);
  pb_error err = {0};
  assert_int_equal(pb_table_print(&table, stderr, 0, &err), PB_ERR_ARGUMENT);
  pb_table_free(&table);
}

// In a pipe or a file the progress line writes nothing.
static void test_progress_silent(void **state) {
  (void)state;
  FILE *stream = tmpfile();
  assert_non_null(stream);
  pb_progress progress;
  pb_progress_begin(&progress, stream, "identify");
  assert_false(progress.on);
  pb_progress_update(&progress, 1, 2, "note");
  pb_progress_end(&progress);
  fflush(stream);
  assert_int_equal(ftell(stream), 0);
  // As on a terminal: redrawn once at most in a tenth of a second, cleared at the end.
  progress.on = true;
  pb_progress_update(&progress, 1, 2, "note");
  long once = ftell(stream);
  pb_progress_update(&progress, 2, 2, "note");
  assert_int_equal(ftell(stream), once);
  pb_progress_end(&progress);
  char text[256] = {0};
  rewind(stream);
  assert_true(fread(text, 1, sizeof text - 1, stream) > 0);
  assert_non_null(strstr(text, "identify [############............]  50 %"));
  assert_non_null(strstr(text, "note\r\033[K"));
  fclose(stream);
}

static void test_interrupt(void **state) {
  (void)state;
  pb_interrupt_install();
  assert_false(pb_interrupted());
  raise(SIGTERM);
  assert_true(pb_interrupted());
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_layout),
      cmocka_unit_test(test_unfinished_row),
      cmocka_unit_test(test_progress_silent),
      cmocka_unit_test(test_interrupt),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
