# SPDX-License-Identifier: Apache-2.0
af_add_program_tests(
  register_program_tests PREPARED
  SOURCES programs/register_program_test.cpp
  LIBS af_register
  PROGRAMS af-register af-drr af-precompute)

# docs/howto/bones.md: a simulated bone among others, and real X-rays where AF_WRIST_BIPLANE names their folder.
foreach(af_bones simulated wrist)
  add_test(NAME bones.${af_bones} COMMAND /usr/bin/python3 ${CMAKE_CURRENT_SOURCE_DIR}/programs/bones.py ${af_bones}
                                          $<TARGET_FILE_DIR:af-register>)
  set_tests_properties(bones.${af_bones} PROPERTIES LABELS programs SKIP_RETURN_CODE 77 TIMEOUT 600)
endforeach()

af_add_program_tests(
  leak_tests
  SOURCES programs/leaks_test.cpp
  LIBS af_study
  PROGRAMS af-register af-simulate af-evaluate)

af_add_program_tests(
  spectrum_program_tests
  SOURCES programs/spectrum_program_test.cpp
  LIBS af_register
  PROGRAMS af-register af-drr af-precompute af-evaluate)
