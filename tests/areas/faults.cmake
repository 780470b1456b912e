# SPDX-License-Identifier: Apache-2.0
# Jobs that die. One CTest entry: the tests share what undisturbed runs give.
add_executable(kill_matrix_tests programs/kill_matrix_test.cpp support/launched_job.cpp)
target_link_libraries(kill_matrix_tests PRIVATE af_compile_options af_test_support GTest::gtest_main af_registration_case)
target_compile_definitions(kill_matrix_tests PRIVATE AF_PROGRAM_FOLDER="${PROJECT_BINARY_DIR}/bin"
                                                     AF_MPIEXEC="${MPIEXEC_EXECUTABLE}")
add_dependencies(kill_matrix_tests af-evaluate af-precompute af-inspect)
add_test(NAME kill_matrix_tests COMMAND kill_matrix_tests)
set_tests_properties(kill_matrix_tests PROPERTIES LABELS "programs;mpi" TIMEOUT 600 PROCESSORS 2)

add_executable(fault_tests programs/faults_test.cpp support/launched_job.cpp)
target_link_libraries(fault_tests PRIVATE af_compile_options af_test_support GTest::gtest_main af_registration_case)
target_compile_definitions(fault_tests PRIVATE AF_PROGRAM_FOLDER="${PROJECT_BINARY_DIR}/bin"
                                               AF_MPIEXEC="${MPIEXEC_EXECUTABLE}")
add_dependencies(fault_tests af-precompute af-inspect)
add_test(NAME fault_tests COMMAND fault_tests)
set_tests_properties(fault_tests PROPERTIES LABELS "programs;mpi" TIMEOUT 600 PROCESSORS 2)
