# SPDX-License-Identifier: Apache-2.0
af_add_test(
  register_tests
  SOURCES unit/register/similarity/mutual_information_test.cpp unit/register/similarity/cross_correlation_test.cpp
          unit/register/similarity/similarity_measures_test.cpp unit/register/optimizer/best_neighbor_search_test.cpp
          unit/register/optimizer/optimizers_test.cpp unit/register/method/prepared_stage_test.cpp
          unit/register/problem/fiducial_mask_test.cpp unit/register/problem/silhouette_test.cpp
          unit/register/method/method_options_test.cpp unit/register/problem/parameter_scaling_test.cpp
          unit/register/problem/target_region_test.cpp
          unit/register/problem/multi_view_objective_test.cpp unit/register/method/correction_test.cpp
          unit/register/search/edge_image_test.cpp unit/register/search/pose_search_test.cpp
          unit/register/search/rotation_set_test.cpp unit/register/search/translation_lattice_test.cpp
          unit/register/verdict/registration_test.cpp unit/register/verdict/target_examiner_test.cpp
          unit/register/verdict/verdict_test.cpp
          unit/register/verdict/pose_covariance_test.cpp unit/register/verdict/uncertainty_estimator_test.cpp
  LIBS af_register_search af_register_verdict af_geometry af_files)
af_add_test(
  register_program_unit_tests
  SOURCES unit/register/register_options_test.cpp unit/register/kept_fields_test.cpp
          unit/register/results/registration_results_test.cpp unit/register/results/slicer_folder_test.cpp
  LIBS af_register)
af_add_mpi_test(register_mpi_tests SOURCES mpi/multi_start_test.cpp LIBS af_register RANKS 1 2 3 4)
# Its operator new must not be compiled together with other sources.
set_source_files_properties(support/counted_allocations.cpp PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
af_add_test(
  allocation_test
  SOURCES support/counted_allocations.cpp unit/drr/small_fields.cpp unit/register/allocation_test.cpp
  LIBS af_register_verdict)
