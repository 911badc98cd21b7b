// Running a command-line tool to its end, with what it says.
#ifndef PB_TESTS_E2E_TOOL_RUN_H
#define PB_TESTS_E2E_TOOL_RUN_H

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>

// As domain: a tool that knows of none.
#define TOOL_NO_DOMAIN UINT32_MAX

// A tool that runs; standard output and error go into memory files.
typedef struct tool_process {
  pid_t pid;
  int out, err;
} tool_process;

// Starts PB_BIN/name with the words of a blank-separated line ('…' keeps blanks) and --domain.
// environment: "NAME=value" put on top of this process', or NULL.
tool_process tool_start(const char *name, uint32_t domain, const char *environment,
                        const char *line);

// True when it has ended; *code is then its exit code, or −signal.
bool tool_ended(tool_process *process, int *code);

typedef struct tool_result {
  int code;
  char *out, *err;  // owned
} tool_result;

// What the tool said; it must have ended.
tool_result tool_collect(tool_process *process, int code);

// Starts, waits (30 s at most, 90 under sanitizers; then it is killed and the test fails) and
// collects.
tool_result tool_run(const char *name, uint32_t domain, const char *environment, const char *line);

// The same with standard output as JSON; the exit code must be `code`. Owned (cJSON_Delete).
cJSON *tool_json(const char *name, uint32_t domain, const char *environment, const char *line,
                 int code);
void tool_free(tool_result *result);

// Fails unless the text holds the part.
void tool_says(const char *text, const char *part);

// The member of an object; fails when it is not there.
const cJSON *tool_member(const cJSON *object, const char *key);

#endif
