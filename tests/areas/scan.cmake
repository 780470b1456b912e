# SPDX-License-Identifier: Apache-2.0
af_add_test(
  scan_test
  SOURCES unit/evaluate/scan/simulated_scan.cpp unit/evaluate/scan/calibration_distance.cpp
          unit/evaluate/scan/fdk_test.cpp unit/evaluate/scan/line_integrals_test.cpp
          unit/evaluate/scan/scan_file_test.cpp unit/evaluate/scan/scan_geometry_test.cpp
          unit/evaluate/scan/self_calibration_test.cpp
  LIBS af_evaluate_scan)
af_add_program_tests(
  scan_program_tests EACH_TEST
  SOURCES programs/scan_program_test.cpp unit/evaluate/scan/simulated_scan.cpp
  LIBS af_evaluate_scan af_study
  PROGRAMS af-scan
  TIMEOUT 300)
target_compile_definitions(scan_program_tests
                           PRIVATE AF_CBCT_CYLINDER_TOML="${PROJECT_SOURCE_DIR}/docs/data/cbct-cylinder.toml")

add_test(NAME real_xrays_program COMMAND ${PROJECT_SOURCE_DIR}/tests/programs/real_xrays_program.sh
                                         ${PROJECT_SOURCE_DIR} ${PROJECT_BINARY_DIR}/bin)
set_tests_properties(real_xrays_program PROPERTIES LABELS mpi TIMEOUT 900)
