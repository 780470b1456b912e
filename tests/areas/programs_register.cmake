# SPDX-License-Identifier: Apache-2.0
# One CTest entry for all: the tests share a study and its fields, which take longer than they do.
add_executable(register_program_tests programs/register_program_test.cpp)
target_link_libraries(register_program_tests PRIVATE af_compile_options af_test_support GTest::gtest_main
                                                     af_registration_case)
target_compile_definitions(register_program_tests PRIVATE AF_PROGRAM_FOLDER="${PROJECT_BINARY_DIR}/bin")
add_dependencies(register_program_tests af-register af-drr af-precompute)
add_test(NAME register_program_tests COMMAND register_program_tests)
set_tests_properties(register_program_tests PROPERTIES LABELS programs TIMEOUT 300)
