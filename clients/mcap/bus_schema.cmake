# Turns the types of the bus into a C array: cmake -DIN=plantbus.idl -DOUT=bus_schema.c -P this
file(READ ${IN} text HEX)
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," text "${text}")
string(REGEX REPLACE "(................................................................................)"
       "\\1\n" text "${text}")
file(WRITE ${OUT} "// Made from plantbus.idl.\n#include \"bus_schema.h\"\n\n"
     "const char pb_bus_schema[] = {\n${text}0};\n")
