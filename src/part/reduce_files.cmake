# Reduction of full models to elements; included by CMakeLists.txt.
list(APPEND PB_PART_SOURCES
  condense.c factor.c factor_graph.c fem.c reduce.c reduce_border.c reduce_check.c
  reduce_dynamic.c reduce_factor.c reduce_frames.c reduce_lanczos.c reduce_mass.c reduce_modes.c
  reduce_pins.c reduce_project.c sparse.c supersolve.c)
