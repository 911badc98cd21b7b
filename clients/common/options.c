// Command-line helpers: see options.h.
#include "options.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "session.h"
#include "standard_output.h"

const char *argp_program_version = "plantbus " PB_VERSION;

error_t pb_options_parse(const struct argp *argp, int argc, char **argv, void *input) {
  argp_err_exit_status = PB_EXIT_USAGE;
  pb_stdout_guard();
  return argp_parse(argp, argc, argv, 0, NULL, input);
}

// ---- texts into values --------------------------------------------------------------------------

bool pb_parse_double(const char *text, double *out) {
  // Only digits, sign, point and exponent: strtod alone also takes blanks, hexadecimal, inf and
  // nan.
  if (!text[0] || text[strspn(text, "+-.0123456789eE")]) return false;
  char *end;
  double value = strtod(text, &end);
  if (*end || !isfinite(value)) return false;
  *out = value;
  return true;
}

bool pb_parse_uint64(const char *text, uint64_t *out) {
  if (!text[0] || text[strspn(text, "0123456789")]) return false;
  errno = 0;
  unsigned long long value = strtoull(text, NULL, 10);
  if (errno) return false;
  *out = value;
  return true;
}

static size_t count_items(const char *text) {
  size_t count = 1;
  for (; *text; text++) count += *text == ',';
  return count;
}

bool pb_parse_double_list(const char *text, double **out, size_t *count) {
  *out = NULL;
  *count = 0;
  size_t items = count_items(text), filled = 0;
  char *copy = strdup(text), *rest = copy, *item;
  double *value = malloc(items * sizeof *value);
  bool good = copy && value;
  while (good && (item = strsep(&rest, ","))) good = pb_parse_double(item, &value[filled++]);
  free(copy);
  if (!good) {
    free(value);
    return false;
  }
  *out = value;
  *count = items;
  return true;
}

static bool append_name(pb_name_list *list, const char *name) {
  char **grown = realloc(list->name, (list->count + 1) * sizeof *grown);
  if (!grown) return false;
  list->name = grown;
  grown[list->count] = strdup(name);
  if (!grown[list->count]) return false;
  list->count++;
  return true;
}

// The next name of a list from *at on, into name, which has room for all of it; *at is then past
// its comma, or NULL behind the last one.
static bool next_name(const char **at, char *name) {
  const char *p = *at;
  const bool quoted = *p == '"';
  if (quoted) p++;
  for (; *p && (quoted ? *p != '"' || p[1] == '"' : *p != ','); p++) {
    p += quoted && *p == '"';
    *name++ = *p;
  }
  *name = 0;
  if (quoted && *p++ != '"') return false;
  if (*p && *p != ',') return false;
  *at = *p ? p + 1 : NULL;
  return true;
}

bool pb_parse_names(const char *text, pb_name_list *list) {
  char *name = malloc(strlen(text) + 1);
  bool good = name != NULL;
  for (const char *at = text; good && at;)
    good = next_name(&at, name) && name[0] && append_name(list, name);
  free(name);
  return good;
}

void pb_name_list_free(pb_name_list *list) {
  for (size_t i = 0; i < list->count; i++) free(list->name[i]);
  free(list->name);
  *list = (pb_name_list){0};
}

// ---- values of flags ----------------------------------------------------------------------------

double pb_option_double(const struct argp_state *state, const char *flag, const char *text,
                        double min, double max) {
  double value = 0;
  if (!pb_parse_double(text, &value)) {
    argp_error(state, "%s: '%s' is not a number", flag, text);
  } else if (value < min || value > max) {
    argp_error(state, "%s: %g is out of range, expected %g to %g", flag, value, min, max);
  }
  return value;
}

uint64_t pb_option_uint64(const struct argp_state *state, const char *flag, const char *text,
                          uint64_t min, uint64_t max) {
  uint64_t value = 0;
  if (!pb_parse_uint64(text, &value)) {
    argp_error(state, "%s: '%s' is not a whole number", flag, text);
  } else if (value < min || value > max) {
    argp_error(state, "%s: %llu is out of range, expected %llu to %llu", flag,
               (unsigned long long)value, (unsigned long long)min, (unsigned long long)max);
  }
  return value;
}

void pb_option_double_list(const struct argp_state *state, const char *flag, const char *text,
                           double **out, size_t *count) {
  if (!pb_parse_double_list(text, out, count)) {
    argp_error(state, "%s: '%s' is not a list of numbers separated by commas", flag, text);
  }
}

void pb_option_names(const struct argp_state *state, const char *flag, const char *text,
                     pb_name_list *list) {
  if (!pb_parse_names(text, list)) {
    argp_error(
        state,
        "%s: '%s' is not a list of names separated by commas (a name with a comma: in double "
        "quotes)",
        flag, text);
  }
}

void pb_option_numbers(const struct argp_state *state, const char *flag, const char *text,
                       double *out, size_t count, const char *expected) {
  double *value = NULL;
  size_t given = 0;
  if (pb_parse_double_list(text, &value, &given) && given == count)
    memcpy(out, value, count * sizeof *out);
  else
    argp_error(state, "%s: '%s' is not %s", flag, text, expected);
  free(value);
}

void pb_option_band(const struct argp_state *state, const char *flag, const char *text, double *f1,
                    double *f2) {
  static const char expected[] = "two frequencies 0 < F1 < F2";
  double hz[2] = {0};
  pb_option_numbers(state, flag, text, hz, 2, expected);
  if (!(hz[0] > 0 && hz[1] > hz[0])) argp_error(state, "%s: '%s' is not %s", flag, text, expected);
  *f1 = hz[0];
  *f2 = hz[1];
}

void pb_option_direction(const struct argp_state *state, const char *flag, const char *text,
                         double xyz[3]) {
  static const char expected[] = "a direction X,Y,Z";
  pb_option_numbers(state, flag, text, xyz, 3, expected);
  if (xyz[0] == 0 && xyz[1] == 0 && xyz[2] == 0)
    argp_error(state, "%s: '%s' is not %s", flag, text, expected);
}

void pb_option_frames(const struct argp_state *state, const char *flag, const char *text,
                      size_t frames[2]) {
  static const char expected[] = "two frames that differ, counted from 1";
  double value[2] = {0};
  pb_option_numbers(state, flag, text, value, 2, expected);
  bool good = value[0] != value[1];
  for (size_t i = 0; i < 2; i++) {
    frames[i] = value[i] >= 1 && value[i] <= 1e6 ? (size_t)value[i] : 0;
    good = good && frames[i] > 0 && (double)frames[i] == value[i];
  }
  if (!good) argp_error(state, "%s: '%s' is not %s", flag, text, expected);
}

// ---- where the plant is -------------------------------------------------------------------------

enum { KEY_INTERFACE = 0x700, KEY_CONFIG };

static const struct argp_option common_option[] = {
    {"domain", 'd', "N", 0, "DDS domain (default 0)", 0},
    {"interface", KEY_INTERFACE, "NAME", 0,
     "Network interface, as of the daemon (default lo: this host only)", 0},
    {"config", KEY_CONFIG, "FILE", 0, "Cyclone DDS configuration; else CYCLONEDDS_URI", 0},
    {"plant", 'p', "NAME", 0, "Plant to talk to (default: the only one of the domain)", 0},
    {0},
};

static error_t parse_common(int key, char *arg, struct argp_state *state) {
  pb_common_options *options = state->input;
  switch (key) {
  case 'd':
    options->domain = (uint32_t)pb_option_uint64(state, "--domain", arg, 0, 232);
    return 0;
  case 'p':
    if (!arg[0]) argp_error(state, "--plant: the name is empty");
    options->plant = arg;
    return 0;
  case KEY_INTERFACE:
    options->interface = arg;
    return 0;
  case KEY_CONFIG:
    options->config = arg;
    return 0;
  case ARGP_KEY_END:
    if (options->config && options->interface)
      argp_error(state, "--interface has no meaning with --config, which names the interface");
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

pb_session_options pb_common_session(const pb_common_options *options) {
  return (pb_session_options){.domain = options->domain,
                              .config = options->config,
                              .interface = options->interface,
                              .plant = options->plant};
}

const struct argp pb_common_argp = {.options = common_option, .parser = parse_common};

// ---- messages -----------------------------------------------------------------------------------

static void print_message(FILE *stream, const char *kind, const char *where, const char *message) {
  fprintf(stream, "%s: %s%s%s%s\n", program_invocation_short_name, kind, where,
          where[0] ? ": " : "", message);
}

void pb_print_error(FILE *stream, const pb_error *err) {
  print_message(stream, "", err->where, err->message[0] ? err->message : pb_status_text(err->code));
}

void pb_print_warnings(FILE *stream, const pb_warnings *warnings) {
  for (size_t i = 0; i < warnings->count; i++) {
    print_message(stream, "warning: ", warnings->item[i].where, warnings->item[i].message);
  }
}
