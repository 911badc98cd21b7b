// plantbus-doctor: what it says when all is well, and each thing that can be wrong.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "bus_domain.h"
#include "harness.h"
#include "tool_run.h"

#define DOCTOR "plantbus-doctor"

// One for all tests: domains are few.
static e2e_daemon bench;

static int daemon_begin(void **state) {
  (void)state;
  bench = e2e_daemon_start(E2E_BENCH, NULL);
  return 0;
}

static int daemon_finish(void **state) {
  (void)state;
  e2e_daemon_end(&bench);
  return 0;
}

// Fails unless the check is there with this result and its text holds the part (NULL: any); the
// mend is returned.
static const char *expect(const cJSON *report, const char *check, const char *result,
                          const char *part) {
  const cJSON *item;
  cJSON_ArrayForEach(item, tool_member(report, "checks")) {
    if (strcmp(tool_member(item, "check")->valuestring, check) != 0 ||
        strcmp(tool_member(item, "result")->valuestring, result) != 0)
      continue;
    if (part && !strstr(tool_member(item, "text")->valuestring, part)) continue;
    const cJSON *mend = tool_member(item, "mend");
    return cJSON_IsString(mend) ? mend->valuestring : "";
  }
  char *text = cJSON_Print(report);
  fail_msg("no %s %s '%s' in %s", check, result, part ? part : "", text);
  return NULL;
}

static void all_is_well(void **state) {
  (void)state;
  cJSON *report = tool_json(DOCTOR, bench.domain, NULL, "--json --plant bus-bench", 0);
  expect(report, "configuration", "OK", "built-in, interface lo");
  expect(report, "interface", "OK", "lo is up");
  expect(report, "participants", "OK", "plantbusd[");
  expect(report, "plant", "OK", "'bus-bench'");
  expect(report, "qos", "OK", NULL);
  expect(report, "types", "OK", NULL);
  expect(report, "ping", "OK", "bus-bench answers");
  expect(report, "samples", "OK", "no barrier member is attached");
  cJSON_Delete(report);
  tool_result r = tool_run(DOCTOR, bench.domain, NULL, "");
  assert_int_equal(r.code, 0);
  tool_says(r.out, "OK    ping");
  tool_free(&r);
}

static void flow_tells_the_mode(void **state) {
  (void)state;
  const char *const modes[][3] = {{"--mode", "paused", NULL}, {"--mode", "realtime", NULL}};
  static const char *const says[] = {"is paused at step 0", "they come, step"};
  for (int i = 0; i < 2; i++) {
    e2e_daemon other = e2e_daemon_start(E2E_BENCH, modes[i]);
    cJSON *report = tool_json(DOCTOR, other.domain, NULL, "--json", 0);
    expect(report, "samples", "OK", says[i]);
    cJSON_Delete(report);
    e2e_daemon_end(&other);
  }
}

static void who_is_waited_for_is_named(void **state) {
  (void)state;
  pb_session *session = e2e_open(&bench);
  e2e_attach(session, "tracking", "Va", 60.0);
  cJSON *report = tool_json(DOCTOR, bench.domain, NULL, "--json --timeout 0.5", 0);
  expect(report, "samples", "WARN", "lockstep waits for test_e2e_doctor[");
  cJSON_Delete(report);
  pb_session_close(session);
}

// The daemon is in one domain, the user looks into another: the scan finds it.
static void a_scan_finds_the_other_domain(void **state) {
  (void)state;
  const uint32_t other = e2e_domain();
  char line[64], domain[32];
  cJSON *report = tool_json(DOCTOR, other, NULL, "--json --timeout 0.5", 1);
  tool_says(expect(report, "participants", "FAIL", "nobody else is in domain"), "--scan 0-20");
  expect(report, "plant", "FAIL", NULL);
  cJSON_Delete(report);
  const uint32_t low = bench.domain < other ? bench.domain : other;
  const uint32_t high = bench.domain < other ? other : bench.domain;
  snprintf(line, sizeof line, "--timeout 1 --scan %u-%u", low, high);
  snprintf(domain, sizeof domain, "domain %-3u  ", bench.domain);
  tool_result r = tool_run(DOCTOR, 0, NULL, line);
  assert_int_equal(r.code, 0);
  tool_says(r.out, domain);
  tool_says(strstr(r.out, domain), "plants: 'bus-bench' (plantbusd[");
  tool_free(&r);
}

static void a_wrong_plant_name_is_told_with_the_right_ones(void **state) {
  (void)state;
  cJSON *report =
      tool_json(DOCTOR, bench.domain, NULL, "--json --timeout 0.5 --plant bus-banch", 1);
  expect(report, "plant", "FAIL", "'bus-banch' is not served here; served are 'bus-bench'");
  cJSON_Delete(report);
}

// ---- participants that do not fit ---------------------------------------------------------------

static void a_writer_of_another_quality_is_named(void **state) {
  (void)state;
  const e2e_raw raw = e2e_raw_join(&bench);
  dds_qos_t *qos = pb_topic_qos(PB_TOPIC_SAMPLE);
  dds_qset_reliability(qos, DDS_RELIABILITY_BEST_EFFORT, 0);
  const dds_entity_t topic = pb_topic_create(raw.participant, PB_TOPIC_SAMPLE);
  assert_true(dds_create_writer(raw.publisher, topic, qos, NULL) > 0);
  dds_delete_qos(qos);
  cJSON *report = tool_json(DOCTOR, bench.domain, NULL, "--json", 1);
  expect(report, "qos", "FAIL", "plantbus/v1/sample: the writer of test_e2e_doctor[");
  expect(report, "qos", "FAIL", "reliability: BEST_EFFORT offered, RELIABLE requested");
  expect(report, "types", "OK", NULL);
  expect(report, "ping", "OK", NULL);
  cJSON_Delete(report);
  dds_delete(raw.participant);
}

// The bus' topic with the type of another one.
static void a_writer_of_another_type_is_named(void **state) {
  (void)state;
  const e2e_raw raw = e2e_raw_join(&bench);
  dds_qos_t *qos = pb_topic_qos(PB_TOPIC_EVENT);
  const dds_entity_t topic = dds_create_topic(raw.participant, &plantbus_Event_desc,
                                              pb_topic_name(PB_TOPIC_COMMAND), NULL, NULL);
  assert_true(topic > 0);
  assert_true(dds_create_reader(raw.subscriber, topic, qos, NULL) > 0);
  dds_delete_qos(qos);
  cJSON *report = tool_json(DOCTOR, bench.domain, NULL, "--json", 1);
  expect(report, "types", "FAIL", "plantbus/v1/command: the reader of test_e2e_doctor[");
  expect(report, "types", "FAIL", "has type plantbus::Event");
  cJSON_Delete(report);
  dds_delete(raw.participant);
}

// ---- configuration ------------------------------------------------------------------------------

static void a_configuration_that_cannot_be_read_is_told(void **state) {
  (void)state;
  cJSON *report = tool_json(DOCTOR, 100, "CYCLONEDDS_URI=file:///no/such/file.xml", "--json", 1);
  tool_says(expect(report, "configuration", "FAIL", "CYCLONEDDS_URI: /no/such/file.xml"),
            "unset CYCLONEDDS_URI");
  cJSON_Delete(report);
  report = tool_json(DOCTOR, 100, "CYCLONEDDS_URI=<CycloneDDS><Domain></CycloneDDS>", "--json", 1);
  expect(report, "configuration", "FAIL", "line 1");
  cJSON_Delete(report);
}

static void an_interface_that_does_not_exist_is_told(void **state) {
  (void)state;
  cJSON *report = tool_json(DOCTOR, 100, NULL, "--json --interface nosuch0", 1);
  tool_says(expect(report, "interface", "FAIL", "nosuch0 does not exist"), "lo");
  cJSON_Delete(report);
  report = tool_json(DOCTOR, 100,
                     "CYCLONEDDS_URI=<CycloneDDS><Domain id=\"any\"><General><Interfaces>"
                     "<NetworkInterface name=\"nosuch1\"/></Interfaces></General></Domain>"
                     "</CycloneDDS>",
                     "--json", 1);
  expect(report, "interface", "FAIL", "nosuch1 does not exist");
  cJSON_Delete(report);
}

// One index allowed, and held by this process: the next one cannot join.
static void used_up_participant_indices_are_told(void **state) {
  (void)state;
  static const char configuration[] =
      "<CycloneDDS><Domain id=\"any\"><General><Interfaces><NetworkInterface name=\"lo\" "
      "multicast=\"true\"/></Interfaces></General><Discovery><ParticipantIndex>auto"
      "</ParticipantIndex><MaxAutoParticipantIndex>1</MaxAutoParticipantIndex></Discovery>"
      "</Domain></CycloneDDS>";
  static char environment[600];
  const uint32_t domain = e2e_domain();
  snprintf(environment, sizeof environment, "CYCLONEDDS_URI=%s", configuration);
  assert_true(dds_create_domain(domain, configuration) > 0);
  const dds_entity_t participant = dds_create_participant(domain, NULL, NULL);
  assert_true(participant > 0);
  cJSON *report = tool_json(DOCTOR, domain, environment, "--json", 1);
  tool_says(expect(report, "ports", "FAIL", "1 of 1 participant indices are in use"),
            "MaxAutoParticipantIndex");
  cJSON_Delete(report);
  dds_delete(participant);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(all_is_well),
      cmocka_unit_test(flow_tells_the_mode),
      cmocka_unit_test(who_is_waited_for_is_named),
      cmocka_unit_test(a_scan_finds_the_other_domain),
      cmocka_unit_test(a_wrong_plant_name_is_told_with_the_right_ones),
      cmocka_unit_test(a_writer_of_another_quality_is_named),
      cmocka_unit_test(a_writer_of_another_type_is_named),
      cmocka_unit_test(a_configuration_that_cannot_be_read_is_told),
      cmocka_unit_test(an_interface_that_does_not_exist_is_told),
      cmocka_unit_test(used_up_participant_indices_are_told),
  };
  return cmocka_run_group_tests(tests, daemon_begin, daemon_finish);
}
