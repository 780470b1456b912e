# SPDX-License-Identifier: Apache-2.0
af_add_program_tests(
  help_formats_tests
  SOURCES programs/help_formats_test.cpp
  LIBS af_register
  PROGRAMS af-precompute af-drr af-simulate af-scan af-register af-evaluate af-inspect)
target_compile_definitions(help_formats_tests PRIVATE AF_SOURCE_FOLDER="${PROJECT_SOURCE_DIR}")

af_add_program_tests(
  launch_tests EACH_TEST
  SOURCES programs/launch_test.cpp
  LIBS af_register
  PROGRAMS af-precompute af-drr af-simulate af-scan af-register af-evaluate af-inspect
  LABELS programs mpi)

af_add_program_tests(
  reference_tests
  SOURCES programs/reference_test.cpp
  LIBS af_register
  PROGRAMS af-precompute af-drr af-simulate af-scan af-register af-evaluate af-inspect)
target_compile_definitions(reference_tests PRIVATE AF_SOURCE_FOLDER="${PROJECT_SOURCE_DIR}"
                                                   AF_REFERENCE_PROGRAM="build/release/tests/reference_tests")
