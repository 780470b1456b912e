# SPDX-License-Identifier: Apache-2.0
af_add_test(
  precompute_test
  SOURCES unit/precompute/casting/unit_planner_test.cpp unit/precompute/casting/unit_tiles_test.cpp
          unit/precompute/codebook/nearest_codeword_test.cpp unit/precompute/codebook/filter_fitting_test.cpp
          unit/precompute/codebook/mean_removal_test.cpp unit/precompute/build/precompute_options_test.cpp
          unit/precompute/casting/field_caster_test.cpp unit/precompute/casting/least_squares_caster_test.cpp
          unit/precompute/casting/measured_residual_test.cpp unit/precompute/codebook/codebook_training_test.cpp
  LIBS af_precompute_build af_drr af_files)

af_add_test(
  field_design_test
  SOURCES unit/precompute/design/design_probe_test.cpp unit/precompute/design/design_search_test.cpp
  LIBS af_precompute_build af_drr)

af_add_mpi_test(
  field_file_test
  SOURCES mpi/field_file_test.cpp
  LIBS af_field af_study af_ranks PkgConfig::hdf5
  RANKS 1 2 3 4)

af_add_mpi_test(
  atlas_file_test
  SOURCES mpi/atlas_file_test.cpp
  LIBS af_drr PkgConfig::hdf5
  RANKS 1 2 3 4)

af_add_mpi_test(field_build_test SOURCES mpi/field_build_test.cpp LIBS af_precompute_build RANKS 1 2 3 4)

foreach(section refusals spacing ranks budget memory corrections stops)
  add_test(NAME precompute_program.${section}
           COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/programs/precompute_program.sh $<TARGET_FILE:af-precompute> ${af_mpiexec}
                   ${section} ${af_sanitized})
  set_tests_properties(precompute_program.${section} PROPERTIES LABELS mpi TIMEOUT 600)
endforeach()

add_test(NAME atlas_program COMMAND ${PROJECT_SOURCE_DIR}/tests/programs/atlas_program.sh
                                    ${PROJECT_BINARY_DIR}/bin ${af_mpiexec})
set_tests_properties(atlas_program PROPERTIES LABELS mpi TIMEOUT 900)

af_add_program_tests(
  measured_fields_tests
  SOURCES programs/measured_fields_test.cpp
  LIBS af_xray af_files
  PROGRAMS af-simulate af-scan af-precompute af-evaluate
  TIMEOUT 600)

af_add_test(
  shear_warp_test
  SOURCES unit/precompute/casting/attenuating_bricks_test.cpp unit/precompute/casting/slab_aligned_volume_test.cpp
          unit/precompute/casting/shear_warp_caster_test.cpp unit/precompute/casting/depth_slabs_test.cpp
  LIBS af_precompute_build)
