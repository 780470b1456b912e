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

af_add_program_tests(
  evaluate_statistics_program_tests EACH_TEST
  SOURCES programs/evaluate_statistics_test.cpp
  LIBS af_io_basics nlohmann_json::nlohmann_json
  PROGRAMS af-evaluate
  TIMEOUT 120)

af_add_program_tests(
  evaluate_program_tests
  SOURCES programs/evaluate_program_test.cpp support/launched_job.cpp
  LIBS af_registration_case
  PROGRAMS af-evaluate af-precompute
  LABELS programs mpi
  TIMEOUT 1800
  PROCESSORS 2)

af_add_mpi_test(shared_measuring_test SOURCES mpi/shared_measuring_test.cpp LIBS af_evaluation_program RANKS 1 2 3 4)
