// Tools with several commands: `plantbus-part build …` runs the command "build" with its own argp.
//
// Exit codes as everywhere (options.h). `TOOL --help` lists the commands, `TOOL COMMAND --help` is
// the command's own help, `TOOL --version` the version.
#ifndef PB_CLIENTS_COMMANDS_H
#define PB_CLIENTS_COMMANDS_H

// A command gets its own words: argv[0] is "TOOL COMMAND" (for its usage lines), then its
// arguments.
typedef int pb_command_function(int argc, char **argv);

typedef struct pb_command {
  const char *name;
  pb_command_function *run;
  const char *summary;  // one line, without a full stop
} pb_command;

// Runs the command that argv[1] names. commands ends with a zeroed entry; about: one sentence on
// the tool. Returns the exit code: PB_EXIT_USAGE where no command or an unknown one is given.
int pb_commands_run(int argc, char **argv, const char *about, const pb_command *commands);

#endif
