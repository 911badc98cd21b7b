// Data files that the tools carry with them: see shipped.h.
#include "shipped.h"

#include <math.h>
#include <string.h>

#include "base/json.h"

pb_status pb_shipped_read(const char *path, const char *shipped, cJSON **out, pb_error *err) {
  return path ? pb_json_read(path, out, NULL, err)
              : pb_json_parse(shipped, strlen(shipped), out, err);
}

// Puts the file in front of the JSON pointer of a refusal.
static pb_status name_file(const char *path, pb_status st, pb_error *err) {
  if (st != PB_ERR_SCHEMA || !path) return st;
  const pb_error inner = *err;
  return pb_fail(err, st, path, "%.200s: %.280s", inner.where, inner.message);
}

pb_status pb_shipped_limits(const char *path, const char *shipped, const char *const *known,
                            pb_limits *out, pb_error *err) {
  cJSON *file = NULL;
  *out = (pb_limits){0};
  pb_status st = pb_shipped_read(path, shipped, &file, err);
  if (!st) st = name_file(path, pb_limits_read(file, known, out, err), err);
  cJSON_Delete(file);
  return st;
}

pb_status pb_sheet_read(const cJSON *sheet, const char *where, const char *key, pb_sheet_value *out,
                        pb_error *err) {
  const cJSON *value = pb_json_member(sheet, key);
  char at[256];
  pb_json_pointer(at, sizeof at, where, key);
  *out = (pb_sheet_value){NAN, NAN};
  if (!value || cJSON_IsNull(value)) return PB_OK;
  const cJSON *low = value, *high = value;
  if (cJSON_IsArray(value) && cJSON_GetArraySize(value) == 2) {
    low = value->child;
    high = low->next;
  }
  if (!cJSON_IsNumber(low) || !cJSON_IsNumber(high) || !(low->valuedouble <= high->valuedouble) ||
      !(low->valuedouble > 0))
    return pb_fail(err, PB_ERR_SCHEMA, at, "expected a number > 0, [low, high] or null");
  *out = (pb_sheet_value){low->valuedouble, high->valuedouble};
  return PB_OK;
}

static pb_status check_sheet(const cJSON *sheet, const char *where, const char *const *known,
                             pb_error *err) {
  char at[256];
  if (!cJSON_IsObject(sheet))
    return pb_fail(err, PB_ERR_SCHEMA, where, "expected an object of quantities");
  for (const cJSON *item = sheet->child; item; item = item->next) {
    const char *const *key = known;
    pb_sheet_value value;
    while (*key && strcmp(*key, item->string)) key++;
    pb_json_pointer(at, sizeof at, where, item->string);
    if (!*key) return pb_fail(err, PB_ERR_SCHEMA, at, "is no quantity that this tool knows");
    pb_status st = pb_sheet_read(sheet, where, item->string, &value, err);
    if (st) return st;
  }
  return PB_OK;
}

static pb_status check_sheets(const cJSON *file, const char *const *known, const cJSON **sheets,
                              pb_error *err) {
  const cJSON *schema = pb_json_member(file, "schema");
  if (!cJSON_IsString(schema) || strcmp(schema->valuestring, "plantbus.actuators/1"))
    return pb_fail(err, PB_ERR_SCHEMA, "/schema", "expected \"plantbus.actuators/1\"");
  *sheets = pb_json_member(file, "actuators");
  if (!cJSON_IsObject(*sheets) || !(*sheets)->child)
    return pb_fail(err, PB_ERR_SCHEMA, "/actuators", "expected an object of actuators");
  for (const cJSON *item = (*sheets)->child; item; item = item->next) {
    char where[256];
    pb_json_pointer(where, sizeof where, "/actuators", item->string);
    pb_status st = check_sheet(item, where, known, err);
    if (st) return st;
  }
  return PB_OK;
}

pb_status pb_shipped_sheets(const char *path, const char *const *known, cJSON **file,
                            const cJSON **sheets, pb_error *err) {
  pb_status st = pb_shipped_read(path, pb_shipped_actuators, file, err);
  return st ? st : name_file(path, check_sheets(*file, known, sheets, err), err);
}
