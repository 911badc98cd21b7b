// plantbus-actuator: the questions that the choice and the modelling of an amplified actuator ask.
#include "actuator.h"

static const pb_command commands[] = {
    {"characterize", command_characterize,
     "stiffness, resonance, amplification, stroke of an actuator, beside its data sheet"},
    {"constants", command_constants, "actuator and sensor constants from piezoelectric properties"},
    {"select", command_select, "actuators against a specification"},
    {"fit", command_fit, "the 2-DoF model tuned to an element or to a measured response"},
    {"boundary", command_boundary, "sensor stack open, short-circuited, or with a resistor"},
    {0},
};

const char *const actuator_quantities[] = {"stroke",          "stiffness", "resolution",
                                           "blocked_force",   "height",    "mass",
                                           "stack_stiffness", "resonance", NULL};

int main(int argc, char **argv) {
  return pb_commands_run(argc, argv, "Answers questions on amplified piezoelectric actuators.",
                         commands);
}
