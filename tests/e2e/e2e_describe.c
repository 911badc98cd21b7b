// Publishes a description with a model of COUNT numbers in a domain and waits to be killed:
// e2e_describe DOMAIN COUNT. Number i is i / 7, so that a reader can tell a damaged one.
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "bus_domain.h"
#include "bus_qos.h"

int main(int argc, char **argv) {
  if (argc != 3) return 2;
  const pb_domain_options options = {.domain = (uint32_t)atoi(argv[1])};
  const uint32_t count = (uint32_t)atoi(argv[2]);
  double *model = malloc(count * sizeof *model);
  dds_entity_t participant;
  pb_error err;
  if (!model || pb_domain_join(&options, &participant, &err)) return 1;
  for (uint32_t i = 0; i < count; i++) model[i] = (double)i / 7.0;
  const dds_entity_t publisher = pb_partition_create(participant, "large", true);
  const dds_entity_t topic = pb_topic_create(participant, PB_TOPIC_DESCRIPTION);
  const dds_entity_t writer = pb_writer_create(publisher, topic, PB_TOPIC_DESCRIPTION, 0.0);
  plantbus_PlantDescription d = {.name = "large",
                                 .plant_text = "",
                                 .plant_sha256 = "",
                                 .software_version = "",
                                 .model = {count, count, model, false}};
  if (dds_write(writer, &d) != DDS_RETCODE_OK) return 1;
  puts("published");
  fflush(stdout);
  pause();
  free(model);
  return 0;
}
