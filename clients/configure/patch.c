// A value at a place as a merge patch: see patch.h.
#include "patch.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/json.h"

enum { TOKEN = 256 };

// Copies the next token of *at, unescaped, and moves *at behind it. pointer is for messages.
static pb_status token_next(const char **at, const char *pointer, char out[TOKEN], pb_error *err) {
  size_t n = 0;
  const char *p = *at + (**at == '/');
  for (; *p && *p != '/'; p++) {
    char c = *p;
    if (c == '~') {
      if (p[1] != '0' && p[1] != '1')
        return pb_fail(err, PB_ERR_ARGUMENT, pointer,
                       "~ must be written ~0, and / inside a key ~1");
      c = *++p == '0' ? '~' : '/';
    }
    if (n + 1 >= TOKEN) return pb_fail(err, PB_ERR_ARGUMENT, pointer, "a key is too long");
    out[n++] = c;
  }
  out[n] = '\0';
  *at = p;
  return PB_OK;
}

// The index of an array's element; −1: not a number as RFC 6901 wants it.
static int index_read(const char *token) {
  const size_t length = strlen(token);
  if (length == 0 || length > 8 || token[strspn(token, "0123456789")]) return -1;
  if (token[0] == '0' && length > 1) return -1;
  return atoi(token);
}

static const cJSON *child_of(const cJSON *value, const char *token) {
  if (cJSON_IsObject(value)) return pb_json_member(value, token);
  if (!cJSON_IsArray(value)) return NULL;
  const int index = index_read(token);
  return index < 0 ? NULL : cJSON_GetArrayItem(value, index);
}

// The part of the pointer up to `at`.
static pb_status fail_missing(pb_error *err, const char *pointer, const char *at) {
  char where[256];
  snprintf(where, sizeof where, "%.*s", (int)(at - pointer), pointer);
  return pb_fail(err, PB_ERR_REFERENCE, where, "is not in the plant file");
}

pb_status pb_pointer_find(const cJSON *document, const char *pointer, const cJSON **out,
                          pb_error *err) {
  char token[TOKEN];
  const cJSON *value = document;
  *out = NULL;
  for (const char *at = pointer; *at;) {
    pb_status status = token_next(&at, pointer, token, err);
    if (status) return status;
    value = child_of(value, token);
    if (!value) return fail_missing(err, pointer, at);
  }
  *out = value;
  return PB_OK;
}

// ---- an object in the place of another ----------------------------------------------------------

static pb_status difference(const cJSON *old, const cJSON *value, const char *where, cJSON **out,
                            pb_error *err);

// Adds what is made for a key; takes it over.
static pb_status add(cJSON *object, const char *key, cJSON *value, pb_error *err) {
  if (value && cJSON_AddItemToObject(object, key, value)) return PB_OK;
  cJSON_Delete(value);
  return pb_fail_memory(err, key);
}

static pb_status members_make(const cJSON *old, const cJSON *value, const char *where, cJSON *out,
                              pb_error *err) {
  pb_status status = PB_OK;
  if (cJSON_IsObject(old))
    for (const cJSON *m = old->child; m && !status; m = m->next)
      if (!pb_json_member(value, m->string)) status = add(out, m->string, cJSON_CreateNull(), err);
  for (const cJSON *m = value->child; m && !status; m = m->next) {
    char place[256];
    cJSON *part = NULL;
    pb_json_pointer(place, sizeof place, where, m->string);
    if (cJSON_IsNull(m))
      return pb_fail(err, PB_ERR_ARGUMENT, place, "a merge patch cannot set a member to null");
    const cJSON *before = cJSON_IsObject(old) ? pb_json_member(old, m->string) : NULL;
    status = difference(before, m, place, &part, err);
    if (!status) status = add(out, m->string, part, err);
  }
  return status;
}

// The patch that turns `old` (may be NULL) into `value`.
static pb_status difference(const cJSON *old, const cJSON *value, const char *where, cJSON **out,
                            pb_error *err) {
  *out = NULL;
  cJSON *made = cJSON_IsObject(value) ? cJSON_CreateObject() : cJSON_Duplicate(value, 1);
  if (!made) return pb_fail_memory(err, where);
  pb_status status = cJSON_IsObject(value) ? members_make(old, value, where, made, err) : PB_OK;
  if (status)
    cJSON_Delete(made);
  else
    *out = made;
  return status;
}

// ---- an element in an array ---------------------------------------------------------------------

// Puts a copy of the value at the last token of a container that is a copy itself.
static pb_status put(cJSON *container, const char *token, const cJSON *value, const char *pointer,
                     pb_error *err) {
  const int size = cJSON_IsArray(container) ? cJSON_GetArraySize(container) : 0;
  const int index = strcmp(token, "-") == 0 ? size : index_read(token);
  if (cJSON_IsArray(container) && (index < 0 || index > size))
    return pb_fail(err, PB_ERR_REFERENCE, pointer, "the array has %d elements", size);
  cJSON *copy = cJSON_Duplicate(value, 1);
  bool good = copy != NULL;
  if (good && cJSON_IsArray(container) && index == size)
    good = cJSON_AddItemToArray(container, copy);
  else if (good && cJSON_IsArray(container))
    good = cJSON_ReplaceItemInArray(container, index, copy);
  else if (good && pb_json_member(container, token))
    good = cJSON_ReplaceItemInObjectCaseSensitive(container, token, copy);
  else if (good)
    good = cJSON_AddItemToObject(container, token, copy);
  if (good) return PB_OK;
  cJSON_Delete(copy);
  return pb_fail_memory(err, pointer);
}

// A copy of the array with the value at the rest of the pointer. A null there is a null.
static pb_status array_changed(const cJSON *array, const char *rest, const char *pointer,
                               const cJSON *value, cJSON **out, pb_error *err) {
  char token[TOKEN];
  cJSON *copy = cJSON_Duplicate(array, 1), *at = copy;
  *out = NULL;
  pb_status status = copy ? PB_OK : pb_fail_memory(err, pointer);
  while (!status) {
    status = token_next(&rest, pointer, token, err);
    if (status || !*rest) break;
    at = (cJSON *)child_of(at, token);
    if (!at) status = fail_missing(err, pointer, rest);
  }
  if (!status && !cJSON_IsArray(at) && !cJSON_IsObject(at))
    status = pb_fail(err, PB_ERR_REFERENCE, pointer, "its parent is neither object nor array");
  if (!status) status = put(at, token, value, pointer, err);
  if (status)
    cJSON_Delete(copy);
  else
    *out = copy;
  return status;
}

// ---- the patch ----------------------------------------------------------------------------------

static pb_status make(const cJSON *value_now, const char *at, const char *pointer,
                      const cJSON *value, cJSON **out, pb_error *err) {
  char token[TOKEN];
  cJSON *inner = NULL;
  if (cJSON_IsArray(value_now)) return array_changed(value_now, at, pointer, value, out, err);
  if (!cJSON_IsObject(value_now))
    return pb_fail(err, PB_ERR_REFERENCE, pointer, "its parent is neither object nor array");
  pb_status status = token_next(&at, pointer, token, err);
  if (status) return status;
  // Objects on the way that the file lacks are made: what a template expands to is changed so. The
  // daemon judges the file that results.
  static const cJSON nothing = {.type = cJSON_Object};
  const cJSON *child = pb_json_member(value_now, token);
  if (*at && !child && cJSON_IsNull(value)) return fail_missing(err, pointer, at);
  if (*at && !child) child = &nothing;
  status = *at ? make(child, at, pointer, value, &inner, err)
               : difference(child, value, pointer, &inner, err);
  if (status) return status;
  cJSON *object = cJSON_CreateObject();
  status = object ? PB_OK : pb_fail_memory(err, pointer);
  if (status)
    cJSON_Delete(inner);
  else
    status = add(object, token, inner, err);
  if (status)
    cJSON_Delete(object);
  else
    *out = object;
  return status;
}

pb_status pb_patch_make(const cJSON *document, const char *pointer, const cJSON *value, cJSON **out,
                        pb_error *err) {
  *out = NULL;
  if (!*pointer)
    return pb_fail(err, PB_ERR_ARGUMENT, "pointer",
                   "the whole file cannot be set; patch takes an object");
  return make(document, pointer, pointer, value, out, err);
}
