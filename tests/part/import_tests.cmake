pb_test(part_matrix_file LABELS unit SOURCES test_matrix_file.c ../support/outside.c
        ../support/beam.c LIBS plantbus_part PkgConfig::MATIO)
pb_test(part_element_doctor LABELS unit SOURCES test_element_doctor.c ../support/outside.c
        ../support/beam.c LIBS PkgConfig::MATIO)
pb_test(part_truncate LABELS unit SOURCES test_truncate.c ../support/beam.c
        LIBS plantbus_part PkgConfig::MATIO)
pb_test(part_import LABELS unit SOURCES test_import.c ../support/outside.c ../support/beam.c
        LIBS plantbus_part PkgConfig::MATIO)
