// plantbus-control: integral force feedback, then a high authority controller around it: designed,
// judged, and run on the bus.
#include <malloc.h>

#include "commands.h"
#include "control_tool.h"

// Of OpenBLAS, when that is the BLAS in use.
void openblas_set_num_threads(int count) __attribute__((weak));

static const pb_command commands[] = {
    {"iff", command_iff, "Best IFF gain and the damped plant, predicted or measured"},
    {"hac", command_hac, "HAC around the damped plant: loop shape, margins, sensitivity, export"},
    {"run", command_run, "HAC-LAC over the bus under a disturbance, measured and predicted"},
    {0},
};

int main(int argc, char **argv) {
  // One thread: the products are small, and on a busy machine each would wait for the slowest.
  if (openblas_set_num_threads) openblas_set_num_threads(1);
  // Responses take large work space thousands of times: it is kept, not mapped anew each time,
  // which takes several times as long as the responses.
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  return pb_commands_run(
      argc, argv, "Designs and judges the control of a plant: HAC-LAC on the hexapod.", commands);
}
