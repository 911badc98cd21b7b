// Where results go: see results.h.
#include "results.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "outfile.h"
#include "standard_output.h"

enum { KEY_JSON = 0x600, KEY_PLOT, KEY_DIR };

static const struct argp_option option_table[] = {
    {"json", KEY_JSON, NULL, 0, "Print JSON instead of tables", 1},
    {"output-dir", KEY_DIR, "DIR", 0, "Write CSV and MAT files into DIR", 1},
    // Older command lines; -o is a file elsewhere, and one letter means one thing.
    {NULL, 'o', "DIR", OPTION_HIDDEN, NULL, 1},
    {"plot", KEY_PLOT, NULL, 0, "Draw plots (PNG) into DIR, or here", 1},
    {0},
};

static error_t parse(int key, char *text, struct argp_state *state) {
  pb_result_options *o = state->input;
  switch (key) {
  case KEY_JSON:
    o->json = true;
    return 0;
  case KEY_DIR:
  case 'o':
    if (!text[0]) argp_error(state, "--output-dir: the name is empty");
    o->dir = text;
    return 0;
  case KEY_PLOT:
    o->plot = true;
    return 0;
  default:
    return ARGP_ERR_UNKNOWN;
  }
}

// argp frees what is not the text that it handed over.
static char *help(int key, const char *text, void *input) {
  const pb_result_options *o = input;
  const char *own = !o                ? NULL
                    : key == KEY_DIR  ? o->files_help
                    : key == KEY_PLOT ? o->plot_help
                                      : NULL;
  return own ? strdup(own) : (char *)text;
}

const struct argp pb_result_argp = {option_table, parse, NULL, NULL, NULL, help, NULL};

// ---- the directory ------------------------------------------------------------------------------

pb_status pb_output_path(const char *dir, const char *name, char *text, size_t size,
                         pb_error *err) {
  if (mkdir(dir, 0777) != 0 && errno != EEXIST) {
    return pb_fail(err, PB_ERR_IO, dir, "the directory cannot be created: %s", strerror(errno));
  }
  int written = snprintf(text, size, "%s/%s", dir, name);
  if (written < 0 || (size_t)written >= size) {
    return pb_fail(err, PB_ERR_ARGUMENT, dir, "the path is too long");
  }
  return PB_OK;
}

const char *pb_result_dir(const pb_result_options *o) {
  return o->dir ? o->dir : ".";
}

pb_status pb_result_path(const pb_result_options *o, const char *name, char *text, size_t size,
                         pb_error *err) {
  return pb_output_path(pb_result_dir(o), name, text, size, err);
}

pb_status pb_result_check(const pb_result_options *o, pb_error *err) {
  const char *dir = pb_result_dir(o);
  char path[1024];
  if (!o->dir && !o->plot) return PB_OK;
  bool made = mkdir(dir, 0777) == 0;
  pb_status status = pb_output_path(dir, "probe", path, sizeof path, err);
  if (!status) status = pb_outfile_probe(path, err);
  if (made) rmdir(dir);
  return status;
}

// ---- the end ------------------------------------------------------------------------------------

int pb_result_end(pb_status status, const pb_error *err) {
  pb_error own;
  if (!status && (status = pb_stdout_flush(&own))) err = &own;
  if (!status) return PB_EXIT_DONE;
  pb_print_error(stderr, err);
  return PB_EXIT_FAILED;
}
