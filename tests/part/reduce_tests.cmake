# Tests of the reduction.
pb_test(test_reduce LABELS unit SOURCES test_reduce.c truss.c LIBS plantbus_part)
