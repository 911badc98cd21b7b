// The phases of making a model, for those who want to know what takes how long. The library reads
// no clock: an observer is told when a phase begins.
#ifndef PB_BASE_PHASE_H
#define PB_BASE_PHASE_H

typedef enum pb_phase {
  PB_PHASE_READ,        // the file and its elements, checked and decomposed
  PB_PHASE_ASSEMBLE,    // stacked matrices, constraints, signals
  PB_PHASE_ELIMINATE,   // null space, projection, condensation
  PB_PHASE_MODES,       // undamped modes
  PB_PHASE_DAMP,        // damped modes, input and output vectors
  PB_PHASE_DISCRETIZE,  // order, truncation, zero-order hold
  PB_PHASES,
} pb_phase;

// begin is called in the caller's thread as each phase begins.
typedef struct pb_observer {
  void (*begin)(void *context, pb_phase phase);
  void *context;
} pb_observer;

static inline void pb_phase_begin(const pb_observer *observer, pb_phase phase) {
  if (observer) observer->begin(observer->context, phase);
}

#endif
