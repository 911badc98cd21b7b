// See session_bus.h.
#include "session_bus.h"

#include "session_internal.h"

pb_status pb_session_reader(pb_session *s, pb_topic topic, int depth, dds_entity_t *out,
                            pb_error *err) {
  *out = 0;
  const dds_entity_t made = pb_reader_create(s->subscriber, s->topic[topic], topic, depth, NULL);
  if (made < 0) return pb_fail(err, PB_ERR_IO, pb_topic_name(topic), "%s", dds_strretcode(-made));
  *out = made;
  return PB_OK;
}

pb_status pb_session_waitset(pb_session *s, const dds_entity_t *reader, size_t count,
                             dds_entity_t *out, pb_error *err) {
  *out = 0;
  const dds_entity_t set = dds_create_waitset(s->participant);
  if (set < 0) return pb_fail(err, PB_ERR_IO, "waitset", "%s", dds_strretcode(-set));
  for (size_t i = 0; i < count; i++) {
    const dds_entity_t condition = dds_create_readcondition(reader[i], DDS_ANY_STATE);
    if (condition < 0 || dds_waitset_attach(set, condition, (dds_attach_t)i) < 0)
      return pb_fail(err, PB_ERR_IO, "waitset", "conditions cannot be created");
  }
  *out = set;
  return PB_OK;
}
