# SPDX-License-Identifier: Apache-2.0
af_add_test(
  evaluate_test
  SOURCES unit/evaluate/perturbed_starts_test.cpp
          unit/evaluate/success_rate_test.cpp
          unit/evaluate/statistics_test.cpp
          unit/evaluate/signed_rank_test_test.cpp
          unit/evaluate/bootstrap_test.cpp
          support/interval_coverage.cpp
          unit/evaluate/registration_errors_test.cpp
          unit/evaluate/error_budget_test.cpp
          unit/evaluate/similarity_curve_test.cpp
          unit/evaluate/drr_comparison_test.cpp
          unit/evaluate/loss_split_test.cpp
  LIBS af_evaluation)

af_add_test(
  evaluate_figures_test
  SOURCES unit/evaluate/figure_files_test.cpp
  LIBS af_evaluation_figures af_io_figure af_io_basics)

af_add_test(
  evaluate_report_test
  SOURCES unit/evaluate/report_text_test.cpp unit/evaluate/evaluation_rows_test.cpp
          unit/evaluate/failure_trace_files_test.cpp unit/evaluate/study_runs_test.cpp
  LIBS af_evaluation_program af_evaluation_report af_io_basics)

add_executable(evaluate_statistics_program_tests programs/evaluate_statistics_test.cpp)
target_link_libraries(evaluate_statistics_program_tests PRIVATE af_compile_options af_test_support GTest::gtest_main
                                                                af_io_basics nlohmann_json::nlohmann_json)
target_compile_definitions(evaluate_statistics_program_tests PRIVATE AF_PROGRAM_FOLDER="${PROJECT_BINARY_DIR}/bin")
add_dependencies(evaluate_statistics_program_tests af-evaluate)
gtest_discover_tests(evaluate_statistics_program_tests PROPERTIES LABELS programs TIMEOUT 120 DISCOVERY_TIMEOUT 60)

# One CTest entry for all: the tests share a study and its fields, which take longer than they do.
add_executable(evaluate_program_tests programs/evaluate_program_test.cpp support/launched_job.cpp)
target_link_libraries(evaluate_program_tests PRIVATE af_compile_options af_test_support GTest::gtest_main
                                                     af_registration_case)
target_compile_definitions(evaluate_program_tests PRIVATE AF_PROGRAM_FOLDER="${PROJECT_BINARY_DIR}/bin"
                                                          AF_MPIEXEC="${MPIEXEC_EXECUTABLE}")
add_dependencies(evaluate_program_tests af-evaluate af-precompute)
add_test(NAME evaluate_program_tests COMMAND evaluate_program_tests)
set_tests_properties(evaluate_program_tests PROPERTIES LABELS "programs;mpi" TIMEOUT 600 PROCESSORS 2)
