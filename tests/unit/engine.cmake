# The daemon's logic, without DDS.
pb_test(test_engine_command LABELS unit SOURCES test_engine_command.c engine_rig.c
        LIBS plantbus_engine)
pb_test(test_engine_channel LABELS unit SOURCES test_engine_channel.c engine_rig.c
        LIBS plantbus_engine)
pb_test(test_engine_barrier LABELS unit SOURCES test_engine_barrier.c engine_rig.c
        LIBS plantbus_engine)
pb_test(test_realtime LABELS unit SOURCES test_realtime.c LIBS plantbus_stepping)
set_tests_properties(test_realtime PROPERTIES RUN_SERIAL TRUE)
