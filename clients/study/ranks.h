// The processes that mpirun starts, as far as a study needs them. Built with MPI (ranks_mpi.c) or
// without (ranks_none.c: one process).
#ifndef PB_STUDY_RANKS_H
#define PB_STUDY_RANKS_H

#include <stdbool.h>
#include <stddef.h>

#include "base/status.h"

// Joins the others when mpirun has started this process. PB_ERR_STATE: it has, and the tool was
// built without MPI. [init]
pb_status study_ranks_begin(pb_error *err);
// failed: the others are ended too, as they may wait for this one.
void study_ranks_end(bool failed);

size_t study_rank(void);   // 0: the one that reports
size_t study_ranks(void);  // 1 without mpirun

// Bytes to rank 0. [init]
pb_status study_ranks_send(const void *bytes, size_t size, pb_error *err);

// The next bytes from any other rank, owned by the caller (free); without `wait` *bytes is NULL
// where none are there. [init] PB_ERR_MEMORY.
pb_status study_ranks_receive(bool wait, void **bytes, size_t *size, pb_error *err);

#endif
