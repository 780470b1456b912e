# SPDX-License-Identifier: Apache-2.0
af_add_program_tests(
  register_program_tests
  SOURCES programs/register_program_test.cpp
  LIBS af_registration_case
  PROGRAMS af-register af-drr af-precompute)

af_add_program_tests(
  leak_tests
  SOURCES programs/leaks_test.cpp
  LIBS af_study_contents
  PROGRAMS af-register af-simulate af-evaluate)
