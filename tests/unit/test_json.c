// Strict JSON: what is refused and where, numbers that survive, merge patches.
#include "support/check.h"

#include "base/json.h"
#include "base/text.h"

static void refuse(const char *text, const char *where, const char *part) {
  cJSON *value = NULL;
  pb_error err = {0};
  assert_int_equal(pb_json_parse(text, strlen(text), &value, &err), PB_ERR_SYNTAX);
  assert_null(value);
  assert_string_equal(err.where, where);
  if (!strstr(err.message, part)) fail_msg("\"%s\" does not say \"%s\"", err.message, part);
}

static void test_refused(void **state) {
  (void)state;
  refuse("{\"a\": 1, \"b\": {\"c\": 1, \"c\": 2}}", "/b/c", "twice");
  refuse("{\"a~/b\": 1, \"a~/b\": 2}", "/a~0~1b", "twice");
  refuse("{} x", "", "line 1, column 4");
  refuse("{\n \"a\": [1,\n 2", "", "line 3");
  refuse("{\"a\": [1, 1e999]}", "/a/1", "too large");
  refuse("", "", "not well-formed");
  refuse("{\"a\": nan}", "", "line 1");
  refuse("{\"a\": \"b\\u0000c\"}", "", "column 9: a NUL");
  refuse("{\"a\nb\": 1}", "", "control character");
  refuse("[\"\xc3(\"]", "", "not UTF-8");
  refuse("[\"\xed\xa0\x80\"]", "", "not UTF-8");  // half a surrogate pair
  static const char *const numbers[] = {"01", "-01", "3.", "-", "1e", "1e+", "-.5", "3.e1"};
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
    char text[16];
    snprintf(text, sizeof text, "[%s]", numbers[i]);
    refuse(text, "", "column 2: a number");
  }
  cJSON *value = NULL;
  pb_error err = {0};
  assert_int_equal(pb_json_parse("{}\0{}", 5, &value, &err), PB_ERR_SYNTAX);
  assert_non_null(strstr(err.message, "NUL"));
}

// What looks like an offence and is none.
static void test_accepted(void **state) {
  (void)state;
  static const char *const texts[] = {
      "[\"\\\\u0000\", \"01\", \"\\\"3.\", 0, -0, 0.5, -0.5e-01, 10, 1E+3]",
      "{\"\xc3\xa9\xe2\x9c\x93\xf0\x9f\x94\xa7\": \"\\u00e9\\n\"}",
  };
  for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
    cJSON *value = NULL;
    REQUIRE(pb_json_parse(texts[i], strlen(texts[i]), &value, &err));
    cJSON_Delete(value);
  }
}

static void test_case_matters(void **state) {
  (void)state;
  cJSON *value;
  REQUIRE(pb_json_parse("{\"A\": 1, \"a\": 2}", 16, &value, &err));
  assert_true(pb_json_member(value, "a")->valuedouble == 2);
  assert_null(pb_json_member(value, "B"));
  cJSON_Delete(value);
}

static void test_numbers_survive(void **state) {
  (void)state;
  const double numbers[] = {0.1, 1.0 / 3, 5e-324, 1.7976931348623157e308, 2.15e6, -0.0, 3e-9 / 7};
  for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
    cJSON *number = cJSON_CreateNumber(numbers[i]), *back = NULL;
    char *text = NULL;
    REQUIRE(pb_json_print_compact(number, &text, &err));
    REQUIRE(pb_json_parse(text, strlen(text), &back, &err));
    assert_memory_equal(&back->valuedouble, &numbers[i], sizeof(double));
    cJSON_Delete(number);
    cJSON_Delete(back);
    free(text);
  }
}

static void test_print(void **state) {
  (void)state;
  const char *compact = "{\"a\":[1,2.5,\"x\\\"y\"],\"b\":{},\"c\":[{\"d\":null}],\"e\":true}";
  const char *pretty = "{\n  \"a\": [1, 2.5, \"x\\\"y\"],\n  \"b\": {},\n  \"c\": [\n    {\n"
                       "      \"d\": null\n    }\n  ],\n  \"e\": true\n}\n";
  cJSON *value;
  char *text;
  REQUIRE(pb_json_parse(compact, strlen(compact), &value, &err));
  REQUIRE(pb_json_print_compact(value, &text, &err));
  assert_string_equal(text, compact);
  free(text);
  REQUIRE(pb_json_print(value, &text, &err));
  assert_string_equal(text, pretty);
  free(text);
  cJSON_Delete(value);
}

// The examples of RFC 7396, appendix A.
static void test_merge(void **state) {
  (void)state;
  static const char *const cases[][3] = {
      {"{\"a\":\"b\"}", "{\"a\":\"c\"}", "{\"a\":\"c\"}"},
      {"{\"a\":\"b\"}", "{\"b\":\"c\"}", "{\"a\":\"b\",\"b\":\"c\"}"},
      {"{\"a\":\"b\"}", "{\"a\":null}", "{}"},
      {"{\"a\":\"b\",\"b\":\"c\"}", "{\"a\":null}", "{\"b\":\"c\"}"},
      {"{\"a\":[\"b\"]}", "{\"a\":\"c\"}", "{\"a\":\"c\"}"},
      {"{\"a\":\"c\"}", "{\"a\":[\"b\"]}", "{\"a\":[\"b\"]}"},
      {"{\"a\":{\"b\":\"c\"}}", "{\"a\":{\"b\":\"d\",\"c\":null}}", "{\"a\":{\"b\":\"d\"}}"},
      {"{\"a\":[{\"b\":\"c\"}]}", "{\"a\":[1]}", "{\"a\":[1]}"},
      {"[\"a\",\"b\"]", "[\"c\",\"d\"]", "[\"c\",\"d\"]"},
      {"{\"a\":\"b\"}", "[\"c\"]", "[\"c\"]"},
      {"{\"a\":\"foo\"}", "null", "null"},
      {"{\"a\":\"foo\"}", "\"bar\"", "\"bar\""},
      {"{\"e\":null}", "{\"a\":1}", "{\"e\":null,\"a\":1}"},
      {"[1,2]", "{\"a\":\"b\",\"c\":null}", "{\"a\":\"b\"}"},
      {"{}", "{\"a\":{\"bb\":{\"ccc\":null}}}", "{\"a\":{\"bb\":{}}}"},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    cJSON *target = cJSON_Parse(cases[i][0]), *patch = cJSON_Parse(cases[i][1]);
    cJSON *expected = cJSON_Parse(cases[i][2]), *merged = pb_json_merge(target, patch);
    assert_true(cJSON_Compare(merged, expected, 1));
    cJSON_Delete(target), cJSON_Delete(patch), cJSON_Delete(expected), cJSON_Delete(merged);
  }
}

static void test_read_names_the_file(void **state) {
  (void)state;
  cJSON *value;
  pb_error err = {0};
  assert_int_equal(pb_json_read("/nonexistent/plant.json", &value, NULL, &err), PB_ERR_IO);
  assert_string_equal(err.where, "/nonexistent/plant.json");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_refused),
      cmocka_unit_test(test_accepted),
      cmocka_unit_test(test_case_matters),
      cmocka_unit_test(test_numbers_survive),
      cmocka_unit_test(test_print),
      cmocka_unit_test(test_merge),
      cmocka_unit_test(test_read_names_the_file),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
