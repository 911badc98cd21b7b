// plantbus-joint: the questions that the choice and the modelling of a flexible joint ask.
#include "joint.h"

static const pb_command commands[] = {
    {"characterize", command_characterize,
     "axial, shear, bending and torsion stiffness of a joint, against a specification"},
    {0},
};

int main(int argc, char **argv) {
  return pb_commands_run(argc, argv, "Answers questions on flexible joints.", commands);
}
