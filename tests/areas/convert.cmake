# SPDX-License-Identifier: Apache-2.0
# af-convert, in Python: cameras and poses of other programs.
foreach(name cameras formats poses program)
  add_test(NAME convert.${name} COMMAND /usr/bin/python3 -B -m unittest -v test_${name}
           WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/convert)
  set_tests_properties(convert.${name} PROPERTIES LABELS programs TIMEOUT 120 ENVIRONMENT "AF_PROGRAMS=${PROJECT_BINARY_DIR}/bin")
endforeach()
add_test(NAME convert.mutations COMMAND /usr/bin/python3 -B test_mutations.py 2000
         WORKING_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/convert)
set_tests_properties(convert.mutations PROPERTIES LABELS programs TIMEOUT 900)
