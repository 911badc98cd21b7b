// Modes that were solved for, kept from one compilation to the next.
//
// A change of a running plant rarely touches all of it: a sensor or an amplifier leaves every mode
// as it was, a damper the undamped ones, and going back to the plant before is a change, too. What
// was solved is found again by the matrices that it was solved from, number by number: what is
// taken from here has the bits that solving anew would give.
#ifndef PB_MODEL_MODE_STORE_H
#define PB_MODEL_MODE_STORE_H

#include <stddef.h>

typedef enum pb_mode_kind {
  PB_MODES_UNDAMPED,  // modes.c: from K and M
  PB_MODES_DAMPED,    // group_damped.c: from Ω and Ĉ
  PB_MODES_DENSE,     // group.c: from a group's state matrix
} pb_mode_kind;

// What something was solved from: two lists of numbers, the second may be empty.
typedef struct pb_mode_key {
  const double *first, *second;
  size_t first_count, second_count;
} pb_mode_key;

typedef struct pb_mode_kept pb_mode_kept;

// Zero-initialise; free with pb_mode_store_clear. One compilation at a time uses it.
typedef struct pb_mode_store {
  size_t count, room, turn;
  pb_mode_kept *item;
} pb_mode_store;

// Begins a compilation: what neither of the last two has used is given up. [init]
void pb_mode_store_begin(pb_mode_store *store);

// The solution kept for this key, the store's own, for reading until the next compilation begins.
// NULL: none, or no store. [init]
const void *pb_mode_store_find(pb_mode_store *store, pb_mode_kind kind, const pb_mode_key *key);

// Takes `value` over, to be freed with `release`, and returns it; copies the key. NULL: it could
// not be kept and stays the caller's (no store, no memory, or fewer than 1024 numbers in the key,
// which are solved for as quickly as they are found). [init]
const void *pb_mode_store_keep(pb_mode_store *store, pb_mode_kind kind, const pb_mode_key *key,
                               void *value, void (*release)(void *value));

void pb_mode_store_clear(pb_mode_store *store);

#endif
