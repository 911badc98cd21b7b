// A controller in a process of its own that answers every sample, and times it.
#ifndef PB_BENCH_BUS_CLIENT_H
#define PB_BENCH_BUS_CLIENT_H

#include <stdbool.h>
#include <stdint.h>

#include "child.h"

typedef struct bench_client_task {
  uint32_t domain;
  int number;      // names its channel; it drives input number
  bool barrier;    // lockstep waits for it
  double seconds;  // from the first sample on; a tenth more before that is not counted
} bench_client_task;

typedef struct bench_client_result {
  double steps;          // answered in the time that counts
  double seconds, cpu;   // wall clock and CPU of this process in that time
  double p50, p99, max;  // seconds from one sample to the next
  double missed;         // samples never seen (real time)
  char failure[400];     // empty: none
} bench_client_result;

// Starts one; waits until it is attached. Ends the program when it cannot.
bench_child bench_client_start(const bench_client_task *task, int cpu);

// Lets it run. bench_client_wait reads what it measured.
void bench_client_go(bench_child *client);
bench_client_result bench_client_wait(bench_child *client, double seconds);

#endif
