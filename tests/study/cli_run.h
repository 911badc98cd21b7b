// Running a command line to its end, with what it says.
#ifndef PB_TESTS_STUDY_CLI_RUN_H
#define PB_TESTS_STUDY_CLI_RUN_H

typedef struct cli_result {
  int code;         // exit code, or 128 when a signal ended it
  char *out, *err;  // owned
} cli_result;

// Runs the words of a blank-separated line; the first is the program's path.
cli_result cli_run(const char *line);
void cli_free(cli_result *result);

// Runs it, which must end with this code, and leaves it at that.
void cli_expect(const char *line, int code, const char *words);

#endif
