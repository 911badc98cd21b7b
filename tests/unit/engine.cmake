# The daemon's logic, without DDS.
pb_test(test_engine_command LABELS unit SOURCES test_engine_command.c engine_rig.c
        LIBS plantbus_engine)
pb_test(test_engine_channel LABELS unit SOURCES test_engine_channel.c engine_rig.c
        LIBS plantbus_engine)
pb_test(test_engine_barrier LABELS unit SOURCES test_engine_barrier.c engine_rig.c
        LIBS plantbus_engine)
pb_test(test_engine_layout LABELS unit SOURCES test_engine_layout.c engine_rig.c
        LIBS plantbus_engine)
pb_test(test_realtime LABELS unit SOURCES test_realtime.c LIBS plantbus_stepping)
foreach(call malloc calloc realloc free pthread_mutex_lock)
  target_link_options(test_realtime PRIVATE -Wl,--wrap=${call})
endforeach()
set_tests_properties(test_realtime PROPERTIES RUN_SERIAL TRUE)

# What runs inside the step, and snapshot files.
pb_test(test_host LABELS unit SOURCES test_host.c LIBS plantbus_stepping)
pb_test(test_host_set LABELS unit FAULTS SOURCES test_host_set.c LIBS plantbus_stepping)
pb_test(test_snapshot LABELS unit SOURCES test_snapshot.c LIBS plantbus_stepping OpenSSL::Crypto)
pb_test(test_carrier LABELS unit SOURCES test_carrier.c LIBS plantbus_stepping)
pb_test(test_pool LABELS unit SOURCES test_pool.c LIBS plantbus_stepping)
pb_test(test_mode_store LABELS unit SOURCES test_mode_store.c LIBS plantbus_stepping)
pb_test(test_transfer LABELS unit SOURCES test_transfer.c ../support/beam.c LIBS PkgConfig::MATIO)
target_link_options(test_transfer PRIVATE -Wl,--wrap=malloc -Wl,--wrap=calloc)
