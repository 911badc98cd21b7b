# Readers of other programs' files.
list(APPEND PB_PART_SOURCES lines.c matrix_build.c matrix_calculix.c matrix_file.c matrix_market.c
     node_file.c)
