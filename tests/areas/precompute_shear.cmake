# SPDX-License-Identifier: Apache-2.0
af_add_test(
  shear_warp_test
  SOURCES unit/precompute/casting/attenuating_bricks_test.cpp
          unit/precompute/casting/slab_aligned_volume_test.cpp unit/precompute/casting/shear_warp_caster_test.cpp
          unit/precompute/casting/depth_slabs_test.cpp
  LIBS af_precompute)
