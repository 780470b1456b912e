# SPDX-License-Identifier: Apache-2.0
af_add_test(
  io_basics_test
  SOURCES unit/files/sha256_test.cpp unit/files/output_file_test.cpp unit/files/input_guard_test.cpp unit/run/output_lock_test.cpp unit/text/csv_table_test.cpp unit/text/json_text_test.cpp unit/text/options_toml_test.cpp unit/text/cbor_json_test.cpp unit/study/rig_file_test.cpp
          unit/study/study_file_test.cpp unit/study/pose_file_test.cpp unit/run/provenance_test.cpp unit/run/progress_journal_test.cpp unit/files/file_backed_array_test.cpp
  LIBS af_study af_run)
af_add_test(picture_test SOURCES unit/figures/picture_test.cpp LIBS af_picture PkgConfig::cairo)
