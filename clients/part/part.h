// plantbus-part: parts of one's own, from dimensions or from other programs' matrices to elements.
#ifndef PB_CLIENTS_PART_H
#define PB_CLIENTS_PART_H

#include "commands.h"

pb_command_function part_build, part_reduce;
pb_command_function part_doctor, part_import, part_truncate;

#endif
