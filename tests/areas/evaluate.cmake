# SPDX-License-Identifier: Apache-2.0
af_add_test(
  evaluate_test
  SOURCES support/interval_coverage.cpp unit/evaluate/image_quality/drr_comparison_test.cpp
          unit/evaluate/image_quality/loss_split_test.cpp unit/evaluate/registration/population_statistics_test.cpp
          unit/evaluate/registration/registration_errors_test.cpp unit/evaluate/starts/perturbed_starts_test.cpp
          unit/evaluate/statistics/bootstrap_test.cpp unit/evaluate/statistics/case_equivalence_test.cpp
          unit/evaluate/statistics/roc_test.cpp unit/evaluate/statistics/signed_rank_test_test.cpp
          unit/evaluate/statistics/statistics_test.cpp unit/evaluate/statistics/success_rate_test.cpp
          unit/evaluate/sweeps/error_budget_test.cpp unit/evaluate/sweeps/lattice_errors_test.cpp
          unit/evaluate/sweeps/similarity_curve_test.cpp
  LIBS af_evaluate_sweeps)

af_add_test(
  evaluate_report_test
  SOURCES unit/evaluate/registration/evaluation_rows_test.cpp unit/evaluate/registration/failure_traces_test.cpp
          unit/evaluate/registration/population_tables_test.cpp unit/evaluate/report/evaluation_run_test.cpp
          unit/evaluate/report/study_runs_test.cpp
  LIBS af_evaluate_sweeps af_evaluate_report af_study af_ranks)

af_add_test(start_tables_test SOURCES unit/evaluate/registration/start_tables_test.cpp LIBS af_evaluate_registration)

af_add_program_tests(
  evaluate_statistics_program_tests EACH_TEST
  SOURCES programs/evaluate_statistics_test.cpp
  LIBS af_study af_ranks nlohmann_json::nlohmann_json
  PROGRAMS af-evaluate
  TIMEOUT 120)

af_add_program_tests(
  evaluate_program_tests PREPARED
  SOURCES programs/evaluate_program_test.cpp
  LIBS af_register af_ranks
  PROGRAMS af-evaluate af-precompute
  LABELS programs mpi
  TIMEOUT 600)

af_add_program_tests(
  evaluate_stops_tests PREPARED
  SOURCES programs/evaluate_stops_test.cpp support/launched_job.cpp
  LIBS af_register af_ranks
  PROGRAMS af-evaluate af-precompute
  LABELS programs mpi
  TIMEOUT 600)

# The options of all programs are tested here, because these tests link every library of options anyway.
af_add_test(
  described_options_test
  SOURCES unit/described_options_test.cpp
  LIBS af_evaluate_sweeps af_register af_precompute af_tools_drr af_tools_inspect af_evaluate_scan
       af_evaluate_simulate PkgConfig::tomlplusplus)

add_test(NAME population_program COMMAND ${PROJECT_SOURCE_DIR}/tests/programs/population_program.sh
                                         ${PROJECT_SOURCE_DIR} ${PROJECT_BINARY_DIR}/bin)
set_tests_properties(population_program PROPERTIES LABELS mpi TIMEOUT 900)

add_test(NAME snakemake_program COMMAND ${PROJECT_SOURCE_DIR}/tests/programs/snakemake_program.sh
                                        ${PROJECT_SOURCE_DIR} ${PROJECT_BINARY_DIR}/bin)
set_tests_properties(snakemake_program PROPERTIES LABELS mpi TIMEOUT 900 SKIP_RETURN_CODE 77)
