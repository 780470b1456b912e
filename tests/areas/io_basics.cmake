# SPDX-License-Identifier: Apache-2.0
af_add_test(
  io_basics_test
  SOURCES unit/io/sha256_test.cpp unit/io/output_file_test.cpp unit/io/input_guard_test.cpp unit/io/output_lock_test.cpp unit/io/csv_table_test.cpp unit/io/json_text_test.cpp unit/io/cbor_json_test.cpp unit/io/rig_file_test.cpp
          unit/io/study_file_test.cpp unit/io/pose_file_test.cpp unit/io/provenance_test.cpp unit/io/progress_journal_test.cpp unit/io/file_backed_array_test.cpp
  LIBS af_io_basics)
af_add_test(picture_test SOURCES unit/io/picture_test.cpp LIBS af_io_picture PkgConfig::cairo)
