// What a caller may lend to the making of a model; each may be NULL, and so may all of it.
#ifndef PB_MODEL_MEANS_H
#define PB_MODEL_MEANS_H

#include "base/phase.h"
#include "base/workers.h"
#include "model/mode_store.h"
#include "plant/element_store.h"

typedef struct pb_means {
  const pb_observer *observer;  // told as each phase begins
  const pb_workers *workers;    // threads besides the caller's own
  pb_element_store *elements;   // that were read before
  pb_mode_store *modes;         // that were solved for before
} pb_means;

// What is there to use, without a test for NULL at each. [any]
static inline pb_means pb_means_of(const pb_means *means) {
  return means ? *means : (pb_means){0};
}

#endif
