// See part_run.h.
#include "part/part_run.h"

#include <sys/wait.h>

#include "support/check.h"

static char folder[64];

int part_folder_make(void **state) {
  (void)state;
  strcpy(folder, "/tmp/pb-part-XXXXXX");
  return mkdtemp(folder) ? 0 : -1;
}

int part_folder_remove(void **state) {
  (void)state;
  char command[128];
  snprintf(command, sizeof command, "rm -rf '%s'", folder);
  return system(command);
}

const char *part_path(const char *name) {
  static char path[8][256];
  static int next;
  char *out = path[next++ % 8];
  snprintf(out, sizeof path[0], "%s/%s", folder, name);
  return out;
}

int part_shell(const char *command) {
  char line[2048];
  int n = snprintf(line, sizeof line, "cd '%s' && { %s; } >stdout 2>stderr", folder, command);
  assert_true(n < (int)sizeof line);
  int result = system(line);
  return WIFEXITED(result) ? WEXITSTATUS(result) : -1;
}

int part_run(const char *arguments) {
  char line[1800];
  int n = snprintf(line, sizeof line, "'%s/plantbus-part' %s", PB_BIN, arguments);
  assert_true(n < (int)sizeof line);
  return part_shell(line);
}

bool part_has(const char *program) {
  char line[128];
  snprintf(line, sizeof line, "command -v %s", program);
  return part_shell(line) == 0;
}

char *part_text(const char *name) {
  FILE *file = fopen(part_path(name), "rb");
  if (!file) fail_msg("no file %s", name);
  fseek(file, 0, SEEK_END);
  long size = ftell(file);
  rewind(file);
  char *text = calloc(1, (size_t)size + 1);
  assert_non_null(text);
  assert_int_equal(fread(text, 1, (size_t)size, file), size);
  fclose(file);
  return text;
}

cJSON *part_json(const char *arguments) {
  int code = part_run(arguments);
  char *text = part_text(code ? "stderr" : "stdout");
  if (code) fail_msg("plantbus-part %s: %s", arguments, text);
  cJSON *json = cJSON_Parse(text);
  if (!json) fail_msg("not JSON: %s", text);
  free(text);
  return json;
}

void part_complains(const char *part) {
  char *text = part_text("stderr");
  if (!strstr(text, part)) fail_msg("\"%s\" is not in: %s", part, text);
  free(text);
}
