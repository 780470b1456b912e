# SPDX-License-Identifier: Apache-2.0
af_add_test(
  register_tests
  SOURCES unit/register/mutual_information_test.cpp
          unit/register/cross_correlation_test.cpp
          unit/register/similarity_measures_test.cpp
          unit/register/best_neighbor_search_test.cpp
          unit/register/optimizers_test.cpp
          unit/register/stage_view_test.cpp
          unit/register/fiducial_mask_test.cpp
          unit/register/method_options_test.cpp
          unit/register/parameter_scaling_test.cpp
          unit/register/multi_view_objective_test.cpp
          unit/register/registration_test.cpp
          unit/register/verdict_test.cpp
  LIBS af_registration)
af_add_test(
  register_program_unit_tests
  SOURCES unit/register/register_command_test.cpp unit/register/result_files_test.cpp
          unit/register/slicer_files_test.cpp
  LIBS af_registration_program af_io_itk)
af_add_mpi_test(register_mpi_tests SOURCES mpi/register/multi_start_mpi_test.cpp LIBS af_registration_program RANKS 1 2 3 4)
# Its own operator new belongs into a file of its own.
set_source_files_properties(support/counted_allocations.cpp PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
af_add_test(
  allocation_test
  SOURCES unit/register/allocation_test.cpp unit/drr/small_fields.cpp support/counted_allocations.cpp
  LIBS af_registration)
