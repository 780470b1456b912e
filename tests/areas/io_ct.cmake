# SPDX-License-Identifier: Apache-2.0
af_add_test(ct_reader_test SOURCES unit/io/ct_reader_test.cpp unit/io/ct_test_data.cpp LIBS af_io_ct ZLIB::ZLIB)
af_add_test(
  image_file_test SOURCES unit/io/image_file_test.cpp unit/io/xray_reader_test.cpp unit/io/ct_test_data.cpp
  LIBS af_io_ct)
