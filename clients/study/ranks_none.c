// Built without MPI: see ranks.h.
#include <stdlib.h>

#include "ranks.h"

pb_status study_ranks_begin(pb_error *err) {
  const char *size = getenv("OMPI_COMM_WORLD_SIZE");
  if (!size || atoi(size) <= 1) return PB_OK;
  return pb_fail(err, PB_ERR_STATE, "mpirun",
                 "this plantbus-study was built without MPI; each process would do all the work");
}

void study_ranks_end(bool failed) {
  (void)failed;
}

size_t study_rank(void) {
  return 0;
}

size_t study_ranks(void) {
  return 1;
}

pb_status study_ranks_send(const void *bytes, size_t size, pb_error *err) {
  (void)bytes;
  (void)size;
  return pb_fail(err, PB_ERR_STATE, "mpirun", "there is no other process");
}

pb_status study_ranks_receive(bool wait, void **bytes, size_t *size, pb_error *err) {
  *bytes = NULL;
  *size = 0;
  return wait ? pb_fail(err, PB_ERR_STATE, "mpirun", "there is no other process") : PB_OK;
}
