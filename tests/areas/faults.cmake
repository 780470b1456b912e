# SPDX-License-Identifier: Apache-2.0
# Tests of jobs that die.
af_add_program_tests(
  kill_matrix_tests PREPARED
  SOURCES programs/kill_matrix_test.cpp support/launched_job.cpp
  LIBS af_register
  PROGRAMS af-evaluate af-precompute af-inspect
  LABELS programs mpi
  TIMEOUT 600)

af_add_program_tests(
  fault_tests PREPARED
  SOURCES programs/faults_test.cpp support/launched_job.cpp
  LIBS af_register
  PROGRAMS af-precompute af-inspect stopped_rank
  LABELS programs mpi
  TIMEOUT 600)
af_add_program_tests(
  output_lock_tests EACH_TEST
  SOURCES programs/output_locks_test.cpp support/launched_job.cpp
  LIBS af_register af_study
  PROGRAMS af-drr af-inspect af-precompute af-register af-scan af-simulate)

target_compile_definitions(fault_tests PRIVATE AF_STOPPED_RANK_PROGRAM="$<TARGET_FILE:stopped_rank>")
add_executable(stopped_rank programs/stopped_rank.cpp)
target_link_libraries(stopped_rank PRIVATE af_compile_options af_cli)
af_compile_as(programs stopped_rank)
