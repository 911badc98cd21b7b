# What the tools share (clients/common).
pb_test(client_options LABELS unit SOURCES test_options.c LIBS plantbus_client_common)
pb_test(client_table LABELS unit SOURCES test_table.c LIBS plantbus_client_common)
pb_test(client_result_files LABELS unit SOURCES test_result_files.c
        LIBS plantbus_client_common PkgConfig::MATIO)
pb_test(client_plot LABELS unit SOURCES test_plot.c LIBS plantbus_client_common)

# Transmission zeros (src/model/zeros).
pb_test(unit_zeros LABELS unit SOURCES test_zeros.c)

# Velocities and accelerations (src/model/rates).
pb_test(unit_rates LABELS unit SOURCES test_rates.c)

# Recordings (clients/mcap).
pb_test(client_mcap LABELS unit SOURCES test_mcap.c mcap_parse.c LIBS plantbus_mcap)
pb_test(client_recording LABELS unit SOURCES test_recording.c LIBS plantbus_mcap)

pb_test(client_patch LABELS unit SOURCES test_patch.c LIBS plantbus_patch)
pb_test(client_monitor_view LABELS unit SOURCES test_monitor_view.c LIBS plantbus_monitor_view cjson)
pb_test(client_doctor_checks LABELS unit SOURCES test_doctor_checks.c LIBS plantbus_doctor_checks)
