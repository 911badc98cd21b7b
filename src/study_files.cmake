# Sources of study/ that judge a whole plant, relative to src/.
set(PB_STUDY_SOURCES
  study/damping.c study/file_model.c study/gate.c study/gate_read.c study/point.c study/rga.c
  study/struts.c study/template_part.c study/variation.c study/variation_actuator.c
)
