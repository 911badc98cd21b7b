# Tests of the reduction.
pb_test(test_reduce LABELS unit SOURCES test_reduce.c truss.c LIBS plantbus_part)
pb_test(fault_reduce LABELS fault FAULTS SOURCES test_reduce_fault.c truss.c LIBS plantbus_part)
target_include_directories(fault_reduce SYSTEM PRIVATE ${CHOLMOD_INCLUDE})
target_link_libraries(fault_reduce PRIVATE suitesparseconfig)
pb_test(test_reduce_tool LABELS e2e SOURCES test_reduce_tool.c truss.c ../e2e/tool_run.c
        LIBS plantbus_part plantbus_e2e cjson)
add_dependencies(test_reduce_tool plantbus-part)
