// The doctor's judgements (clients/doctor): configurations, and qualities of service.
#include <stdlib.h>
#include <string.h>

#include "bus_domain.h"
#include "bus_qos.h"
#include "config.h"
#include "qos.h"
#include "report.h"
#include "support/check.h"

static void the_builtin_configuration_is_read(void **state) {
  (void)state;
  char text[2048];
  config_facts facts;
  pb_domain_config("eth7", text, sizeof text);
  REQUIRE(config_read(text, &facts, &err));
  assert_int_equal(facts.interfaces, 1);
  assert_string_equal(facts.interface[0].name, "eth7");
  assert_true(facts.interface[0].multicast_told && facts.interface[0].multicast);
  assert_true(facts.multicast);
  assert_false(facts.index_auto);
}

static void the_network_configuration_is_read(void **state) {
  (void)state;
  config_facts facts;
  REQUIRE(config_read("file://" PB_CONFIG "/dds-lan.xml", &facts, &err));
  assert_int_equal(facts.interfaces, 1);
  assert_string_equal(facts.interface[0].name, "");  // autodetermine
  assert_true(facts.index_auto);
  assert_int_equal(facts.index_max, 99);
  assert_int_equal(facts.peers, 0);  // they are in a comment
}

static void several_pieces_add_up(void **state) {
  (void)state;
  config_facts facts;
  REQUIRE(config_read("file://" PB_CONFIG "/dds-lan.xml,<CycloneDDS><Domain><General>"
                      "<AllowMulticast>false</AllowMulticast></General><Discovery><Peers>"
                      "<Peer address=\"10.0.0.1\"/><Peer address=\"10.0.0.2\"/></Peers></Discovery>"
                      "</Domain></CycloneDDS>",
                      &facts, &err));
  assert_int_equal(facts.index_max, 99);
  assert_false(facts.multicast);
  assert_int_equal(facts.peers, 2);
}

static void bad_configurations_are_told(void **state) {
  (void)state;
  config_facts facts;
  pb_error err = {0};
  assert_int_equal(config_read("file:///no/such/file", &facts, &err), PB_ERR_IO);
  assert_string_equal(err.where, "/no/such/file");
  assert_int_equal(config_read("file:///tmp", &facts, &err), PB_ERR_IO);
  assert_int_equal(config_read("<CycloneDDS>\n<Domain>\n</CycloneDDS>", &facts, &err),
                   PB_ERR_SYNTAX);
  assert_non_null(strstr(err.message, "line 3"));
}

// ---- qualities of service -----------------------------------------------------------------------

static void the_bus_fits_itself(void **state) {
  (void)state;
  char text[160];
  for (int t = 0; t < PB_TOPIC_COUNT; t++) {
    dds_qos_t *qos = pb_topic_qos((pb_topic)t);
    if (qos_conflict(qos, qos, text, sizeof text))
      fail_msg("%s: %s", pb_topic_name((pb_topic)t), text);
    dds_delete_qos(qos);
  }
}

static void conflict(pb_topic topic, void (*change)(dds_qos_t *offered, dds_qos_t *requested),
                     const char *expected) {
  char text[160];
  dds_qos_t *offered = pb_topic_qos(topic), *requested = pb_topic_qos(topic);
  change(offered, requested);
  const bool any = qos_conflict(offered, requested, text, sizeof text);
  assert_string_equal(text, expected);
  assert_int_equal(any, expected[0] != '\0');
  dds_delete_qos(offered);
  dds_delete_qos(requested);
}

static void weak_writer(dds_qos_t *offered, dds_qos_t *requested) {
  (void)requested;
  dds_qset_reliability(offered, DDS_RELIABILITY_BEST_EFFORT, 0);
}
static void weak_reader(dds_qos_t *offered, dds_qos_t *requested) {
  (void)offered;
  dds_qset_reliability(requested, DDS_RELIABILITY_BEST_EFFORT, 0);
}
static void volatile_writer(dds_qos_t *offered, dds_qos_t *requested) {
  (void)requested;
  dds_qset_durability(offered, DDS_DURABILITY_VOLATILE);
}
static void impatient_reader(dds_qos_t *offered, dds_qos_t *requested) {
  (void)offered;
  dds_qset_liveliness(requested, DDS_LIVELINESS_MANUAL_BY_TOPIC, DDS_SECS(2));
}
static void lazy_writer(dds_qos_t *offered, dds_qos_t *requested) {
  (void)requested;
  dds_qset_liveliness(offered, DDS_LIVELINESS_AUTOMATIC, DDS_INFINITY);
}
static void punctual_reader(dds_qos_t *offered, dds_qos_t *requested) {
  (void)offered;
  dds_qset_deadline(requested, DDS_MSECS(100));
}
static void exclusive_writer(dds_qos_t *offered, dds_qos_t *requested) {
  (void)requested;
  dds_qset_ownership(offered, DDS_OWNERSHIP_EXCLUSIVE);
}
static void sourced_reader(dds_qos_t *offered, dds_qos_t *requested) {
  (void)offered;
  dds_qset_destination_order(requested, DDS_DESTINATIONORDER_BY_SOURCE_TIMESTAMP);
}

static void each_policy_is_compared(void **state) {
  (void)state;
  conflict(PB_TOPIC_SAMPLE, weak_writer, "reliability: BEST_EFFORT offered, RELIABLE requested");
  conflict(PB_TOPIC_SAMPLE, weak_reader, "");
  conflict(PB_TOPIC_STATUS, volatile_writer,
           "durability: VOLATILE offered, TRANSIENT_LOCAL requested");
  conflict(PB_TOPIC_SAMPLE, volatile_writer, "");
  conflict(PB_TOPIC_COMMAND, impatient_reader, "liveliness lease: infinite offered, 2 s requested");
  conflict(PB_TOPIC_COMMAND, lazy_writer,
           "liveliness: AUTOMATIC offered, MANUAL_BY_TOPIC requested");
  conflict(PB_TOPIC_SAMPLE, punctual_reader, "deadline: infinite offered, 0.1 s requested");
  conflict(PB_TOPIC_SAMPLE, exclusive_writer,
           "ownership: shared on one side, exclusive on the other");
  conflict(PB_TOPIC_SAMPLE, sourced_reader,
           "destination order: BY_RECEPTION_TIMESTAMP offered, BY_SOURCE_TIMESTAMP requested");
}

static void a_report_knows_its_worst(void **state) {
  (void)state;
  report r = {0};
  assert_int_equal(report_worst(&r), GRADE_OK);
  report_add(&r, GRADE_WARN, "a", NULL, "x\033y");
  report_add(&r, GRADE_OK, "b", "mend", "z");
  assert_int_equal(report_worst(&r), GRADE_WARN);
  assert_string_equal(r.item[0].text, "x?y");
  assert_string_equal(r.item[0].mend, "");
  report_add(&r, GRADE_FAIL, "c", NULL, " ");
  assert_int_equal(report_worst(&r), GRADE_FAIL);
  report_clear(&r);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_builtin_configuration_is_read),
      cmocka_unit_test(the_network_configuration_is_read),
      cmocka_unit_test(several_pieces_add_up),
      cmocka_unit_test(bad_configurations_are_told),
      cmocka_unit_test(the_bus_fits_itself),
      cmocka_unit_test(each_policy_is_compared),
      cmocka_unit_test(a_report_knows_its_worst),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
