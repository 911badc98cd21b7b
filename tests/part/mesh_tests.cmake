# Meshes, their matrices, and elements built from dimensions.
pb_test(test_mesh LABELS unit SOURCES test_mesh.c LIBS plantbus_part)
