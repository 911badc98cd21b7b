// The revisions of a daemon's plant.
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/json.h"
#include "configure.h"
#include "jsontext.h"
#include "table.h"

// The list of revisions; owned by the caller.
static pb_status revisions_get(const configure_options *o, pb_session *session, cJSON **out,
                               pb_error *err) {
  char *text = NULL;
  cJSON *result = NULL;
  *out = NULL;
  pb_status status = pb_session_request(session, "history", NULL, o->timeout, &text, err);
  if (!status) status = pb_json_parse(text, strlen(text), &result, err);
  if (!status) *out = cJSON_DetachItemFromObjectCaseSensitive(result, "revisions");
  if (!status && !cJSON_IsArray(*out))
    status = pb_fail(err, PB_ERR_SYNTAX, "/revisions", "is missing in the daemon's answer");
  cJSON_Delete(result);
  free(text);
  return status;
}

pb_status history_entry(const configure_options *o, pb_session *session, double revision,
                        cJSON **out, pb_error *err) {
  cJSON *list = NULL;
  const cJSON *found = NULL;
  double newest = -1.0;
  *out = NULL;
  pb_status status = revisions_get(o, session, &list, err);
  if (!status)
    for (const cJSON *e = list->child; e; e = e->next) {
      const cJSON *number = pb_json_member(e, "revision");
      const double n = cJSON_IsNumber(number) ? number->valuedouble : -1.0;
      if (n < 0.0 || n < newest || (revision > 0.0 && n != revision)) continue;
      newest = n;
      found = e;
    }
  if (found && !(*out = cJSON_Duplicate(found, 1))) status = pb_fail_memory(err, "history");
  cJSON_Delete(list);
  return status;
}

enum { PATCH_WIDTH = 48 };

// A text as it is, anything else as JSON; long ones are cut at a character's end.
static pb_status cell(pb_table *table, const cJSON *entry, const char *key, pb_error *err) {
  const cJSON *item = pb_json_member(entry, key);
  char *made = NULL, text[PATCH_WIDTH + 4];
  pb_status status = PB_OK;
  if (item && !cJSON_IsString(item) && !cJSON_IsNull(item))
    status = pb_json_print_compact(item, &made, err);
  const char *source = made ? made : cJSON_IsString(item) ? item->valuestring : "";
  size_t n = strnlen(source, PATCH_WIDTH);
  while (source[n] && n > 0 && ((unsigned char)source[n] & 0xc0) == 0x80) n--;
  snprintf(text, sizeof text, "%.*s%s", (int)n, source, source[n] ? "…" : "");
  for (char *c = text; *c; c++)
    if ((unsigned char)*c < ' ' || *c == 0x7f) *c = ' ';
  pb_table_text(table, text);
  free(made);
  return status;
}

static void number(pb_table *table, const cJSON *entry, const char *key) {
  const cJSON *item = pb_json_member(entry, key);
  if (cJSON_IsNumber(item))
    pb_table_number(table, item->valuedouble);
  else
    pb_table_text(table, "");
}

static void count(pb_table *table, const cJSON *entry, const char *key) {
  const cJSON *item = pb_json_member(entry, key);
  if (cJSON_IsNumber(item) && item->valuedouble >= 0.0)
    pb_table_count(table, (size_t)item->valuedouble);
  else
    pb_table_text(table, "");
}

// Seconds since 1970 as the local date and time of day.
static pb_status when(pb_table *table, const cJSON *entry, pb_error *err) {
  const cJSON *item = pb_json_member(entry, "time");
  char text[32];
  struct tm local;
  const time_t seconds = cJSON_IsNumber(item) ? (time_t)item->valuedouble : 0;
  if (!cJSON_IsNumber(item) || !localtime_r(&seconds, &local) ||
      strftime(text, sizeof text, "%F %T", &local) == 0)
    return cell(table, entry, "time", err);
  pb_table_text(table, text);
  return PB_OK;
}

static pb_status row(pb_table *table, const cJSON *entry, pb_error *err) {
  count(table, entry, "revision");
  pb_status status = when(table, entry, err);
  count(table, entry, "epoch");
  count(table, entry, "step");
  if (!status) status = cell(table, entry, "client_name", err);
  count(table, entry, "states");
  number(table, entry, "output_jump");
  number(table, entry, "energy_before");
  number(table, entry, "energy_after");
  if (!status) status = cell(table, entry, "comment", err);
  if (!status) status = cell(table, entry, "patch", err);
  return status;
}

pb_status configure_history(const configure_options *o, pb_session *session, pb_error *err) {
  cJSON *list = NULL;
  pb_table table = {0};
  pb_status status = revisions_get(o, session, &list, err);
  if (!status && o->json) {
    status = pb_json_show(list, stdout, err);
  } else if (!status) {
    pb_table_number_column(&table, "revision", NULL, 10);
    pb_table_text_column(&table, "time");
    pb_table_number_column(&table, "epoch", NULL, 10);
    pb_table_number_column(&table, "step", NULL, 15);
    pb_table_text_column(&table, "client");
    pb_table_number_column(&table, "states", NULL, 10);
    pb_table_number_column(&table, "output jump", NULL, 4);
    pb_table_number_column(&table, "energy before", "J", 4);
    pb_table_number_column(&table, "energy after", "J", 4);
    pb_table_text_column(&table, "comment");
    pb_table_text_column(&table, "patch");
    for (const cJSON *e = list->child; e && !status; e = e->next) status = row(&table, e, err);
    if (!status) status = pb_table_print(&table, stdout, 0, err);
  }
  pb_table_free(&table);
  cJSON_Delete(list);
  return status;
}
