list(APPEND PB_PART_TOOL_SOURCES doctor.c import.c source.c truncate.c)
