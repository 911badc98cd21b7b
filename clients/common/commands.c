// Tools with several commands: see commands.h.
#include "commands.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "options.h"
#include "standard_output.h"

static void print_help(FILE *stream, const char *tool, const char *about, const pb_command *c) {
  fprintf(stream, "Usage: %s COMMAND [OPTION...]\n%s\n\nCommands:\n", tool, about);
  int width = 0;
  for (const pb_command *at = c; at->name; at++) {
    int length = (int)strlen(at->name);
    if (length > width) width = length;
  }
  for (; c->name; c++) fprintf(stream, "  %-*s  %s\n", width, c->name, c->summary);
  fprintf(stream, "\n'%s COMMAND --help' tells the options of a command.\n", tool);
}

int pb_commands_run(int argc, char **argv, const char *about, const pb_command *commands) {
  const char *tool = argv[0], *slash = strrchr(tool, '/');
  if (slash) tool = slash + 1;
  const char *word = argc > 1 ? argv[1] : "";
  pb_stdout_guard();
  if (!strcmp(word, "--help") || !strcmp(word, "-?")) {
    print_help(stdout, tool, about, commands);
    return PB_EXIT_DONE;
  }
  if (!strcmp(word, "--version") || !strcmp(word, "-V")) {
    puts(argp_program_version);
    return PB_EXIT_DONE;
  }
  for (const pb_command *c = commands; c->name; c++) {
    if (strcmp(c->name, word)) continue;
    char *name = NULL;
    if (asprintf(&name, "%s %s", tool, c->name) < 0) {
      fprintf(stderr, "%s: out of memory\n", tool);
      return PB_EXIT_FAILED;
    }
    argv[1] = name;
    int code = c->run(argc - 1, argv + 1);
    free(name);
    return code;
  }
  if (word[0]) fprintf(stderr, "%s: '%s' is not one of its commands\n", tool, word);
  print_help(stderr, tool, about, commands);
  return PB_EXIT_USAGE;
}
