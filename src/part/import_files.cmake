# Readers of other programs' files, elements out of them, truncation.
list(APPEND PB_PART_SOURCES dof_file.c import.c lines.c matrix_abaqus.c matrix_ansys.c matrix_build.c
     matrix_calculix.c matrix_csv.c matrix_file.c matrix_market.c matrix_mat.c matrix_nastran.c
     node_file.c truncate.c truncate_interior.c truncate_proof.c)
