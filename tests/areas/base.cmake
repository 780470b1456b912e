# SPDX-License-Identifier: Apache-2.0
af_add_test(
  base_test
  SOURCES unit/base/base_test.cpp unit/base/thread_pool_test.cpp unit/base/crc32c_test.cpp
          unit/base/file_name_test.cpp unit/base/stored_bytes_test.cpp unit/base/described_fields_test.cpp
          unit/cli/bind_options_test.cpp unit/cli/command_help_test.cpp unit/base/toml_text_test.cpp
          unit/cli/given_options_test.cpp unit/cli/option_values_test.cpp unit/cli/usage_message_test.cpp
          unit/ranks/stop_request_test.cpp unit/base/contained_work_test.cpp
  LIBS af_base af_cli)
