// An L-shaped bracket with a round hole in each leg (mm). Frames: the walls of the two holes.
SetFactory("OpenCASCADE");
Mesh.MeshSizeMin = 4;
Mesh.MeshSizeMax = 4;
Mesh.ElementOrder = 2;
Mesh.SecondOrderLinear = 0;
Mesh.SaveGroupsOfNodes = 1;  // node sets of the physical surfaces
General.NumThreads = 1;       // the same mesh every time

Box(1) = {0, 0, 0, 40, 20, 6};
Box(2) = {0, 0, 0, 6, 20, 40};
BooleanUnion(3) = { Volume{1}; Delete; }{ Volume{2}; Delete; };
Cylinder(4) = {28, 10, 0, 0, 0, 6, 3};
Cylinder(5) = {0, 10, 30, 6, 0, 0, 3};
BooleanDifference(6) = { Volume{3}; Delete; }{ Volume{4, 5}; Delete; };

floor[] = Surface In BoundingBox{24, 6, -1, 32, 14, 7};
wall[] = Surface In BoundingBox{-1, 6, 26, 7, 14, 34};
Physical Volume("bracket") = {6};
Physical Surface("floor") = {floor[]};
Physical Surface("wall") = {wall[]};
