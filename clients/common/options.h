// What the command-line tools have in common: exit codes, strict values of flags, messages.
//
// The pb_option_* functions are for use inside an argp parser: they return the value, or end the
// program with PB_EXIT_USAGE and a message that names the flag. The pb_parse_* functions below them
// only judge the text. Numbers must use up the whole text; "nan", "inf" and hexadecimal are
// refused.
#ifndef PB_CLIENTS_OPTIONS_H
#define PB_CLIENTS_OPTIONS_H

#include <argp.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "base/status.h"

enum {
  PB_EXIT_DONE = 0,
  PB_EXIT_FAILED = 1,  // the tool understood what was asked and could not do it
  PB_EXIT_USAGE = 2,   // the command line is wrong
};

// argp_parse with the project's conventions: usage errors exit with PB_EXIT_USAGE, --version prints
// the version. Call it in place of argp_parse.
error_t pb_options_parse(const struct argp *argp, int argc, char **argv, void *input);

// Strict numbers: false when text is not one finite number in full (out is then untouched).
bool pb_parse_double(const char *text, double *out);
bool pb_parse_uint64(const char *text, uint64_t *out);

// Comma-separated numbers, at least one. *out [*count] is owned by the caller; false: not all of
// them are numbers, or out of memory.
bool pb_parse_double_list(const char *text, double **out, size_t *count);

// A growing list of names that flags such as --input a,b --input c fill. Zero-initialise.
typedef struct pb_name_list {
  size_t count;
  char **name;  // [count], each owned
} pb_name_list;

// Appends the comma-separated names of text. A name with a comma in it stands in double quotes,
// where a doubled one means itself: '"a,b",c' is two names. False: an empty name, a quote that is
// not closed or is followed by something else than a comma, or out of memory.
bool pb_parse_names(const char *text, pb_name_list *list);
void pb_name_list_free(pb_name_list *list);

// The value of a flag; flag is named in the message ("--gain"). Bounds are inclusive.
double pb_option_double(const struct argp_state *state, const char *flag, const char *text,
                        double min, double max);
uint64_t pb_option_uint64(const struct argp_state *state, const char *flag, const char *text,
                          uint64_t min, uint64_t max);
void pb_option_double_list(const struct argp_state *state, const char *flag, const char *text,
                           double **out, size_t *count);
void pb_option_names(const struct argp_state *state, const char *flag, const char *text,
                     pb_name_list *list);

// Lists of a known length: exactly `count` numbers, `expected` says in the message what they are
// ("two positive frequencies"); a band 0 < F1 < F2 in Hz; a direction X,Y,Z, not of unit length;
// two frames that differ, counted from 1.
void pb_option_numbers(const struct argp_state *state, const char *flag, const char *text,
                       double *out, size_t count, const char *expected);
void pb_option_band(const struct argp_state *state, const char *flag, const char *text, double *f1,
                    double *f2);
void pb_option_direction(const struct argp_state *state, const char *flag, const char *text,
                         double xyz[3]);
void pb_option_frames(const struct argp_state *state, const char *flag, const char *text,
                      size_t frames[2]);

// --domain N, --interface NAME, --config FILE (one of these two) and --plant NAME, for tools that
// talk to a daemon. Use pb_common_argp as an argp child and hand it a pb_common_options as its
// input (state->child_inputs[...]) on ARGP_KEY_INIT.
typedef struct pb_common_options {
  uint32_t domain;
  const char *config, *interface;  // NULL: not given
  const char *plant;               // NULL: the only plant of the domain
} pb_common_options;

extern const struct argp pb_common_argp;

struct pb_session_options;

// How a tool with these options opens its session; fill in what else it wants. session.h has the
// type. [any]
struct pb_session_options pb_common_session(const pb_common_options *options);

// "plantbus-x: where: message" on stream (stderr as a rule). [any]
void pb_print_error(FILE *stream, const pb_error *err);

// "plantbus-x: warning: where: message", one line each. [any]
void pb_print_warnings(FILE *stream, const pb_warnings *warnings);

#endif
