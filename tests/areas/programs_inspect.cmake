# SPDX-License-Identifier: Apache-2.0
af_add_program_tests(
  inspect_program_tests EACH_TEST
  SOURCES programs/inspect_program_test.cpp unit/image_files/ct_test_data.cpp
  LIBS af_registration_case af_study_contents
  PROGRAMS af-inspect af-precompute af-drr af-simulate
  TIMEOUT 120)
