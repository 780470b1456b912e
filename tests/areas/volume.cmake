# SPDX-License-Identifier: Apache-2.0
af_add_test(volume_test SOURCES unit/volume/ray_caster_test.cpp unit/volume/ray_slopes_test.cpp unit/volume/attenuation_volume_test.cpp
            unit/volume/blurred_volume_test.cpp unit/volume/body_mask_test.cpp unit/volume/slice_stack_test.cpp
            unit/volume/ct_read_options_test.cpp unit/volume/cut_faces_test.cpp LIBS af_volume af_test_itk_caster)
