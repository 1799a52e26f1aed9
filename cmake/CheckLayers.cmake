cmake_minimum_required(VERSION 3.25)
# Fails when a file below `directory` includes a pagesweep directory that `layer` does not depend
# on. Tests and benchmarks may also use sim/, which makes their data, as TEST_LINK declares.
file(GLOB sources "${directory}/*.h" "${directory}/*.cc")
foreach(source IN LISTS sources)
  file(STRINGS "${source}" includes REGEX "^#include \"pagesweep/[a-z_]+/")
  set(may ${layer} ${allowed})
  if(source MATCHES "_(test|bench)\\.cc$|_(testing|for_tests)\\.h$")
    list(APPEND may sim io camera data base)
  endif()
  foreach(include IN LISTS includes)
    string(REGEX REPLACE "^#include \"pagesweep/([a-z_]+)/.*" "\\1" other "${include}")
    if(NOT other IN_LIST may)
      message(FATAL_ERROR "${source} includes pagesweep/${other}/, but ${layer}/ may only include: ${may}.\n"
        "Stations meet in data/ and only pipeline/ names them all (HACKING.md, 'Layers').")
    endif()
  endforeach()
endforeach()
