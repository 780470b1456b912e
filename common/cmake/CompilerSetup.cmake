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
            -ffp-contract=off)
target_include_directories(af_compile_options INTERFACE ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/common)

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

# af_add_library(<name> SOURCES ... [PUBLIC libs...] [PRIVATE libs...])
function(af_add_library name)
  cmake_parse_arguments(arg "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(${name} STATIC ${arg_SOURCES})
  target_link_libraries(${name} PUBLIC ${arg_PUBLIC} PRIVATE af_compile_options ${arg_PRIVATE})
  target_include_directories(${name} PUBLIC ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/common)
endfunction()

# af_compile_quickly(<targets>): for what only calls libraries that are optimized: options, texts, tests. -O3 takes a third
# longer to compile.
function(af_compile_quickly)
  foreach(target ${ARGN})
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
  endforeach()
endfunction()

# af_add_program(<name> SOURCES ... LIBS ...): an executable that is installed.
function(af_add_program name)
  cmake_parse_arguments(arg "" "" "SOURCES;LIBS" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE af_compile_options ${arg_LIBS})
  af_compile_quickly(${name})
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
