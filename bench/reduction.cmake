# Reduction of a part beside CalculiX' frequency step.
pb_bench(reduction SOURCES bench_reduction.c child.c LIBS plantbus_part cjson)
