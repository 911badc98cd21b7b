pb_bench(frf SOURCES bench_frf.c plants.c LIBS LAPACK::LAPACK)
