# Signals and control (src/signal, src/control).
pb_test(fft LABELS unit SOURCES test_fft.c)
pb_test(excitation LABELS unit SOURCES test_excitation.c)
pb_test(spectrum LABELS unit SOURCES test_spectrum.c)
pb_test(lti LABELS unit SOURCES test_lti.c)
pb_test(loop LABELS unit SOURCES test_loop.c)
pb_test(rootlocus LABELS unit SOURCES test_rootlocus.c)
pb_test(stable LABELS unit SOURCES test_stable.c)
pb_test(fit LABELS unit SOURCES test_fit.c)

# Experiments of plantbus-identify and plantbus-iff, on a plant stepped in the test.
pb_test(experiment LABELS unit SOURCES test_experiment.c fake_session.c LIBS plantbus_experiment)
pb_test(pole_match LABELS unit SOURCES test_pole_match.c)
