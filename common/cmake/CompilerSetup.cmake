# SPDX-License-Identifier: Apache-2.0
# One interface target carries warnings and code generation for all first-party code, and one function
# compiles a kernel source once per vector width.

add_library(af_compile_options INTERFACE)
target_compile_options(
  af_compile_options
  INTERFACE -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wdouble-promotion
            $<$<BOOL:${AF_WERROR}>:-Werror>
            # GCC 12 reports std::string operator+ falsely (GCC bug 105651).
            -Wno-restrict
            # In a unity build GCC takes the types of a source file for those of a header.
            $<$<BOOL:${CMAKE_UNITY_BUILD}>:-Wno-subobject-linkage>
            # One binary for every x86-64 node: SSE4.2 baseline, wider only in kernels chosen at run time.
            -march=x86-64-v2
            # Same bits on every vector width: the compiler may not fuse a multiply with an add.
            -ffp-contract=off
            # The programs' objects are also those of the shared library, which shows nothing but its own interface.
            # Hidden symbols cannot be replaced from outside, so calls stay direct and are inlined as in a program.
            -fPIC -fvisibility=hidden -fvisibility-inlines-hidden)
target_include_directories(af_compile_options INTERFACE ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/common)

# A program loads what it calls: a test of geometry no MPI.
add_link_options(-Wl,--as-needed)

if(AF_SANITIZE)
  list(TRANSFORM AF_SANITIZE PREPEND -fsanitize= OUTPUT_VARIABLE af_sanitize_flags)
  # Undefined behaviour ends the process: a finding fails its test wherever that process was started from.
  add_compile_options(${af_sanitize_flags} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  add_link_options(${af_sanitize_flags})
endif()

# Fuzzers: every library is watched by libFuzzer and the sanitizers; the fuzzers' main is linked in tests/fuzz. Clang does
# not know all of GCC's warnings, and GCC's have the word.
if(AF_BUILD_FUZZERS)
  if(NOT CMAKE_CXX_COMPILER_ID STREQUAL "Clang")
    message(FATAL_ERROR "AF_BUILD_FUZZERS needs Clang: cmake --preset fuzz")
  endif()
  add_compile_options(-fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=undefined
                      -fno-omit-frame-pointer -w "SHELL:-include ${PROJECT_SOURCE_DIR}/tests/checks/itk_for_clang.h")
  add_link_options(-fsanitize=address,undefined)
endif()

# Four ways to compile. Each has the headers of other libraries that nearly all its sources include precompiled
# (AF_PRECOMPILE_HEADERS; off in the preset dev, where a source that misses an include fails).
#   numerics: as optimized as the build type says; with sanitizers -O3: with -O2 what is watched of Eigen is not inlined, and
#             loops take eight times as long
#   quick:    what only calls numerics (options, texts, files): -O3 takes a third longer to compile
#   programs: as quick, with CLI11, which takes its time also where it is not used
#   tests:    as quick, with GoogleTest
set(af_options_numerics "")
if(AF_SANITIZE)
  set(af_options_numerics -O3)
endif()
foreach(way quick programs tests)
  set(af_options_${way} $<$<CONFIG:Release>:-O1>)
endforeach()

# af_precompile_headers(<way> HEADERS ... LIBS ...)
function(af_precompile_headers way)
  cmake_parse_arguments(arg "" "" "HEADERS;LIBS" ${ARGN})
  file(CONFIGURE OUTPUT ${way}_headers.cpp CONTENT "// Empty: its target is there for its headers.\n")
  add_library(af_headers_${way} OBJECT ${CMAKE_CURRENT_BINARY_DIR}/${way}_headers.cpp)
  target_compile_options(af_headers_${way} PRIVATE ${af_options_${way}})
  target_link_libraries(af_headers_${way} PRIVATE af_compile_options ${arg_LIBS})
  target_precompile_headers(af_headers_${way} PRIVATE ${arg_HEADERS})
endfunction()
if(AF_PRECOMPILE_HEADERS)
  # GCC would collect its garbage again and again, which takes up to a tenth of the time; and what is preprocessed, for
  # ccache, has to name the headers.
  add_compile_options(--param=ggc-min-heapsize=1048576 -fpch-preprocess)
  set(headers <algorithm> <array> <charconv> <chrono> <cmath> <cstdint> <filesystem> <fstream> <functional> <limits> <map>
      <memory> <numeric> <optional> <set> <span> <sstream> <string> <string_view> <thread> <vector> <Eigen/Geometry>)
  af_precompile_headers(numerics HEADERS ${headers} LIBS Eigen3::Eigen)
  af_precompile_headers(quick HEADERS ${headers} <nlohmann/json.hpp> LIBS Eigen3::Eigen nlohmann_json::nlohmann_json)
  af_precompile_headers(programs HEADERS ${headers} <nlohmann/json.hpp> <CLI/CLI.hpp>
                        LIBS Eigen3::Eigen nlohmann_json::nlohmann_json CLI11::CLI11)
  if(TARGET GTest::gtest)
    af_precompile_headers(tests HEADERS ${headers} <gmock/gmock.h> <gtest/gtest.h> LIBS Eigen3::Eigen GTest::gtest)
  endif()
endif()

# af_compile_as(<way> <target>)
function(af_compile_as way target)
  target_compile_options(${target} PRIVATE ${af_options_${way}})
  if(AF_PRECOMPILE_HEADERS)
    target_precompile_headers(${target} REUSE_FROM af_headers_${way})
    # The bug of -Wno-restrict has more faces when headers are precompiled.
    target_compile_options(${target} PRIVATE -Wno-stringop-overflow -Wno-array-bounds)
  endif()
endfunction()

# af_add_library(<name> [QUICK|PROGRAM] SOURCES ... [USES folders...] [PUBLIC libs...] [PRIVATE libs...]): the library of
# a folder. USES: the folders that its sources include, whose libraries stand already, so that no circle can arise;
# tests/checks/layering.py holds the includes against them. The others are libraries of other people.
function(af_add_library name)
  cmake_parse_arguments(arg "QUICK;PROGRAM" "" "SOURCES;USES;PUBLIC;PRIVATE" ${ARGN})
  foreach(used ${arg_USES})
    if(NOT TARGET ${used})
      message(FATAL_ERROR "${name} uses ${used}, which does not stand above it in the list of CMakeLists.txt")
    endif()
  endforeach()
  add_library(${name} STATIC ${arg_SOURCES})
  target_link_libraries(${name} PUBLIC ${arg_USES} ${arg_PUBLIC} PRIVATE af_compile_options ${arg_PRIVATE})
  target_include_directories(${name} PUBLIC ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/common)
  if(arg_QUICK)
    af_compile_as(quick ${name})
  elseif(arg_PROGRAM)
    af_compile_as(programs ${name})
  else()
    af_compile_as(numerics ${name})
  endif()
endfunction()

set(af_commit_source ${PROJECT_BINARY_DIR}/build_commit.cpp)
add_custom_target(
  af_commit
  COMMAND ${CMAKE_COMMAND} -D SOURCE=${PROJECT_SOURCE_DIR} -D OUTPUT=${af_commit_source} -P ${CMAKE_CURRENT_LIST_DIR}/WriteCommit.cmake
  BYPRODUCTS ${af_commit_source}
  VERBATIM)

# af_add_program(<name> SOURCES ... LIBS ...): an executable that is installed, and knows its commit.
function(af_add_program name)
  cmake_parse_arguments(arg "" "" "SOURCES;LIBS" ${ARGN})
  add_executable(${name} ${arg_SOURCES} ${af_commit_source})
  set_source_files_properties(${af_commit_source} PROPERTIES GENERATED TRUE SKIP_UNITY_BUILD_INCLUSION TRUE SKIP_PRECOMPILE_HEADERS TRUE)
  add_dependencies(${name} af_commit)
  target_link_libraries(${name} PRIVATE af_compile_options ${arg_LIBS})
  af_compile_as(programs ${name})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)
  install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endfunction()

# af_add_kernel(<target> <source>): compiles <source> three times, for 128, 256 and 512 bit vectors, and links the
# objects into <target>. The source sees AF_VECTOR_BITS and puts its code into namespace AF_KERNEL_NAMESPACE. It may
# include neither Eigen nor standard library templates: an inline function compiled here for AVX-512 could be the copy
# that the linker keeps for everyone.
function(af_add_kernel target source)
  set(flags_128 "")
  set(flags_256 -mavx2 -mbmi -mbmi2)
  set(flags_512 ${flags_256} -mavx512f -mavx512bw -mavx512dq -mavx512vl -mavx512cd -mprefer-vector-width=512)
  get_filename_component(stem ${source} NAME_WE)
  foreach(bits 128 256 512)
    set(object ${target}_${stem}_${bits})
    add_library(${object} OBJECT ${source})
    target_compile_definitions(${object} PRIVATE AF_VECTOR_BITS=${bits} AF_KERNEL_NAMESPACE=kernels_${bits})
    # -Wno-psabi: 512-bit vector types only pass between inlined functions. -Wno-(maybe-)uninitialized: GCC 12's own
    # intrinsics headers (GCC bug 105593).
    target_compile_options(${object} PRIVATE $<$<CONFIG:Debug>:-O2> -fno-trapping-math -Wno-psabi -Wno-uninitialized -Wno-maybe-uninitialized ${flags_${bits}})
    target_link_libraries(${object} PRIVATE af_compile_options)
    target_sources(${target} PRIVATE $<TARGET_OBJECTS:${object}>)
  endforeach()
endfunction()
