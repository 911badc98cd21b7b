// What a Cyclone DDS configuration says: see config.h. The middleware's own XML parser is used, so
// that what passes here passes there.
#include "config.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "dds/ddsrt/xmlparser.h"

enum { DEPTH = 16 };

typedef struct walk {
  config_facts *facts;
  char element[DEPTH][48];  // open ones
  int depth;
  char message[256];
  int line;
} walk;

static bool is(const char *a, const char *b) {
  return strcasecmp(a, b) == 0;
}

static int on_open(void *context, uintptr_t parent, uintptr_t *info, const char *name, int line) {
  (void)parent;
  (void)info;
  (void)line;
  walk *w = context;
  if (w->depth >= DEPTH) return -1;
  snprintf(w->element[w->depth++], sizeof w->element[0], "%s", name);
  if (is(name, "NetworkInterface") && w->facts->interfaces < CONFIG_INTERFACES)
    w->facts->interface[w->facts->interfaces++] = (config_interface){0};
  if (is(name, "Peer")) w->facts->peers++;
  return 0;
}

static int on_attribute(void *context, uintptr_t info, const char *name, const char *value,
                        int line) {
  (void)info;
  (void)line;
  walk *w = context;
  if (w->depth == 0 || !is(w->element[w->depth - 1], "NetworkInterface")) return 0;
  if (w->facts->interfaces == 0) return 0;
  config_interface *i = &w->facts->interface[w->facts->interfaces - 1];
  if (is(name, "name")) snprintf(i->name, sizeof i->name, "%s", value);
  if (is(name, "address")) snprintf(i->address, sizeof i->address, "%s", value);
  if (is(name, "multicast") && !is(value, "default")) {
    i->multicast_told = true;
    i->multicast = is(value, "true");
  }
  return 0;
}

// The text without blanks around it.
static void trim(const char *text, char *out, size_t size) {
  text += strspn(text, " \t\r\n");
  snprintf(out, size, "%s", text);
  size_t n = strlen(out);
  while (n > 0 && strchr(" \t\r\n", out[n - 1])) out[--n] = '\0';
}

static int on_data(void *context, uintptr_t info, const char *data, int line) {
  (void)info;
  (void)line;
  walk *w = context;
  char value[128];
  if (w->depth == 0) return 0;
  const char *element = w->element[w->depth - 1];
  trim(data, value, sizeof value);
  if (is(element, "AllowMulticast"))
    w->facts->multicast = !is(value, "false");
  else if (is(element, "ParticipantIndex"))
    w->facts->index_auto = is(value, "auto");
  else if (is(element, "MaxAutoParticipantIndex"))
    w->facts->index_max = (uint32_t)strtoul(value, NULL, 10);
  else if (is(element, "NetworkInterfaceAddress") && w->facts->interfaces == 0 &&
           !is(value, "auto"))
    snprintf(w->facts->interface[w->facts->interfaces++].name, 64, "%.63s", value);
  return 0;
}

static int on_close(void *context, uintptr_t info, int line) {
  (void)info;
  (void)line;
  walk *w = context;
  if (w->depth > 0) w->depth--;
  return 0;
}

static void on_error(void *context, const char *message, int line) {
  walk *w = context;
  if (w->message[0]) return;
  snprintf(w->message, sizeof w->message, "%s", message);
  w->line = line;
}

static pb_status parse(FILE *file, const char *text, const char *name, config_facts *facts,
                       pb_error *err) {
  static const struct ddsrt_xmlp_callbacks callbacks = {on_open, on_attribute, on_data, on_close,
                                                        on_error};
  walk w = {.facts = facts};
  struct ddsrt_xmlp_state *state = file ? ddsrt_xmlp_new_file(file, &w, &callbacks)
                                        : ddsrt_xmlp_new_string(text, &w, &callbacks);
  const int result = state ? ddsrt_xmlp_parse(state) : -1;
  if (state) ddsrt_xmlp_free(state);
  if (result >= 0) return PB_OK;
  return pb_fail(err, PB_ERR_SYNTAX, name, "line %d: %s", w.line,
                 w.message[0] ? w.message : "not well-formed XML");
}

static pb_status read_file(const char *name, config_facts *facts, pb_error *err) {
  struct stat info;
  FILE *file = fopen(name, "r");
  if (!file) return pb_fail(err, PB_ERR_IO, name, "cannot be read: %s", strerror(errno));
  pb_status status = PB_OK;
  if (fstat(fileno(file), &info) != 0 || !S_ISREG(info.st_mode) || info.st_size == 0)
    status = pb_fail(err, PB_ERR_IO, name, "is not a file with a configuration");
  if (!status) status = parse(file, NULL, name, facts, err);
  fclose(file);
  return status;
}

pb_status config_read(const char *text, config_facts *out, pb_error *err) {
  char piece[1024];
  *out = (config_facts){.multicast = true, .index_max = 9};
  for (const char *at = text + strspn(text, " \t\r\n,"); *at; at += strspn(at, " \t\r\n,")) {
    // XML holds commas of its own: it is taken to the end of the text.
    if (*at == '<') return parse(NULL, at, "configuration", out, err);
    const size_t n = strcspn(at, ",");
    if (n >= sizeof piece)
      return pb_fail(err, PB_ERR_ARGUMENT, "configuration", "a file name is too long");
    snprintf(piece, sizeof piece, "%.*s", (int)n, at);
    const pb_status status =
        read_file(strncmp(piece, "file://", 7) == 0 ? piece + 7 : piece, out, err);
    if (status) return status;
    at += n;
  }
  return PB_OK;
}
