// Running plantbus-part, and other programs, in a folder of their own.
#ifndef PB_TESTS_PART_RUN_H
#define PB_TESTS_PART_RUN_H

#include <cjson/cJSON.h>
#include <stdbool.h>

// For cmocka's group set-up and tear-down: a new folder, and its removal with all in it.
int part_folder_make(void **state);
int part_folder_remove(void **state);

// The path of a name in the folder; valid until eight more were asked for.
const char *part_path(const char *name);

// Runs a shell command in the folder, its output in "stdout" and "stderr" there. Returns the exit
// code. Commands hold nothing but what the test itself writes.
int part_shell(const char *command);

// plantbus-part with these arguments.
int part_run(const char *arguments);

bool part_has(const char *program);  // is it installed

char *part_text(const char *name);        // a file of the folder; owned
cJSON *part_json(const char *arguments);  // standard output of a run that must succeed; owned

// Fails unless the last run's standard error holds the part.
void part_complains(const char *part);

#endif
