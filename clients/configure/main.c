// plantbus-configure: the plant file of a running daemon: get, set, patch, history, revert.
#include <stdlib.h>
#include <string.h>

#include "base/json.h"
#include "configure.h"
#include "interrupt.h"
#include "jsontext.h"
#include "patch.h"

enum { KEY_TIMEOUT = 0x100, KEY_WAIT, KEY_AT, KEY_COMMENT, KEY_DRY, KEY_JSON, KEY_DIRECTORY };

static const struct argp_option option_table[] = {
    {"at-step", KEY_AT, "N", 0, "Change at this step of the plant (default: as soon as compiled)",
     1},
    {"comment", KEY_COMMENT, "TEXT", 0, "Keep this with the revision", 1},
    {"wait", KEY_WAIT, "S", 0, "Wait this long until the change acts (default 60)", 1},
    {"timeout", KEY_TIMEOUT, "S", 0, "Wait this long for the daemon (default 5)", 1},
    {"dry-run", KEY_DRY, NULL, 0, "Print the changed plant file and check it; send nothing", 2},
    {"directory", KEY_DIRECTORY, "DIR", 0,
     "Where --dry-run finds element files (default: the working directory)", 2},
    {"json", KEY_JSON, NULL, 0, "Print JSON instead of text", 2},
    {0}};

static const char description[] =
    "Reads and changes the plant of a running daemon.\v"
    "Commands:\n"
    "  get [POINTER]       the plant file, or the value at a JSON pointer\n"
    "  set POINTER VALUE   one value: JSON, or a bare string; null removes a member\n"
    "  patch FILE|-        a JSON merge patch (RFC 7396) of the plant file\n"
    "  history             the revisions\n"
    "  revert REVISION     the plant file of an earlier revision, as a new revision\n"
    "  cancel              gives up a change that is compiled or waits for its step\n\n"
    "Exit codes: 0 done, 1 failed or refused, 2 wrong command line.\n\n"
    "Examples:\n"
    "  plantbus-configure get /components/mass/mass\n"
    "  plantbus-configure set /components/mass/mass 7.5 --comment 'payload changed'\n"
    "  plantbus-configure revert 1\n";

// Words that each command takes.
static const struct {
  const char *name;
  int least, most;
} commands[] = {{"get", 0, 1},     {"set", 2, 2},    {"patch", 1, 1},
                {"history", 0, 0}, {"revert", 1, 1}, {"cancel", 0, 0}};

static void check_words(struct argp_state *state, const configure_options *o) {
  if (!o->command)
    argp_error(state, "a command is missing: get, set, patch, history, revert or cancel");
  const int words = (o->first != NULL) + (o->second != NULL);
  for (size_t i = 0; i < sizeof commands / sizeof *commands; i++) {
    if (strcmp(commands[i].name, o->command) != 0) continue;
    if (words < commands[i].least) argp_error(state, "%s: an argument is missing", o->command);
    if (words > commands[i].most) argp_error(state, "%s: too many arguments", o->command);
    return;
  }
  argp_error(state, "'%s' is not a command", o->command);
}

static void take_word(struct argp_state *state, configure_options *o, char *text) {
  const char **word[] = {&o->command, &o->first, &o->second};
  if (state->arg_num > 2) argp_error(state, "unexpected argument '%s'", text);
  *word[state->arg_num] = text;
}

static error_t parse(int key, char *text, struct argp_state *state) {
  configure_options *o = state->input;
  switch (key) {
  case ARGP_KEY_INIT:
    state->child_inputs[0] = &o->common;
    return 0;
  case KEY_AT:
    o->at_step = pb_option_uint64(state, "--at-step", text, 0, UINT64_C(1) << 53);
    o->at_step_given = true;
    return 0;
  case KEY_COMMENT:
    o->comment = text;
    return 0;
  case KEY_WAIT:
    o->wait = pb_option_double(state, "--wait", text, 1e-3, 86400);
    return 0;
  case KEY_TIMEOUT:
    o->timeout = pb_option_double(state, "--timeout", text, 1e-3, 86400);
    return 0;
  case KEY_DRY:
    o->dry_run = true;
    return 0;
  case KEY_DIRECTORY:
    o->directory = text;
    return 0;
  case KEY_JSON:
    o->json = true;
    return 0;
  case ARGP_KEY_ARG:
    take_word(state, o, text);
    return 0;
  case ARGP_KEY_END:
    check_words(state, o);
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

// The whole file as it was written, a part as JSON; a string that is a part alone without quotes.
static pb_status get(const configure_options *o, const char *text, const cJSON *plant,
                     pb_error *err) {
  const cJSON *value = NULL;
  if (!o->first && !o->json) {
    fputs(text, stdout);
    return PB_OK;
  }
  pb_status status = pb_pointer_find(plant, o->first ? o->first : "", &value, err);
  if (status) return status;
  if (cJSON_IsString(value) && !o->json) {
    puts(value->valuestring);
    return PB_OK;
  }
  return pb_json_show(value, stdout, err);
}

static pb_status run_command(const configure_options *o, pb_session *session, pb_error *err) {
  const char *text = pb_session_description(session)->plant_text;
  cJSON *plant = NULL;
  pb_status status = pb_json_parse(text, strlen(text), &plant, err);
  if (status) return status;
  if (strcmp(o->command, "get") == 0)
    status = get(o, text, plant, err);
  else if (strcmp(o->command, "set") == 0)
    status = configure_set(o, session, plant, err);
  else if (strcmp(o->command, "patch") == 0)
    status = configure_patch(o, session, plant, err);
  else if (strcmp(o->command, "history") == 0)
    status = configure_history(o, session, err);
  else if (strcmp(o->command, "cancel") == 0)
    status = pb_session_request(session, "cancel_configure", NULL, o->timeout, NULL, err);
  else
    status = configure_revert(o, session, err);
  cJSON_Delete(plant);
  return status;
}

// A negative number is a value, not options: a blank before it, which JSON allows, tells argp so.
// The copies live as long as the process.
static void protect_numbers(int argc, char **argv) {
  for (int i = 1; i < argc; i++) {
    double value;
    char *copy;
    if (argv[i][0] != '-' || !pb_parse_double(argv[i], &value)) continue;
    if (asprintf(&copy, " %s", argv[i]) > 0) argv[i] = copy;
  }
}

int main(int argc, char **argv) {
  static const struct argp_child children[] = {{&pb_common_argp, 0, NULL, 0}, {0}};
  static const struct argp argp = {
      option_table,
      parse,
      "get [POINTER]\nset POINTER VALUE\npatch FILE|-\nhistory\nrevert REVISION\ncancel",
      description,
      children,
      NULL,
      NULL};
  configure_options options = {.wait = 60.0};
  pb_session *session = NULL;
  pb_error err = {0};
  protect_numbers(argc, argv);
  pb_options_parse(&argp, argc, argv, &options);
  pb_interrupt_install();
  pb_session_options session_options = pb_common_session(&options.common);
  session_options.timeout = options.timeout;
  pb_status status = pb_session_open(&session_options, &session, &err);
  if (!status) status = run_command(&options, session, &err);
  pb_session_close(session);
  if (status) pb_print_error(stderr, &err);
  return status ? PB_EXIT_FAILED : PB_EXIT_DONE;
}
