# plantbus-part build; included by CMakeLists.txt.
list(APPEND PB_PART_TOOL_SOURCES
  build.c build_full.c build_picture.c build_picture_file.c build_report.c build_run.c
  build_sweep.c
)
