# SPDX-License-Identifier: Apache-2.0
# The default real CT (Debian package invesalius-examples), unpacked once into the build tree.
set(af_default_ct ${CMAKE_CURRENT_BINARY_DIR}/default-ct/skull.mhd)
add_test(NAME default_ct COMMAND ${PROJECT_SOURCE_DIR}/jobs/default-ct.sh ${af_default_ct})
set_tests_properties(default_ct PROPERTIES LABELS physics FIXTURES_SETUP default_ct)

af_add_test(
  physics_test
  SOURCES physics/ray_caster_itk_test.cpp
  LIBS af_ct af_xray af_study af_test_itk
  LABEL physics
  TIMEOUT 300
  FIXTURE default_ct)
target_compile_definitions(physics_test PRIVATE AF_DEFAULT_CT_PATH="${af_default_ct}")

af_add_test(
  shear_warp_accuracy_test
  SOURCES physics/shear_warp_accuracy_test.cpp physics/caster_accuracy.cpp
  LIBS af_precompute_build af_study af_ranks
  LABEL physics
  TIMEOUT 300
  FIXTURE default_ct)
target_compile_definitions(shear_warp_accuracy_test PRIVATE AF_DEFAULT_CT_PATH="${af_default_ct}")

# The accuracy that precompute/README.md states, one camera at a time.
add_executable(caster_accuracy physics/caster_accuracy_main.cpp physics/caster_accuracy.cpp)
target_link_libraries(caster_accuracy PRIVATE af_compile_options af_test_support af_precompute_build af_study af_ranks)
af_compile_as(quick caster_accuracy)
