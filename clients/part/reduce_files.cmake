# plantbus-part reduce; included by CMakeLists.txt.
list(APPEND PB_PART_TOOL_SOURCES
  frames.c frames_select.c node_sets.c reduce_command.c reduce_read.c reduce_report.c
)
