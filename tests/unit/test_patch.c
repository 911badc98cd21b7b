// From a value at a place to a merge patch (clients/configure/patch.h).
#include <stdlib.h>
#include <string.h>

#include "base/json.h"
#include "patch.h"
#include "support/check.h"

static const char document_text[] =
    "{\"name\":\"p\",\"models\":{\"m\":{\"k\":1,\"c\":2,\"deep\":{\"a\":1,\"b\":[1,2]}}},"
    "\"inputs\":[{\"name\":\"u\",\"at\":[0,0]},{\"name\":\"v\"}],\"a/b\":{\"~\":3}}";

static cJSON *parse(const char *text) {
  cJSON *json = NULL;
  REQUIRE(pb_json_parse(text, strlen(text), &json, &err));
  return json;
}

// The patch for a value, and the document that it makes.
static void check(const char *pointer, const char *value_text, const char *expected_patch) {
  cJSON *document = parse(document_text), *value = parse(value_text), *patch = NULL;
  char *text = NULL;
  REQUIRE(pb_patch_make(document, pointer, value, &patch, &err));
  REQUIRE(pb_json_print_compact(patch, &text, &err));
  assert_string_equal(text, expected_patch);
  cJSON *merged = pb_json_merge(document, patch);
  const cJSON *found = NULL;
  if (!cJSON_IsNull(value) && !strchr(pointer, '-')) {
    REQUIRE(pb_pointer_find(merged, pointer, &found, &err));
    assert_true(cJSON_Compare(found, value, 1));
  }
  free(text);
  cJSON_Delete(merged);
  cJSON_Delete(patch);
  cJSON_Delete(value);
  cJSON_Delete(document);
}

static void check_fails(const char *pointer, const char *value_text, pb_status expected,
                        const char *where) {
  cJSON *document = parse(document_text), *value = parse(value_text), *patch = NULL;
  pb_error err = {0};
  assert_int_equal(pb_patch_make(document, pointer, value, &patch, &err), expected);
  assert_null(patch);
  assert_string_equal(err.where, where);
  cJSON_Delete(value);
  cJSON_Delete(document);
}

static void values_in_objects(void **state) {
  (void)state;
  check("/models/m/k", "7.5", "{\"models\":{\"m\":{\"k\":7.5}}}");
  check("models/m/k", "7.5", "{\"models\":{\"m\":{\"k\":7.5}}}");
  check("/models/m/new", "\"x\"", "{\"models\":{\"m\":{\"new\":\"x\"}}}");
  check("/a~1b/~0", "4", "{\"a/b\":{\"~\":4}}");
  check("/models/m/k", "null", "{\"models\":{\"m\":{\"k\":null}}}");
  check("/components/strut3/k_1", "6e5", "{\"components\":{\"strut3\":{\"k_1\":600000}}}");
  check("/models/m/deep/x/y", "1", "{\"models\":{\"m\":{\"deep\":{\"x\":{\"y\":1}}}}}");
}

// A merge would keep c and deep/a of the old ones.
static void an_object_takes_the_place_of_another(void **state) {
  (void)state;
  check("/models/m", "{\"k\":3,\"deep\":{\"b\":[1]}}",
        "{\"models\":{\"m\":{\"c\":null,\"k\":3,\"deep\":{\"a\":null,\"b\":[1]}}}}");
  check("/models", "{}", "{\"models\":{\"m\":null}}");
  check("/name", "{\"k\":1}", "{\"name\":{\"k\":1}}");
}

static void elements_are_sent_with_their_array(void **state) {
  (void)state;
  check("/inputs/0/name", "\"w\"", "{\"inputs\":[{\"name\":\"w\",\"at\":[0,0]},{\"name\":\"v\"}]}");
  check("/inputs/0/at/1", "5", "{\"inputs\":[{\"name\":\"u\",\"at\":[0,5]},{\"name\":\"v\"}]}");
  check("/inputs/1", "{}", "{\"inputs\":[{\"name\":\"u\",\"at\":[0,0]},{}]}");
  check("/models/m/deep/b/-", "3", "{\"models\":{\"m\":{\"deep\":{\"b\":[1,2,3]}}}}");
  check("/models/m/deep/b/2", "3", "{\"models\":{\"m\":{\"deep\":{\"b\":[1,2,3]}}}}");
  check("/inputs/1/at", "[1]",
        "{\"inputs\":[{\"name\":\"u\",\"at\":[0,0]},{\"name\":\"v\",\"at\":[1]}]}");
}

static void what_is_not_there_is_told(void **state) {
  (void)state;
  check_fails("/modls/m/k", "null", PB_ERR_REFERENCE, "/modls");
  check_fails("/models/m/deep/x/y", "null", PB_ERR_REFERENCE, "/models/m/deep/x");
  check_fails("/inputs/2/name", "1", PB_ERR_REFERENCE, "/inputs/2");
  check_fails("/inputs/01/name", "1", PB_ERR_REFERENCE, "/inputs/01");
  check_fails("/inputs/3", "1", PB_ERR_REFERENCE, "/inputs/3");
  check_fails("/name/x", "1", PB_ERR_REFERENCE, "/name/x");
  check_fails("/inputs/0/name/x", "1", PB_ERR_REFERENCE, "/inputs/0/name/x");
  check_fails("", "{}", PB_ERR_ARGUMENT, "pointer");
  check_fails("/a~2", "1", PB_ERR_ARGUMENT, "/a~2");
  check_fails("/models/m", "{\"k\":null}", PB_ERR_ARGUMENT, "/models/m/k");
}

static void values_are_found(void **state) {
  (void)state;
  cJSON *document = parse(document_text);
  const cJSON *found = NULL;
  pb_error missing = {0};
  REQUIRE(pb_pointer_find(document, "", &found, &err));
  assert_ptr_equal(found, document);
  REQUIRE(pb_pointer_find(document, "/inputs/1/name", &found, &err));
  assert_string_equal(found->valuestring, "v");
  assert_int_equal(pb_pointer_find(document, "/inputs/x", &found, &missing), PB_ERR_REFERENCE);
  assert_null(found);
  cJSON_Delete(document);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(values_in_objects),
      cmocka_unit_test(an_object_takes_the_place_of_another),
      cmocka_unit_test(elements_are_sent_with_their_array),
      cmocka_unit_test(what_is_not_there_is_told),
      cmocka_unit_test(values_are_found),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
