# SPDX-License-Identifier: Apache-2.0
# One folder = one room = one target. A room's arrows (what it may include) are held by tests/arch.

add_library(mw_compile_options INTERFACE)
target_compile_options(mw_compile_options INTERFACE
  -Wall -Wextra -Wno-unused-parameter -Wno-missing-field-initializers
  # A mixed cluster must compute the same floats: no contraction that depends on the target, no fast math.
  -ffp-contract=off)
target_include_directories(mw_compile_options INTERFACE ${PROJECT_SOURCE_DIR})

option(MW_WARNINGS_AS_ERRORS "Treat compiler warnings as errors" OFF)
if(MW_WARNINGS_AS_ERRORS)
  target_compile_options(mw_compile_options INTERFACE -Werror)
endif()

find_program(MW_CCACHE ccache)
if(MW_CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${MW_CCACHE})
endif()

# mw_add_library(NAME SRCS a.cc ... DEPS target ...)
function(mw_add_library NAME)
  cmake_parse_arguments(ARG "" "" "SRCS;DEPS" ${ARGN})
  if(ARG_SRCS)
    add_library(${NAME} STATIC ${ARG_SRCS})
    target_link_libraries(${NAME} PUBLIC mw_compile_options ${ARG_DEPS})
  else()
    add_library(${NAME} INTERFACE)
    target_link_libraries(${NAME} INTERFACE mw_compile_options ${ARG_DEPS})
  endif()
endfunction()

# The tests of single rooms, which take seconds: what runs under sanitizers.
add_custom_target(unit_tests)

# mw_add_test(NAME SRCS a_test.cc ... DEPS target ... [TIMEOUT seconds])
function(mw_add_test NAME)
  if(NOT BUILD_TESTING)
    return()
  endif()
  cmake_parse_arguments(ARG "" "TIMEOUT" "SRCS;DEPS" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)
  endif()
  if(CMAKE_CXX_FLAGS MATCHES "-fsanitize=") # some are ten times as slow
    math(EXPR ARG_TIMEOUT "4 * ${ARG_TIMEOUT}")
  endif()
  add_executable(${NAME} ${ARG_SRCS})
  target_link_libraries(${NAME} PRIVATE mw_compile_options ${ARG_DEPS} GTest::gmock GTest::gtest GTest::gtest_main)
  set_target_properties(${NAME} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
  add_test(NAME ${NAME} COMMAND ${NAME} WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
  set_tests_properties(${NAME} PROPERTIES TIMEOUT ${ARG_TIMEOUT})
  file(RELATIVE_PATH room ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR})
  if(NOT room MATCHES "^tests/")
    add_dependencies(unit_tests ${NAME})
    set_tests_properties(${NAME} PROPERTIES LABELS unit)
  endif()
endfunction()

# mw_add_benchmark(NAME SRCS a_benchmark.cc ... DEPS target ...)
function(mw_add_benchmark NAME)
  if(NOT MESHWRIGHT_BUILD_BENCHMARKS)
    return()
  endif()
  cmake_parse_arguments(ARG "" "" "SRCS;DEPS" ${ARGN})
  add_executable(${NAME} ${ARG_SRCS})
  target_link_libraries(${NAME} PRIVATE mw_compile_options ${ARG_DEPS} benchmark::benchmark benchmark::benchmark_main)
  set_target_properties(${NAME} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/benchmarks)
endfunction()
