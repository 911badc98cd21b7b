pb_test(part_matrix_file LABELS unit SOURCES test_matrix_file.c ../support/outside.c
        ../support/beam.c LIBS plantbus_part PkgConfig::MATIO)
pb_test(part_element_doctor LABELS unit SOURCES test_element_doctor.c ../support/outside.c
        ../support/beam.c LIBS PkgConfig::MATIO)
pb_test(part_truncate LABELS unit SOURCES test_truncate.c ../support/beam.c
        LIBS plantbus_part PkgConfig::MATIO)
pb_test(part_import LABELS unit SOURCES test_import.c ../support/outside.c ../support/beam.c
        LIBS plantbus_part PkgConfig::MATIO)

pb_test(fault_import LABELS fault FAULTS SOURCES ../fault/test_import_faults.c ../support/outside.c
        ../support/beam.c LIBS plantbus_part PkgConfig::MATIO TIMEOUT 300)

pb_test(part_import_tool LABELS e2e SOURCES test_import_tool.c part_run.c ../support/outside.c
        ../support/beam.c LIBS plantbus_part cjson PkgConfig::MATIO)
add_dependencies(part_import_tool plantbus-part plantbus-model)
