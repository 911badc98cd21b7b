// A session without a bus: the plant is stepped in the calling thread. For tests of the tools'
// logic.
#ifndef TESTS_FAKE_SESSION_H
#define TESTS_FAKE_SESSION_H

#include "session.h"

typedef struct fake_session_options {
  unsigned delay;       // commands act this many steps late: 0 lockstep, 1 real time
  unsigned miss_every;  // every so many samples one is not seen; 0: none
  double noise;         // rms added to each output
} fake_session_options;

pb_session *fake_session_new(const pb_model *model, fake_session_options options);
void fake_session_free(pb_session *session);

#endif
