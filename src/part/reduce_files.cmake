# Reduction of full models to elements; included by CMakeLists.txt.
list(APPEND PB_PART_SOURCES sparse.c fem.c)
