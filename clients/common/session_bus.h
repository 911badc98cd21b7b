// The bus below a session, for tools that read topics by themselves (recorders).
#ifndef PB_CLIENTS_SESSION_BUS_H
#define PB_CLIENTS_SESSION_BUS_H

#include "bus_qos.h"
#include "session.h"

// A reader of a topic of the session's plant that keeps `depth` samples (0: as many as the topic's
// table says); it ends with the session. Fails with PB_ERR_IO. [init]
pb_status pb_session_reader(pb_session *session, pb_topic topic, int depth, dds_entity_t *out,
                            pb_error *err);

// A waitset that wakes when one of the readers has something; it ends with the session. [init]
pb_status pb_session_waitset(pb_session *session, const dds_entity_t *reader, size_t count,
                             dds_entity_t *out, pb_error *err);

#endif
