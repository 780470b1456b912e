# SPDX-License-Identifier: Apache-2.0
add_test(NAME report_program COMMAND ${AF_PYTHON_EXECUTABLE} ${CMAKE_CURRENT_SOURCE_DIR}/python/test_report.py
                                     ${PROJECT_BINARY_DIR}/bin/af-report)
set_tests_properties(report_program PROPERTIES LABELS programs TIMEOUT 900)
