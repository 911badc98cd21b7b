pb_test(part_matrix_file LABELS unit SOURCES test_matrix_file.c ../support/outside.c
        ../support/beam.c LIBS plantbus_part PkgConfig::MATIO)
