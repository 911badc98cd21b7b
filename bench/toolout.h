// Running one of the tools to its end and reading the JSON it prints.
#ifndef PB_BENCH_TOOLOUT_H
#define PB_BENCH_TOOLOUT_H

#include <cjson/cJSON.h>

// argv as of bench_spawn. NULL: it failed, printed no JSON, or took longer, which standard error
// tells. Owned (cJSON_Delete).
cJSON *bench_tool_json(const char *const argv[], int cpu, double seconds);

// A number inside, by its path: "jitter/p99". NaN: not there.
double bench_json_number(const cJSON *json, const char *path);

// A text inside, by its path; "": not there.
const char *bench_json_text(const cJSON *json, const char *path);

#endif
