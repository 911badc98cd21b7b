// Strict JSON on top of cJSON: see json.h.
#include "base/json.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/json_scan.h"
#include "base/text.h"

void pb_json_pointer(char *out, size_t size, const char *base, const char *key) {
  char buffer[256];
  size_t n = (size_t)snprintf(buffer, sizeof buffer, "%s/", base);
  if (n >= sizeof buffer) n = sizeof buffer - 1;
  for (; *key && n + 3 < sizeof buffer; key++) {
    if (*key == '~' || *key == '/') {
      buffer[n++] = '~';
      buffer[n++] = *key == '~' ? '0' : '1';
    } else {
      buffer[n++] = *key;
    }
  }
  buffer[n] = '\0';
  snprintf(out, size, "%s", buffer);
}

const cJSON *pb_json_member(const cJSON *object, const char *key) {
  return cJSON_GetObjectItemCaseSensitive(object, key);
}

static int key_compare(const void *a, const void *b) {
  return strcmp(*(const char *const *)a, *(const char *const *)b);
}

// Refuses an object that names a key twice. Sorting keeps a hostile text from costing n².
static pb_status check_keys(const cJSON *object, const char *pointer, pb_error *err) {
  size_t n = 0, i = 0;
  for (const cJSON *m = object->child; m; m = m->next) n++;
  if (n < 2) return PB_OK;
  const char **key = malloc(n * sizeof *key);
  if (!key) return pb_fail_memory(err, pointer);
  for (const cJSON *m = object->child; m; m = m->next) key[i++] = m->string;
  qsort(key, n, sizeof *key, key_compare);
  pb_status st = PB_OK;
  for (i = 1; i < n && !st; i++) {
    if (strcmp(key[i - 1], key[i])) continue;
    char where[256];
    pb_json_pointer(where, sizeof where, pointer, key[i]);
    st = pb_fail(err, PB_ERR_SYNTAX, where, "the key is given twice");
  }
  free(key);
  return st;
}

static pb_status check_value(const cJSON *value, const char *pointer, pb_error *err) {
  if (cJSON_IsNumber(value) && !isfinite(value->valuedouble))
    return pb_fail(err, PB_ERR_SYNTAX, pointer, "the number is too large for a double");
  if (cJSON_IsObject(value)) {
    pb_status st = check_keys(value, pointer, err);
    if (st) return st;
  }
  size_t index = 0;
  for (const cJSON *child = value->child; child; child = child->next, index++) {
    char where[256], number[24];
    snprintf(number, sizeof number, "%zu", index);
    pb_json_pointer(where, sizeof where, pointer, child->string ? child->string : number);
    pb_status st = check_value(child, where, err);
    if (st) return st;
  }
  return PB_OK;
}

static pb_status fail_at(pb_error *err, const char *text, const char *at, const char *what) {
  size_t line = 1, column = 1;
  for (const char *p = text; p < at; p++) {
    column++;
    if (*p == '\n') line++, column = 1;
  }
  return pb_fail(err, PB_ERR_SYNTAX, "", "line %zu, column %zu: %s", line, column, what);
}

pb_status pb_json_parse(const char *text, size_t length, cJSON **out, pb_error *err) {
  *out = NULL;
  const char *nul = memchr(text, '\0', length);
  if (nul) return fail_at(err, text, nul, "a NUL character in the text");
  char *copy = malloc(length + 1);  // cJSON reads on to a terminator
  if (!copy) return pb_fail_memory(err, "");
  memcpy(copy, text, length);
  copy[length] = '\0';
  const char *end = NULL, *what;
  cJSON *value = NULL;
  pb_status st = PB_OK;
  const char *offence = pb_json_scan(copy, &what);
  if (offence) {
    st = fail_at(err, copy, offence, what);
    goto done;
  }
  value = cJSON_ParseWithOpts(copy, &end, 0);
  if (!value) {
    size_t at = end >= copy && end <= copy + length ? (size_t)(end - copy) : 0;
    st = fail_at(err, copy, copy + at, "not well-formed JSON");
    goto done;
  }
  end += strspn(end, " \t\r\n");
  if (*end) {
    st = fail_at(err, copy, end, "text after the end of the JSON value");
    goto done;
  }
  st = check_value(value, "", err);
done:
  free(copy);
  if (st) {
    cJSON_Delete(value);
  } else {
    *out = value;
  }
  return st;
}

pb_status pb_json_read(const char *path, cJSON **out, char **text, pb_error *err) {
  *out = NULL;
  if (text) *text = NULL;
  char *t = NULL;
  size_t length = 0;
  pb_error inner = {0};
  pb_status st = pb_text_read(path, &t, &length, err);
  if (st) return st;
  st = pb_json_parse(t, length, out, &inner);
  if (st) {
    pb_fail(err, st, path, "%s%s%s", inner.where, inner.where[0] ? ": " : "", inner.message);
  } else if (text) {
    *text = t;
    t = NULL;
  }
  free(t);
  return st;
}

static bool is_flat(const cJSON *array) {
  for (const cJSON *m = array->child; m; m = m->next)
    if (cJSON_IsObject(m) || cJSON_IsArray(m)) return false;
  return true;
}

static void print_string(pb_text *t, const char *s) {
  pb_text_append(t, "\"");
  for (; *s; s++) {
    unsigned char c = (unsigned char)*s;
    if (c == '"' || c == '\\') {
      pb_text_format(t, "\\%c", c);
    } else if (c < 0x20) {
      pb_text_format(t, "\\u%04x", c);
    } else {
      pb_text_append_n(t, s, 1);
    }
  }
  pb_text_append(t, "\"");
}

static void print_line(pb_text *t, bool pretty, int depth) {
  if (!pretty) return;
  pb_text_format(t, "\n%*s", 2 * depth, "");
}

static void print_value(pb_text *t, const cJSON *v, bool pretty, int depth) {
  char number[40];
  if (cJSON_IsObject(v) || cJSON_IsArray(v)) {
    bool object = cJSON_IsObject(v), flat = !object && is_flat(v), lines = pretty && !flat;
    pb_text_append(t, object ? "{" : "[");
    for (const cJSON *m = v->child; m; m = m->next) {
      print_line(t, lines, depth + 1);
      if (object) {
        print_string(t, m->string);
        pb_text_append(t, pretty ? ": " : ":");
      }
      print_value(t, m, pretty, depth + 1);
      if (m->next) pb_text_append(t, pretty && flat ? ", " : ",");
    }
    if (v->child) print_line(t, lines, depth);
    pb_text_append(t, object ? "}" : "]");
  } else if (cJSON_IsString(v)) {
    print_string(t, v->valuestring);
  } else if (cJSON_IsNumber(v)) {
    pb_text_number(number, sizeof number, v->valuedouble);
    pb_text_append(t, isfinite(v->valuedouble) ? number : "null");
  } else {
    pb_text_append(t, cJSON_IsTrue(v) ? "true" : cJSON_IsFalse(v) ? "false" : "null");
  }
}

static pb_status print(const cJSON *value, bool pretty, char **out, pb_error *err) {
  pb_text t = {0};
  print_value(&t, value, pretty, 0);
  if (pretty) pb_text_append(&t, "\n");
  *out = t.text;
  return t.failed ? pb_fail_memory(err, "") : PB_OK;
}

pb_status pb_json_print(const cJSON *value, char **out, pb_error *err) {
  return print(value, true, out, err);
}

pb_status pb_json_print_compact(const cJSON *value, char **out, pb_error *err) {
  return print(value, false, out, err);
}

// Sets object[key] in place of what is there, so that the order of keys stays. Takes `value` over.
static bool set_member(cJSON *object, const char *key, cJSON *value) {
  bool ok = value != NULL;
  if (ok && pb_json_member(object, key)) {
    ok = cJSON_ReplaceItemInObjectCaseSensitive(object, key, value);
    if (ok) return value->string != NULL;  // cJSON up to 1.7.15 replaces without its key's memory
  } else if (ok) {
    ok = cJSON_AddItemToObject(object, key, value);
  }
  if (!ok) cJSON_Delete(value);
  return ok;
}

cJSON *pb_json_merge(const cJSON *target, const cJSON *patch) {
  if (!cJSON_IsObject(patch)) return cJSON_Duplicate(patch, 1);
  cJSON *out = cJSON_IsObject(target) ? cJSON_Duplicate(target, 1) : cJSON_CreateObject();
  bool ok = out != NULL;
  for (const cJSON *p = patch->child; ok && p; p = p->next) {
    if (cJSON_IsNull(p))
      cJSON_DeleteItemFromObjectCaseSensitive(out, p->string);
    else
      ok = set_member(out, p->string, pb_json_merge(pb_json_member(out, p->string), p));
  }
  if (ok) return out;
  cJSON_Delete(out);
  return NULL;
}
