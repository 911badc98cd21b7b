// What the programs in bench/ have in common: repeated measurement, the machine, tables, goals,
// growth with size, and the report as tables or JSON.
//
// A program answers one question. It measures its subject and somebody else's solution of the same
// task in the same run, turn by turn, and judges ratios only: an absolute time is told, never
// judged. Exit codes: 0 every goal met, 1 a goal missed or the measurement failed, 2 wrong command
// line.
//
//   bench *b = bench_begin(argc, argv, "step", "What does one step cost?");
//   bench_table *t = bench_table_add(b, "step", "Step", "plant", 2, columns);
//   … bench_compare(…); bench_row(t, "nano-hexapod", values); bench_goal(b, …);
//   return bench_end(b);
//
// Out of memory ends the program with exit code 1: these are measurements, not services.
#ifndef PB_BENCH_BENCH_H
#define PB_BENCH_BENCH_H

#include <stdbool.h>
#include <stddef.h>

#include "base/status.h"

typedef struct bench bench;
typedef struct bench_table bench_table;

// Parses --json, --quick, --plots DIR, -o FILE; a wrong command line ends the program with 2.
// name: one word, of the JSON and the files; question: a sentence. Owned until bench_end.
bench *bench_begin(int argc, char **argv, const char *name, const char *question);

// --quick was given: shorter measurements, and the largest sizes may be left out.
bool bench_quick(const bench *b);

// Ends the program with exit code 1 and this message. bench_check does so when st is an error.
void bench_fail(const char *format, ...) __attribute__((format(printf, 1, 2), noreturn));
void bench_check(pb_status st, const pb_error *err);
void *bench_memory(size_t count, size_t size);  // zeroed, 64-byte aligned, never NULL; free()

// ---- measuring ----------------------------------------------------------------------------------

// Does its work `repeats` times.
typedef void bench_function(void *context, size_t repeats);

typedef struct bench_stats {
  size_t count;
  double min, q25, median, q75, p99, max, mean;
} bench_stats;

// Quantiles of value [count]; sorts it. NaN for count 0.
bench_stats bench_stats_of(double *value, size_t count);

// Seconds of one repeat, over samples of at least half a millisecond taken for `seconds` in all (at
// least five samples, the first thrown away).
bench_stats bench_measure(bench_function *work, void *context, double seconds);

typedef struct bench_ratio {
  bench_stats ours, baseline;  // seconds of one repeat
  bench_stats ratio;           // baseline/ours of each turn; its median is what is judged
} bench_ratio;

// Both by turns, so that what else the machine does falls on both.
bench_ratio bench_compare(bench_function *ours, void *our_context, bench_function *baseline,
                          void *baseline_context, double seconds);

double bench_now(void);          // monotonic seconds
double bench_cpu_seconds(void);  // CPU time of this process, all threads

// ---- the machine --------------------------------------------------------------------------------

typedef struct bench_machine {
  char cpu[96];       // model name as the kernel tells it
  char features[64];  // instruction sets that matter to the kernels: "AVX2 FMA AVX-512"
  char caches[96];    // "L1d 48 KiB, L2 1 MiB, L3 32 MiB"
  char kernel[96];    // "Linux 6.1.0"
  char compiler[64];  // "GCC 12.2.0"
  char blas[96];      // OpenBLAS' own description; empty when it has none
  long cores;         // online
  double memory;      // bytes
  double load;        // load average over a minute at the beginning
} bench_machine;

void bench_machine_describe(bench_machine *machine);
long bench_cores(void);  // online

// Threads OpenBLAS uses from now on; nothing happens with another BLAS.
void bench_blas_threads(int count);

// ---- results ------------------------------------------------------------------------------------

typedef struct bench_column {
  const char *key;   // "ns_per_step"; in JSON, and for growth
  const char *name;  // "one step"; head of the table
  const char *unit;  // "ns"; NULL: none
  int digits;        // significant digits in the table
} bench_column;

// key: one word; case_name: head of the first column. columns [count] is copied, its texts are not.
bench_table *bench_table_add(bench *b, const char *key, const char *title, const char *case_name,
                             size_t count, const bench_column *column);

// A row: values [columns]; NaN: not measured. name is copied.
void bench_row(bench_table *table, const char *name, const double *value);

typedef enum bench_relation { BENCH_AT_LEAST, BENCH_AT_MOST } bench_relation;

// A goal on a ratio: judged, and a missed one makes exit code 1. what is copied.
void bench_goal(bench *b, const char *what, double ratio, bench_relation relation, double goal);

// A goal on an absolute number (a time on the machine the goal was set for): told, never judged.
void bench_target(bench *b, const char *what, double value, const char *unit,
                  bench_relation relation, double goal);

// The growth of column y with column x over the rows of the table that have both: exponent of the
// least-squares line through the logarithms, told, and drawn with --plots. from: rows with x below
// it are drawn but not fitted (0: all).
void bench_growth(bench *b, const bench_table *table, const char *x, const char *y, double from);

// A remark below the tables; what was skipped and why.
void bench_note(bench *b, const char *format, ...) __attribute__((format(printf, 2, 3)));

// Prints tables or JSON, writes the files asked for, frees b; the exit code.
int bench_end(bench *b);

#endif
