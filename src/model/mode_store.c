// See mode_store.h.
#include "model/mode_store.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/array.h"

enum { SMALLEST = 1024, GENERATIONS = 2 };

struct pb_mode_kept {
  pb_mode_kind kind;
  size_t first_count, second_count;
  double *key;  // first, then second
  void *value;
  void (*release)(void *value);
  size_t used;  // turn of the last use
};

static void drop(pb_mode_kept *kept) {
  kept->release(kept->value);
  free(kept->key);
}

void pb_mode_store_begin(pb_mode_store *store) {
  if (!store) return;
  size_t left = 0;
  store->turn++;
  for (size_t i = 0; i < store->count; i++) {
    if (store->item[i].used + GENERATIONS >= store->turn)
      store->item[left++] = store->item[i];
    else
      drop(&store->item[i]);
  }
  store->count = left;
}

// As octets: +0 and −0 differ, and so may what follows from them.
static bool same(const pb_mode_kept *kept, pb_mode_kind kind, const pb_mode_key *key) {
  return kept->kind == kind && kept->first_count == key->first_count &&
         kept->second_count == key->second_count &&
         memcmp(kept->key, key->first, key->first_count * sizeof *kept->key) == 0 &&
         (key->second_count == 0 || memcmp(kept->key + key->first_count, key->second,
                                           key->second_count * sizeof *kept->key) == 0);
}

const void *pb_mode_store_find(pb_mode_store *store, pb_mode_kind kind, const pb_mode_key *key) {
  for (size_t i = 0; store && i < store->count; i++) {
    if (!same(&store->item[i], kind, key)) continue;
    store->item[i].used = store->turn;
    return store->item[i].value;
  }
  return NULL;
}

static bool make_room(pb_mode_store *store) {
  if (store->count < store->room) return true;
  const size_t room = store->room ? 2 * store->room : 4;
  pb_mode_kept *item = realloc(store->item, room * sizeof *item);
  if (!item) return false;
  store->item = item;
  store->room = room;
  return true;
}

const void *pb_mode_store_keep(pb_mode_store *store, pb_mode_kind kind, const pb_mode_key *key,
                               void *value, void (*release)(void *value)) {
  const size_t numbers = key->first_count + key->second_count;
  if (!store || numbers < SMALLEST || !make_room(store)) return NULL;
  double *copy = pb_array_new(numbers, sizeof *copy);
  if (!copy) return NULL;
  memcpy(copy, key->first, key->first_count * sizeof *copy);
  if (key->second_count)
    memcpy(copy + key->first_count, key->second, key->second_count * sizeof *copy);
  store->item[store->count++] = (pb_mode_kept){.kind = kind,
                                               .first_count = key->first_count,
                                               .second_count = key->second_count,
                                               .key = copy,
                                               .value = value,
                                               .release = release,
                                               .used = store->turn};
  return value;
}

void pb_mode_store_clear(pb_mode_store *store) {
  for (size_t i = 0; i < store->count; i++) drop(&store->item[i]);
  free(store->item);
  *store = (pb_mode_store){0};
}
