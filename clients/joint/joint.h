// plantbus-joint: its commands.
#ifndef PB_JOINT_JOINT_H
#define PB_JOINT_JOINT_H

#include "commands.h"

int command_characterize(int argc, char **argv);

#endif
