# SPDX-License-Identifier: Apache-2.0
af_add_test(
  volume_test
  SOURCES unit/ct/ray_caster_test.cpp unit/ct/ray_slopes_test.cpp unit/ct/attenuation_volume_test.cpp
          unit/ct/blurred_volume_test.cpp unit/ct/body_mask_test.cpp unit/ct/slice_stack_test.cpp
          unit/ct/ct_read_options_test.cpp unit/ct/cut_faces_test.cpp
  LIBS af_ct af_test_itk_caster)
af_add_test(
  ct_reader_test
  SOURCES unit/ct/ct_facts_test.cpp unit/ct/ct_identity_test.cpp unit/ct/ct_reader_test.cpp unit/ct/ct_test_data.cpp
  LIBS af_study ZLIB::ZLIB)
