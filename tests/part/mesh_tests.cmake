# Meshes, their matrices, and elements built from dimensions.
pb_test(test_mesh LABELS unit SOURCES test_mesh.c LIBS plantbus_part)
pb_test(test_parts LABELS reference long SOURCES test_parts.c LIBS plantbus_part TIMEOUT 300)
pb_test(test_build_tool LABELS e2e SOURCES test_build_tool.c part_run.c LIBS plantbus_part
        cjson TIMEOUT 300 COST 40)
add_dependencies(test_build_tool plantbus-part)
pb_test(test_mesh_fault LABELS fault FAULTS SOURCES test_mesh_fault.c LIBS plantbus_part TIMEOUT 300)
