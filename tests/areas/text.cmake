# SPDX-License-Identifier: Apache-2.0
af_add_test(
  text_test
  SOURCES unit/text/csv_table_test.cpp unit/text/json_text_test.cpp unit/text/options_toml_test.cpp
  LIBS af_text)
