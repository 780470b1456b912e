# SPDX-License-Identifier: Apache-2.0
af_add_test(
  files_test
  SOURCES unit/files/input_guard_test.cpp unit/files/output_file_test.cpp unit/files/output_lock_test.cpp
          unit/files/partial_folder_test.cpp unit/files/sha256_test.cpp unit/files/user_cache_test.cpp
  LIBS af_files)

af_add_test(
  text_test
  SOURCES unit/files/csv_table_test.cpp unit/files/json_text_test.cpp unit/files/options_toml_test.cpp
  LIBS af_files)
