// What the monitor reads from the bus. Readers only: a plant does not wait for them, and the sample
// reader is best effort and keeps one sample, so that it costs the daemon no acknowledgement.
#ifndef PB_CLIENTS_MONITOR_FEED_H
#define PB_CLIENTS_MONITOR_FEED_H

#include "monitor.h"
#include "options.h"

typedef struct feed feed;

// Joins the domain and finds the plant within `timeout` seconds. Fails with PB_ERR_STATE when there
// is none or, without a name, several: their names and hosts are printed to stderr. [init]
pb_status feed_open(const pb_common_options *options, double timeout, feed **out, pb_error *err);
void feed_close(feed *f);

// Takes what is there. True when a new status was. [any]
bool feed_take(feed *f);

// Waits up to `seconds` for something new.
void feed_wait(feed *f, double seconds);

const monitor_state *feed_state(const feed *f);

#endif
