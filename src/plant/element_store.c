// See element_store.h.
#include "plant/element_store.h"

#include <string.h>

static pb_element_file look_at(const char *path) {
  struct stat s;
  if (stat(path, &s)) return (pb_element_file){0};
  return (pb_element_file){.known = true,
                           .device = s.st_dev,
                           .inode = s.st_ino,
                           .bytes = s.st_size,
                           .written = s.st_mtim,
                           .changed = s.st_ctim};
}

static bool same_time(struct timespec a, struct timespec b) {
  return a.tv_sec == b.tv_sec && a.tv_nsec == b.tv_nsec;
}

static bool same_file(const pb_element_file *a, const pb_element_file *b) {
  return a->known && b->known && a->device == b->device && a->inode == b->inode &&
         a->bytes == b->bytes && same_time(a->written, b->written) &&
         same_time(a->changed, b->changed);
}

static void drop(pb_element_store *store, size_t at) {
  pb_element_free(store->item[at].element);
  store->item[at] = store->item[--store->count];
}

pb_element *pb_element_store_find(pb_element_store *store, const char *path,
                                  pb_element_file *file) {
  *file = store ? look_at(path) : (pb_element_file){0};
  for (size_t i = 0; store && i < store->count; i++) {
    pb_element_kept *kept = &store->item[i];
    if (!same_file(&kept->file, file)) continue;
    kept->used = ++store->turn;
    return pb_element_share(kept->element);
  }
  // What was read under this name is no longer there.
  for (size_t i = store ? store->count : 0; i-- > 0;)
    if (strcmp(store->item[i].element->file, path) == 0) drop(store, i);
  return NULL;
}

// The place of the element unused for longest; `count` when all are in use.
static size_t idle_longest(const pb_element_store *store) {
  size_t best = store->count;
  for (size_t i = 0; i < store->count; i++) {
    if (pb_element_users(store->item[i].element) > 1) continue;
    if (best == store->count || store->item[i].used < store->item[best].used) best = i;
  }
  return best;
}

void pb_element_store_keep(pb_element_store *store, pb_element *element,
                           const pb_element_file *file) {
  if (!store || !file->known) return;
  if (store->count == PB_ELEMENT_STORE_MOST) {
    const size_t idle = idle_longest(store);
    if (idle == store->count) return;
    drop(store, idle);
  }
  store->item[store->count++] = (pb_element_kept){pb_element_share(element), *file, ++store->turn};
}

void pb_element_store_clear(pb_element_store *store) {
  while (store->count) drop(store, store->count - 1);
}
