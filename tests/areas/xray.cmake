# SPDX-License-Identifier: Apache-2.0
af_add_test(
  image_test
  SOURCES unit/xray/bilinear_test.cpp unit/xray/image_test.cpp unit/xray/xray_borders_test.cpp
  LIBS af_xray)
af_add_test(image_file_test SOURCES unit/ct/ct_test_data.cpp unit/xray/image_file_test.cpp LIBS af_study ZLIB::ZLIB)
