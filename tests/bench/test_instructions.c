// Instructions of the kernels, counted by callgrind, against the recorded counts: a band of 5 %.
//
// Counts, unlike times, do not depend on what else the machine does; they do on the compiler and
// the C library, for which they are recorded. Usage: test_instructions [--record]
#include <cjson/cJSON.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/json.h"
#include "base/status.h"
#include "base/text.h"
#include "jsonout.h"
#include "outfile.h"

enum { MOST_CASES = 8, SKIPPED = 77 };
static const double band = 0.05;

typedef struct counted {
  char name[32];
  double instructions;
} counted;

typedef struct counts {
  char compiler[64], libc[32];
  size_t cases;
  counted item[MOST_CASES];
} counts;

// "desc: Trigger: --dump-after=case_NAME", then "totals: N", in each part that callgrind wrote.
static bool read_part(const char *path, counted *c) {
  FILE *file = fopen(path, "r");
  char line[512];
  bool named = false, summed = false;
  while (file && fgets(line, sizeof line, file)) {
    const char *name = strstr(line, "--dump-after=case_");
    if (name) named = sscanf(name, "--dump-after=case_%31[a-z0-9_]", c->name) == 1;
    if (sscanf(line, "totals: %lf", &c->instructions) == 1) summed = true;
  }
  if (file) fclose(file);
  return named && summed;
}

static void read_parts(const char *directory, counts *c) {
  char path[256];
  for (int part = 1; part < 2 * MOST_CASES && c->cases < MOST_CASES; part++) {
    snprintf(path, sizeof path, "%s/count.%d", directory, part);
    if (read_part(path, &c->item[c->cases])) c->cases++;
    unlink(path);
  }
  snprintf(path, sizeof path, "%s/count", directory);
  unlink(path);
}

static bool count_now(counts *c) {
  char directory[] = "/tmp/plantbus-count-XXXXXX", command[1024], line[256];
  if (!mkdtemp(directory)) return false;
  snprintf(command, sizeof command,
           "valgrind --tool=callgrind --callgrind-out-file=%s/count '--toggle-collect=case_*' "
           "--dump-after=case_step_portable --dump-after=case_step_avx2 --dump-after=case_frf "
           "'%s' 2>/dev/null",
           directory, PB_KERNEL_CASES);
  setenv("OPENBLAS_NUM_THREADS", "1", 1);
  FILE *said = popen(command, "r");
  while (said && fgets(line, sizeof line, said)) {
    sscanf(line, "compiler %63[^\n]", c->compiler);
    sscanf(line, "libc %31[^\n]", c->libc);
  }
  const bool good = said && pclose(said) == 0;
  read_parts(directory, c);
  rmdir(directory);
  return good && c->cases > 0;
}

static const char *text_of(const cJSON *json, const char *key) {
  const cJSON *item = pb_json_member(json, key);
  return cJSON_IsString(item) ? item->valuestring : "";
}

static int record(const counts *c) {
  pb_outfile file;
  pb_error err;
  if (pb_outfile_create(PB_RECORDED, &file, &err)) return 1;
  FILE *stream = fopen(file.temp, "w");
  if (!stream) return 1;
  pb_jsonout json;
  pb_jsonout_begin(&json, stream);
  pb_jsonout_object(&json, NULL);
  pb_jsonout_text(&json, "compiler", c->compiler);
  pb_jsonout_text(&json, "libc", c->libc);
  pb_jsonout_object(&json, "instructions");
  for (size_t k = 0; k < c->cases; k++)
    pb_jsonout_number(&json, c->item[k].name, c->item[k].instructions);
  pb_jsonout_object_end(&json);
  pb_jsonout_object_end(&json);
  pb_jsonout_end(&json);
  return fclose(stream) || pb_outfile_commit(&file, &err);
}

// The counted value of a case; NaN: this processor does not have it.
static double counted_of(const counts *c, const char *name) {
  for (size_t k = 0; k < c->cases; k++)
    if (!strcmp(c->item[k].name, name)) return c->item[k].instructions;
  return NAN;
}

static int compare(const counts *now, const cJSON *recorded) {
  int outside = 0;
  const cJSON *item;
  cJSON_ArrayForEach(item, pb_json_member(recorded, "instructions")) {
    const double before = item->valuedouble, value = counted_of(now, item->string);
    if (isnan(value)) {
      printf("%-14s recorded %.0f; this processor cannot run it: not compared\n", item->string,
             before);
      continue;
    }
    const bool inside = fabs(value / before - 1) <= band;
    printf("%-14s recorded %.0f, now %.0f: %+.1f %%%s\n", item->string, before, value,
           100 * (value / before - 1), inside ? "" : ", OUTSIDE the band of 5 %");
    outside += !inside;
  }
  for (size_t k = 0; k < now->cases; k++) {
    if (pb_json_member(pb_json_member(recorded, "instructions"), now->item[k].name)) continue;
    printf("%-14s now %.0f, never recorded\n", now->item[k].name, now->item[k].instructions);
    outside++;
  }
  if (outside)
    printf("when the change is meant: test_instructions --record, and commit the file\n");
  return outside ? 1 : 0;
}

int main(int argc, char **argv) {
  counts now = {.cases = 0};
  char *text = NULL;
  cJSON *recorded = NULL;
  size_t length = 0;
  pb_error err = {0};
  // A program, not --version: a valgrind without its tools or the C library's symbols runs none.
  if (system("valgrind --tool=callgrind --callgrind-out-file=/dev/null true >/dev/null 2>&1") != 0) {
    printf("skipped: valgrind is not installed, or runs no program here\n");
    return SKIPPED;
  }
  if (!count_now(&now)) {
    printf("callgrind counted nothing\n");
    return 1;
  }
  if (argc > 1 && !strcmp(argv[1], "--record")) return record(&now);
  if (pb_text_read(PB_RECORDED, &text, &length, &err) ||
      pb_json_parse(text, length, &recorded, &err)) {
    printf("%s: %s\n", err.where, err.message);
    return 1;
  }
  int code = SKIPPED;
  if (strcmp(text_of(recorded, "compiler"), now.compiler) != 0 ||
      strcmp(text_of(recorded, "libc"), now.libc) != 0)
    printf("skipped: recorded with compiler %s, libc %s; here are %s, %s\n",
           text_of(recorded, "compiler"), text_of(recorded, "libc"), now.compiler, now.libc);
  else
    code = compare(&now, recorded);
  cJSON_Delete(recorded);
  free(text);
  return code;
}
