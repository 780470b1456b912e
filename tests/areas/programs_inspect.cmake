# SPDX-License-Identifier: Apache-2.0
add_executable(inspect_program_tests programs/inspect_program_test.cpp unit/io/ct_test_data.cpp)
target_link_libraries(inspect_program_tests PRIVATE af_compile_options af_test_support GTest::gtest_main
                                                    af_registration_case af_io_ct)
target_compile_definitions(inspect_program_tests PRIVATE AF_PROGRAM_FOLDER="${PROJECT_BINARY_DIR}/bin")
add_dependencies(inspect_program_tests af-inspect af-precompute)
gtest_discover_tests(inspect_program_tests PROPERTIES LABELS programs TIMEOUT 120 DISCOVERY_TIMEOUT 60)
