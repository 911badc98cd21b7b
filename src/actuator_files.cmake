# Actuators and joints characterised: src/study/{element,actuator,joint}_*.c
target_sources(plantbus PRIVATE
  study/actuator_2dof.c study/actuator_character.c study/actuator_fit.c study/actuator_match.c
  study/actuator_piezo.c study/actuator_refine.c study/element_bench.c study/element_limits.c
  study/element_source.c study/joint_character.c)
