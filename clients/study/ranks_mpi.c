// The processes of mpirun: see ranks.h. MPI is started only where mpirun has started this process:
// the tool alone is an ordinary program.
#include <limits.h>
#include <mpi.h>
#include <stdlib.h>

#include "ranks.h"

enum { TAG = 1 };

static int rank, ranks = 1;
static bool begun;

pb_status study_ranks_begin(pb_error *err) {
  if (!getenv("OMPI_COMM_WORLD_SIZE") && !getenv("PMI_SIZE")) return PB_OK;
  if (MPI_Init(NULL, NULL) != MPI_SUCCESS)
    return pb_fail(err, PB_ERR_STATE, "mpirun", "MPI does not start");
  begun = true;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &ranks);
  return PB_OK;
}

void study_ranks_end(bool failed) {
  if (begun && failed && ranks > 1) MPI_Abort(MPI_COMM_WORLD, 1);
  if (begun) MPI_Finalize();
  begun = false;
}

size_t study_rank(void) {
  return (size_t)rank;
}

size_t study_ranks(void) {
  return (size_t)ranks;
}

pb_status study_ranks_send(const void *bytes, size_t size, pb_error *err) {
  if (size <= INT_MAX &&
      MPI_Send(bytes, (int)size, MPI_BYTE, 0, TAG, MPI_COMM_WORLD) == MPI_SUCCESS)
    return PB_OK;
  return pb_fail(err, PB_ERR_IO, "mpirun", "a result of %zu bytes cannot be sent", size);
}

pb_status study_ranks_receive(bool wait, void **bytes, size_t *size, pb_error *err) {
  MPI_Status from;
  int there = 1, length = 0;
  *bytes = NULL;
  *size = 0;
  if (wait)
    MPI_Probe(MPI_ANY_SOURCE, TAG, MPI_COMM_WORLD, &from);
  else
    MPI_Iprobe(MPI_ANY_SOURCE, TAG, MPI_COMM_WORLD, &there, &from);
  if (!there) return PB_OK;
  MPI_Get_count(&from, MPI_BYTE, &length);
  *bytes = malloc((size_t)length + 1);
  if (!*bytes) return pb_fail_memory(err, "mpirun");
  *size = (size_t)length;
  MPI_Recv(*bytes, length, MPI_BYTE, from.MPI_SOURCE, TAG, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
  return PB_OK;
}
