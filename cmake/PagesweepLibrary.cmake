# pagesweep_library(<name> [DEPENDS <layer>...] [LINK <target>...] [LINK_PUBLIC <target>...])
#
# One directory below src/pagesweep is one library, pagesweep_<name>. Its sources are found by
# name: x.cc belongs to the library, x_test.cc to the test program <name>_test, x_bench.cc to
# the benchmark program <name>_bench. DEPENDS is the whole truth about which other directories
# it may include: cmake/CheckLayers.cmake refuses any other #include when the library is built.
# TEST_LINK lists further libraries that only the tests need.
function(pagesweep_library name)
  cmake_parse_arguments(arg "" "" "DEPENDS;LINK;LINK_PUBLIC;TEST_LINK" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS *.cc)
  set(tests ${sources})
  set(benches ${sources})
  list(FILTER tests INCLUDE REGEX "_test\\.cc$")
  list(FILTER benches INCLUDE REGEX "_bench\\.cc$")
  list(FILTER sources EXCLUDE REGEX "_(test|bench)\\.cc$")
  list(TRANSFORM arg_DEPENDS PREPEND pagesweep_ OUTPUT_VARIABLE depends)

  set(target pagesweep_${name})
  if(NOT sources)
    add_library(${target} INTERFACE)
    set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
    set_property(GLOBAL APPEND PROPERTY PAGESWEEP_LIBRARIES ${target})
    return()
  endif()
  add_library(${target} STATIC ${sources})
  add_library(pagesweep::${name} ALIAS ${target})
  if(NOT PAGESWEEP_BUILD_PROGRAM)
    set_target_properties(${target} PROPERTIES EXCLUDE_FROM_ALL ON)
  endif()
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON)
  target_include_directories(${target} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>
                                              $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_link_libraries(${target} PUBLIC ${depends} ${arg_LINK_PUBLIC} PRIVATE ${arg_LINK})
  pagesweep_warnings(${target})
  pagesweep_precompile(${target} 4 <Eigen/Dense> ${standard_headers})
  add_custom_command(TARGET ${target} PRE_BUILD COMMAND ${CMAKE_COMMAND}
    -D "directory=${CMAKE_CURRENT_SOURCE_DIR}" -D "layer=${name}" -D "allowed=${arg_DEPENDS}"
    -P ${PROJECT_SOURCE_DIR}/cmake/CheckLayers.cmake VERBATIM)
  set_property(GLOBAL APPEND PROPERTY PAGESWEEP_LIBRARIES ${target})

  list(TRANSFORM arg_TEST_LINK REPLACE "^([a-z]+)$" "pagesweep_\\1")
  if(PAGESWEEP_BUILD_TESTS AND tests AND (NOT PAGESWEEP_TEST_ONLY OR name IN_LIST PAGESWEEP_TEST_ONLY))
    add_executable(${name}_test ${tests})
    target_link_libraries(${name}_test PRIVATE ${target} ${arg_LINK} ${arg_TEST_LINK} GTest::gmock GTest::gtest_main)
    pagesweep_warnings(${name}_test)
    pagesweep_precompile(${name}_test 3 <gmock/gmock.h> <gtest/gtest.h> <Eigen/Dense> ${standard_headers})
    # What is tested is optimised; the tests themselves would take a quarter longer to compile, sanitized thrice as long.
    target_compile_options(${name}_test PRIVATE $<$<CONFIG:Release>:-O1> $<$<CONFIG:Debug>:-O0>)
    gtest_discover_tests(${name}_test DISCOVERY_TIMEOUT 60 PROPERTIES LABELS unit TIMEOUT 300)
  endif()
  if(PAGESWEEP_BUILD_BENCHMARKS AND benches)
    add_executable(${name}_bench ${benches})
    target_link_libraries(${name}_bench PRIVATE ${target} ${arg_LINK} ${arg_TEST_LINK} benchmark::benchmark_main)
    pagesweep_warnings(${name}_bench)
  endif()
endfunction()

set(standard_headers <algorithm> <filesystem> <functional> <map> <optional> <string> <variant> <vector>)

# Precompiles headers of other projects for a target of at least that many sources; with fewer it does not pay.
function(pagesweep_precompile target fewest)
  get_target_property(sources ${target} SOURCES)
  list(LENGTH sources count)
  if(PAGESWEEP_PRECOMPILE AND count GREATER_EQUAL fewest)
    target_precompile_headers(${target} PRIVATE ${ARGN})
    target_compile_options(${target} PRIVATE -fpch-preprocess)  # ccache asks for it
  endif()
endfunction()

function(pagesweep_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor
    $<$<CONFIG:Release>:-O3> -fno-math-errno -fno-trapping-math -ffp-contract=off
    $<$<BOOL:${PAGESWEEP_WARNINGS_AS_ERRORS}>:-Werror>)
endfunction()
