# Data files of config/ inside the tools: cmake -DIN=FILE.json -DOUT=FILE.c -DNAME=symbol -P this
file(READ ${IN} text HEX)
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," text "${text}")
string(REGEX REPLACE "(................................................................................)"
       "\\1\n" text "${text}")
file(WRITE ${OUT} "// Made from ${NAME}.\n#include \"shipped.h\"\n\n"
     "const char ${NAME}[] = {\n${text}0};\n")
