# SPDX-License-Identifier: Apache-2.0
af_add_test(
  drr_test
  SOURCES unit/drr/field_level_test.cpp unit/drr/filtered_decoding_test.cpp unit/drr/kept_images_test.cpp
          unit/drr/level_samples_test.cpp unit/drr/odd_rays_test.cpp unit/drr/polychromatic_drr_test.cpp
          unit/drr/ray_by_ray_af_drr_test.cpp unit/drr/ray_cast_drr_test.cpp unit/drr/ray_cast_level_test.cpp
          unit/drr/recalibrated_camera_test.cpp unit/drr/scattered_drr_test.cpp unit/drr/slab_merging_test.cpp
          unit/drr/slab_sum_test.cpp unit/drr/small_fields.cpp unit/drr/two_pass_af_drr_test.cpp
  LIBS af_drr)

af_add_test(field_use_test SOURCES unit/drr/atlas_renderers_test.cpp LIBS af_drr)

af_add_test(
  spectrum_test
  SOURCES unit/drr/bone_volume_test.cpp unit/drr/polychromatic_attenuation_test.cpp unit/drr/xray_physics_test.cpp
  LIBS af_drr)
