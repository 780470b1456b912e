# SPDX-License-Identifier: Apache-2.0
af_add_test(ct_reader_test SOURCES unit/image_files/ct_reader_test.cpp unit/image_files/ct_identity_test.cpp
            unit/image_files/ct_test_data.cpp LIBS af_study_contents ZLIB::ZLIB)
af_add_test(image_file_test SOURCES unit/image_files/image_file_test.cpp unit/image_files/ct_test_data.cpp LIBS af_study_contents ZLIB::ZLIB)
