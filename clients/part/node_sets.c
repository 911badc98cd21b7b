// Node sets of input decks: see node_sets.h.
#include "node_sets.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "part/lines.h"

enum { MOST = 100000000 };  // nodes of a range: a damaged line must not fill the memory

typedef enum block { OTHER, NODES, LIST, GENERATE } block;

typedef struct reading {
  pb_lines in;
  const char *name;
  int64_t *number;
  size_t count, room;
  bool found;
} reading;

static bool keep(reading *r, int64_t number) {
  if (r->count == r->room) {
    size_t room = 2 * r->room + 256;
    int64_t *more = realloc(r->number, room * sizeof *more);
    if (!more) {
      r->in.status = pb_fail_memory(r->in.err, r->in.path);
      return false;
    }
    r->number = more;
    r->room = room;
  }
  r->number[r->count++] = number;
  return true;
}

// The value of NAME= on a keyword line, without blanks, into value; false: it is not there.
static bool parameter(const char *line, const char *key, char *value, size_t size) {
  size_t length = strlen(key);
  for (const char *at = strchr(line, ','); at; at = strchr(at, ',')) {
    at++;
    at += strspn(at, " \t");
    if (strncasecmp(at, key, length)) continue;
    const char *rest = at + length + strspn(at + length, " \t");
    if (*rest == ',' || !*rest) {  // a flag
      value[0] = 0;
      return true;
    }
    if (*rest != '=') continue;
    rest++;
    rest += strspn(rest, " \t");
    size_t n = strcspn(rest, ", \t\r");
    snprintf(value, size, "%.*s", (int)n, rest);
    return true;
  }
  return false;
}

static block open_block(reading *r) {
  const char *line = r->in.text;
  char value[256];
  size_t word = strcspn(line, ", \t\r");
  bool set = word == 5 && !strncasecmp(line, "*nset", 5);
  bool node = word == 5 && !strncasecmp(line, "*node", 5);
  if ((!set && !node) || !parameter(line, "nset", value, sizeof value) ||
      strcasecmp(value, r->name))
    return OTHER;
  r->found = true;
  if (node) return NODES;
  return parameter(line, "generate", value, sizeof value) ? GENERATE : LIST;
}

static void read_range(reading *r) {
  char *at = r->in.text;
  int64_t first, last, step = 1;
  bool good =
      pb_scan_integer(&at, &first) && pb_scan_separator(&at, ",") && pb_scan_integer(&at, &last);
  if (good && pb_scan_separator(&at, ",") && !pb_scan_done(at)) good = pb_scan_integer(&at, &step);
  if (!good || !pb_scan_done(at) || step < 1 || first < 1 || last < first) {
    pb_lines_fail(&r->in, "expected first, last and step of a range of nodes");
    return;
  }
  if ((last - first) / step >= MOST) {
    pb_lines_fail(&r->in, "a range of more than %d nodes", MOST);
    return;
  }
  for (int64_t k = 0; k <= (last - first) / step && keep(r, first + k * step); k++) {
  }
}

static void read_list(reading *r, block kind) {
  char *at = r->in.text;
  int64_t number;
  if (!pb_scan_integer(&at, &number)) {
    pb_lines_fail(&r->in, "expected node numbers (a set named within a set is not read)");
    return;
  }
  while (keep(r, number) && kind == LIST && pb_scan_separator(&at, ",") && !pb_scan_done(at)) {
    if (pb_scan_integer(&at, &number)) continue;
    pb_lines_fail(&r->in, "expected node numbers");
    return;
  }
}

pb_status pb_node_set_read(const char *path, const char *name, int64_t **number, size_t *count,
                           pb_error *err) {
  *number = NULL;
  *count = 0;
  reading r = {.name = name};
  block kind = OTHER;
  pb_status st = pb_lines_open(&r.in, path, err);
  while (!st && pb_lines_next_filled(&r.in)) {
    if (!strncmp(r.in.text, "**", 2)) continue;
    if (r.in.text[0] == '*') {
      kind = open_block(&r);
    } else if (kind == GENERATE) {
      read_range(&r);
    } else if (kind != OTHER) {
      read_list(&r, kind);
    }
    if (r.in.status) break;
  }
  if (!st) st = r.in.status;
  pb_lines_close(&r.in);
  if (!st && !r.found) st = pb_fail(err, PB_ERR_REFERENCE, path, "has no node set %s", name);
  if (st) {
    free(r.number);
    return st;
  }
  *number = r.number;
  *count = r.count;
  return PB_OK;
}
