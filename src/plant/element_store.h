// Elements that were read and decomposed, kept from one plant file to the next.
//
// A plant that is changed while it runs is read anew, but rarely its elements: an entry serves as
// long as its file is the same one (device, inode, size, times of change). The owner hands the
// store to pb_plant_parse_stored; one thread at a time uses it, while others may hold elements.
#ifndef PB_PLANT_ELEMENT_STORE_H
#define PB_PLANT_ELEMENT_STORE_H

#include <stdbool.h>
#include <sys/stat.h>

#include "plant/element.h"

enum { PB_ELEMENT_STORE_MOST = 32 };  // kept; elements in use by a plant are not dropped for others

typedef struct pb_element_file {
  bool known;  // false: the file cannot be told from another one, nothing is kept
  dev_t device;
  ino_t inode;
  off_t bytes;
  struct timespec written, changed;
} pb_element_file;

typedef struct pb_element_kept {
  pb_element *element;  // one user
  pb_element_file file;
  size_t used;  // `turn` of the last use
} pb_element_kept;

// Zero-initialise; free with pb_element_store_clear.
typedef struct pb_element_store {
  size_t count, turn;
  pb_element_kept item[PB_ELEMENT_STORE_MOST];
} pb_element_store;

// The element read earlier from the file that this path leads to, under whatever path, one more
// user for the caller; NULL: none, or the file was changed. *file tells which file is there, as of
// before it is read. Without a store (NULL) nothing is found. [init]
pb_element *pb_element_store_find(pb_element_store *store, const char *path, pb_element_file *file);

// Keeps an element just read from `file`, in place of one that nobody else uses when the store is
// full; a full store of elements in use stays as it is. [init]
void pb_element_store_keep(pb_element_store *store, pb_element *element,
                           const pb_element_file *file);

void pb_element_store_clear(pb_element_store *store);

#endif
