// A description as large as the largest plants need (2100 states: about 1 MB; 32 inputs, 64 outputs
// and 4000 states: 4 MB) arrives whole, from another process, also at readers that join later.
#include <signal.h>
#include <stdio.h>
#include <string.h>

#include "bus_domain.h"
#include "harness.h"

typedef struct arrival {
  dds_entity_t reader;
  plantbus_PlantDescription *description;
} arrival;

static bool has_arrived(void *context) {
  arrival *a = context;
  void *sample[1] = {a->description};
  dds_sample_info_t info;
  return dds_take(a->reader, sample, &info, 1, 1) == 1 && info.valid_data;
}

static void receive(dds_entity_t participant, uint32_t count) {
  const dds_entity_t subscriber = pb_partition_create(participant, "large", false);
  const dds_entity_t topic = pb_topic_create(participant, PB_TOPIC_DESCRIPTION);
  arrival a = {.description = NULL};
  a.reader = pb_reader_create(subscriber, topic, PB_TOPIC_DESCRIPTION, 0, NULL);
  a.description = plantbus_PlantDescription__alloc();
  assert_non_null(a.description);
  memset(a.description, 0, sizeof *a.description);
  e2e_until(has_arrived, &a, "the description");
  assert_int_equal(a.description->model._length, count);
  for (uint32_t i = 0; i < count; i++)
    if (a.description->model._buffer[i] != (double)i / 7.0) fail_msg("number %u is damaged", i);
  plantbus_PlantDescription_free(a.description, DDS_FREE_ALL);
  dds_delete(subscriber);
}

static void large_descriptions_arrive(void **state) {
  (void)state;
  static const uint32_t counts[] = {125000, 520000};  // 1 and 4.2 MB
  for (int i = 0; i < 2; i++) {
    char domain[16], count[16], line[256];
    const pb_domain_options options = {.domain = e2e_domain()};
    dds_entity_t participant;
    pb_error err;
    snprintf(domain, sizeof domain, "%u", options.domain);
    snprintf(count, sizeof count, "%u", counts[i]);
    const char *const argv[] = {PB_E2E_DESCRIBE, domain, count, NULL};
    e2e_child child = e2e_spawn(argv);
    e2e_expect_line(&child, "published", line);
    assert_int_equal(pb_domain_join(&options, &participant, &err), PB_OK);
    receive(participant, counts[i]);
    receive(participant, counts[i]);
    dds_delete(participant);
    kill(child.pid, SIGKILL);
    assert_int_equal(e2e_reap(&child), -SIGKILL);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(large_descriptions_arrive)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
