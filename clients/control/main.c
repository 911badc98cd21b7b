// plantbus-control: integral force feedback, then a high authority controller around it: designed,
// judged, and run on the bus.
#include "commands.h"
#include "control_tool.h"

static const pb_command commands[] = {
    {"iff", command_iff, "Best IFF gain and the damped plant, predicted or measured"},
    {"hac", command_hac, "HAC around the damped plant: loop shape, margins, sensitivity, export"},
    {"run", command_run, "HAC-LAC over the bus under a disturbance, measured and predicted"},
    {0},
};

int main(int argc, char **argv) {
  return pb_commands_run(
      argc, argv, "Designs and judges the control of a plant: HAC-LAC on the hexapod.", commands);
}
