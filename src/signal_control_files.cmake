# Sources of signal/ and control/, relative to src/.
set(PB_SIGNAL_CONTROL_SOURCES
  signal/excitation.c signal/fft.c signal/frf.c signal/periodic.c signal/periodic_settle.c
  signal/psd.c signal/random.c
  signal/small_solve.c signal/spectrum.c signal/window.c
  control/assign.c control/best_gain.c control/fit.c control/fit_data.c control/fit_relocate.c control/fit_zeros.c control/hac.c control/hac_response.c control/iff.c
  control/jacobian.c control/loop.c
  control/loop_newton.c control/loop_poles.c control/loop_solver.c control/loop_stable.c
  control/lti.c control/lti_analysis.c control/lti_c2d.c control/lti_model.c control/lti_ops.c
  control/margins.c control/margins_mimo.c control/pole_match.c control/pole_track.c control/poles.c control/rootlocus.c control/transient.c
)
