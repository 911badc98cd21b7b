// Processes of a measurement: programs whose output is read, and workers that are forked from this
// one. All end with this process.
#ifndef PB_BENCH_CHILD_H
#define PB_BENCH_CHILD_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>

typedef struct bench_child {
  pid_t pid;
  int out;  // its standard output and error; of a worker, what it writes
  int in;   // a worker's orders; −1: a program
} bench_child;

// Starts a program; argv[0] is found along PATH. cpu: the processor it and all its threads stay on;
// −1: any. Ends this program when it cannot be started.
bench_child bench_spawn(const char *const argv[], int cpu);

// A copy of this process that does work(context, in, out) and ends. It must be forked before
// anything that has threads is opened here.
bench_child bench_fork(void (*work)(void *context, int in, int out), void *context, int cpu);

// Reads lines until one holds `part`, into line [512]; false: the output ended, or not in time.
bool bench_child_line(bench_child *child, const char *part, char *line, double seconds);

// Everything it says to its end, owned by the caller; NULL: not in time.
char *bench_child_text(bench_child *child, double seconds);

// Exactly `size` octets from a worker; false: it ended, or not in time.
bool bench_child_read(bench_child *child, void *data, size_t size, double seconds);

// One octet to a worker.
void bench_child_order(bench_child *child, char order);

// CPU time that it has used, all threads; NaN when it is gone.
double bench_child_cpu(const bench_child *child);

// Sends the signal (0: none), waits, closes; the exit status, or −signal. After five seconds it is
// killed.
int bench_child_end(bench_child *child, int signal);

// True when a program of this name can be found.
bool bench_program_exists(const char *name);

// A DDS domain that no test or other measurement of this host uses now.
uint32_t bench_domain(void);

// Everything started from here on talks on the loopback interface only.
void bench_loopback(void);

#endif
