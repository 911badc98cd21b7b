// What a tool says, as JSON: see toolout.h.
#include "toolout.h"

#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench.h"
#include "child.h"

cJSON *bench_tool_json(const char *const argv[], int cpu, double seconds) {
  bench_child child = bench_spawn(argv, cpu);
  char *text = bench_child_text(&child, seconds);
  const int code = bench_child_end(&child, text ? 0 : SIGTERM);
  cJSON *json = text && code == 0 ? cJSON_Parse(text) : NULL;
  if (!json)
    fprintf(stderr, "%s: exit code %d: %.300s\n", argv[0], code, text ? text : "not in time");
  free(text);
  return json;
}

static const cJSON *find(const cJSON *json, const char *path) {
  char name[64];
  while (json && *path) {
    size_t length = strcspn(path, "/");
    snprintf(name, sizeof name, "%.*s", (int)length, path);
    json = cJSON_GetObjectItemCaseSensitive(json, name);
    path += length + (path[length] == '/');
  }
  return json;
}

double bench_json_number(const cJSON *json, const char *path) {
  const cJSON *item = find(json, path);
  return cJSON_IsNumber(item) ? item->valuedouble : NAN;
}

const char *bench_json_text(const cJSON *json, const char *path) {
  const cJSON *item = find(json, path);
  return cJSON_IsString(item) ? item->valuestring : "";
}
