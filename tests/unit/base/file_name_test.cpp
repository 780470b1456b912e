// SPDX-License-Identifier: Apache-2.0
#include "base/file_name.h"

#include <string>

#include <gtest/gtest.h>

namespace af {
namespace {

TEST(PlainFileName, LeadsToNoOtherFolder) {
  for (const char* good : {"A", "skull-01", "..A", "a b", "µ", "c:\\x", "a=b-1"})
    EXPECT_TRUE(is_plain_file_name(good)) << good;
  for (const char* bad : {"", ".", "..", "/", "a/b", "../a", "/etc/passwd", "a\n", "\x7f", "\t"})
    EXPECT_FALSE(is_plain_file_name(bad)) << bad;
  EXPECT_FALSE(is_plain_file_name(std::string("a\0b", 3)));
}

TEST(PlainFileName, IsNoFormulaOfASpreadsheet) {
  for (const char* bad : {"=1+1", "+1", "-x", "@SUM(A1)", "\t=1"})
    EXPECT_FALSE(is_plain_file_name(bad)) << bad;
}

TEST(PlainFileName, LeavesRoomForWhatStandsBehindIt) {
  EXPECT_TRUE(is_plain_file_name(std::string(100, 'x')));
  EXPECT_FALSE(is_plain_file_name(std::string(101, 'x')));
}

}  // namespace
}  // namespace af
