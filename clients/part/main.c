// plantbus-part: parts of one's own, from dimensions or from other programs' matrices to elements.
#include "part.h"

static const pb_command commands[] = {
    {"build", part_build, "from dimensions to an element"},
    {"reduce", part_reduce, "full K and M from outside to an element"},
    {"import", part_import, "from other programs' matrices to an element"},
    {"doctor", part_doctor, "what is wrong with an element, and its repair"},
    {"truncate", part_truncate, "an element with as few modes as a band needs"},
    {0},
};

int main(int argc, char **argv) {
  return pb_commands_run(argc, argv,
                         "Builds, reduces, imports and examines super-elements for plant files.",
                         commands);
}
