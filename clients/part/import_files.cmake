list(APPEND PB_PART_TOOL_SOURCES doctor.c doctor_report.c import.c source.c truncate.c)
