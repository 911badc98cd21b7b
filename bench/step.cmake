# The step and its baseline.
pb_bench(step SOURCES bench_step.c dense.c peaks.c plants.c LIBS LAPACK::LAPACK)
set_source_files_properties(peaks.c PROPERTIES COMPILE_OPTIONS -ffp-contract=fast)
