pb_bench(compile SOURCES bench_compile.c plants.c LIBS plantbus_stepping LAPACK::LAPACK)
