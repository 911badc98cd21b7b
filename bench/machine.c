// Names the machine a measurement was made on: see bench.h. No host name, no paths.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/utsname.h>
#include <unistd.h>

#include "bench.h"

// OpenBLAS has these; another BLAS need not.
char *openblas_get_config(void) __attribute__((weak));
void openblas_set_num_threads(int count) __attribute__((weak));

static void read_cpu_name(char *name, size_t size) {
  FILE *file = fopen("/proc/cpuinfo", "r");
  char line[256];
  snprintf(name, size, "unknown");
  while (file && fgets(line, sizeof line, file)) {
    char *colon = strchr(line, ':');
    if (strncmp(line, "model name", 10) || !colon) continue;
    colon[1 + strcspn(colon + 1, "\n")] = 0;
    snprintf(name, size, "%s", colon + 1 + strspn(colon + 1, " "));
    break;
  }
  if (file) fclose(file);
}

static void read_features(char *text, size_t size) {
#if defined __x86_64__
  snprintf(text, size, "%s%s%s", __builtin_cpu_supports("avx2") ? "AVX2" : "SSE2",
           __builtin_cpu_supports("fma") ? " FMA" : "",
           __builtin_cpu_supports("avx512f") ? " AVX-512" : "");
#else
  snprintf(text, size, "no x86 extensions");
#endif
}

static void append_cache(char *text, size_t size, const char *name, long bytes) {
  size_t length = strlen(text);
  if (bytes <= 0) return;
  bool mebi = bytes >= 1L << 20;
  snprintf(text + length, size - length, "%s%s %ld %s", length ? ", " : "", name,
           mebi ? bytes >> 20 : bytes >> 10, mebi ? "MiB" : "KiB");
}

static double memory_bytes(void) {
  return (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
}

long bench_cores(void) {
  return sysconf(_SC_NPROCESSORS_ONLN);
}

void bench_machine_describe(bench_machine *m) {
  *m = (bench_machine){.cores = bench_cores(), .memory = memory_bytes()};
  read_cpu_name(m->cpu, sizeof m->cpu);
  read_features(m->features, sizeof m->features);
  append_cache(m->caches, sizeof m->caches, "L1d", sysconf(_SC_LEVEL1_DCACHE_SIZE));
  append_cache(m->caches, sizeof m->caches, "L2", sysconf(_SC_LEVEL2_CACHE_SIZE));
  append_cache(m->caches, sizeof m->caches, "L3", sysconf(_SC_LEVEL3_CACHE_SIZE));
  struct utsname system;
  if (!uname(&system))
    snprintf(m->kernel, sizeof m->kernel, "%.20s %.64s", system.sysname, system.release);
  snprintf(m->compiler, sizeof m->compiler, "GCC " __VERSION__);
  if (openblas_get_config) snprintf(m->blas, sizeof m->blas, "%s", openblas_get_config());
  if (getloadavg(&m->load, 1) != 1) m->load = 0;
}

void bench_blas_threads(int count) {
  if (openblas_set_num_threads) openblas_set_num_threads(count);
}
