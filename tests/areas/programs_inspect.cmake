# SPDX-License-Identifier: Apache-2.0
af_add_program_tests(
  inspect_program_tests EACH_TEST
  SOURCES programs/inspect_program_test.cpp unit/ct/ct_test_data.cpp
  LIBS af_register af_study
  PROGRAMS af-inspect af-precompute af-drr af-simulate
  TIMEOUT 120)
