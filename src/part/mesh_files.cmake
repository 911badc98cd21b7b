# Dimensions → mesh → K and M.
list(APPEND PB_PART_SOURCES
  characteristics.c hex20.c mesh.c mesh_assemble.c mesh_face.c part.c part_actuator.c part_file.c
  part_joint.c section.c
)
