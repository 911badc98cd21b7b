# Optional libraries. A package that is only half installed (an MPI without headers, a library without its
# .so, an include path that does not exist) must never break a build: what pkg-config says is tried with a
# small program, compiled and linked, and is left out, said so, where that fails.
#
#   pb_optional(name VARIABLE variable WITHOUT text CODE program
#               [INCLUDES dir...] [OPTIONS flag...] [LIBRARIES item...])
#
# Sets the variable to TRUE or FALSE in the caller's scope and, when TRUE, makes the target pb_optional_<name>
# with those paths, options and libraries. WITHOUT is printed when it is FALSE: what the build then lacks.
function(pb_optional name)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "" "VARIABLE;WITHOUT;CODE" "INCLUDES;OPTIONS;LIBRARIES")
  set(works FALSE)
  if(ARG_LIBRARIES)
    # Tried at each configuration: what was half installed may be whole now, or the other way round.
    set(directory ${CMAKE_BINARY_DIR}/CMakeFiles/optional/${name})
    file(WRITE ${directory}/${name}.c "${ARG_CODE}\n")
    try_compile(compiled ${directory} ${directory}/${name}.c
                CMAKE_FLAGS "-DINCLUDE_DIRECTORIES=${ARG_INCLUDES}"
                COMPILE_DEFINITIONS ${ARG_OPTIONS}
                LINK_LIBRARIES ${ARG_LIBRARIES})
    set(works ${compiled})
    unset(compiled CACHE)
  endif()
  if(works)
    add_library(pb_optional_${name} INTERFACE)
    target_include_directories(pb_optional_${name} SYSTEM INTERFACE ${ARG_INCLUDES})
    target_compile_options(pb_optional_${name} INTERFACE ${ARG_OPTIONS})
    target_link_libraries(pb_optional_${name} INTERFACE ${ARG_LIBRARIES})
  else()
    message(STATUS "${ARG_WITHOUT}")
  endif()
  set(${ARG_VARIABLE} ${works} PARENT_SCOPE)
endfunction()
