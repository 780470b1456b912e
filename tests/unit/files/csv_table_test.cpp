// SPDX-License-Identifier: Apache-2.0
#include "files/csv_table.h"

#include <cmath>
#include <cstdlib>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "files/output_file.h"
#include "support/io_checks.h"

namespace af {
namespace {

using test::message_of;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

class CsvTableFile : public testing::Test {
 protected:
  CsvTable read(const std::string& text) {
    test::write_input(path(), text);
    return CsvTable::read(path());
  }
  std::string refusal(const std::string& text) {
    return message_of<FileError>([&] { read(text); });
  }
  [[nodiscard]] std::string path() const { return folder_ / "t.csv"; }

 private:
  test::ScratchFolder folder_;
};

TEST_F(CsvTableFile, RoundTripKeepsEveryText) {
  CsvTable table({"plain", "with, comma", "with \"quote\""});
  table.add_row({"", "a\nb", "\r\n"});
  table.add_row({" blank ", "\"", ","});
  table.add_row({"µ", "\r", "x\"\"y"});
  const CsvTable back = read(table.to_text());
  EXPECT_EQ(back.columns(), table.columns());
  ASSERT_EQ(back.row_count(), table.row_count());
  for (std::size_t row = 0; row < table.row_count(); ++row)
    for (const std::string& column : table.columns())
      EXPECT_EQ(back.text(row, column), table.text(row, column));
}

TEST_F(CsvTableFile, AColumnThatBeginsLikeAByteOrderMarkKeepsItsName) {
  const CsvTable table({"\xEF\xBB\xBFx"});
  EXPECT_EQ(read(table.to_text()).columns(), table.columns());
}

TEST_F(CsvTableFile, SingleColumnKeepsEmptyFields) {
  CsvTable table({"only"});
  table.add_row({""});
  table.add_row({"x"});
  table.add_row({""});
  const CsvTable back = read(table.to_text());
  ASSERT_EQ(back.row_count(), 3U);
  EXPECT_EQ(back.text(2, "only"), "");
}

TEST_F(CsvTableFile, AcceptsCrLfByteOrderMarkAndNoLastLineEnd) {
  const CsvTable table = read(
      "\xEF\xBB\xBF"
      "a,b\r\n1,2\r\n3,4");
  EXPECT_THAT(table.columns(), ElementsAre("a", "b"));
  ASSERT_EQ(table.row_count(), 2U);
  EXPECT_EQ(table.number(1, "b"), 4.0);
}

TEST_F(CsvTableFile, SemicolonsSeparateFieldsOfNumbersWithDecimalCommas) {
  const CsvTable table = read("a;b\r\n1,5;\"x;y\"\r\n-2,5e-3;1.5\r\n");
  EXPECT_THAT(table.columns(), ElementsAre("a", "b"));
  ASSERT_EQ(table.row_count(), 2U);
  EXPECT_EQ(table.number(0, "a"), 1.5);
  EXPECT_EQ(table.text(0, "b"), "x;y");
  EXPECT_EQ(table.number(1, "a"), -2.5e-3);
  EXPECT_EQ(table.number(1, "b"), 1.5);
  EXPECT_THAT(message_of<FileError>([&] { (void)read("a;b\n1.234,5;2\n").number(0, "a"); }),
              HasSubstr("'1.234,5'"));
  EXPECT_THAT(refusal("a;b\n1,2\n"), HasSubstr(path() + ":2: number of fields"));
  EXPECT_THAT(read(CsvTable({"one; only"}).to_text()).columns(), ElementsAre("one; only"));
}

TEST_F(CsvTableFile, IgnoresABlankLineAtTheEndOnly) {
  EXPECT_EQ(read("a,b\n1,2\n\n").row_count(), 1U);
  EXPECT_THAT(refusal("a,b\n\n1,2\n"),
              HasSubstr(path() + ":2: number of fields: expected 2, found 1"));
}

TEST_F(CsvTableFile, RefusalNamesFileAndLine) {
  EXPECT_THAT(refusal(""), HasSubstr("is empty"));
  EXPECT_THAT(refusal("a,b\n1,2\n1,2,3\n"),
              HasSubstr(path() + ":3: number of fields: expected 2, found 3"));
  EXPECT_THAT(refusal("a,b,a\n"), HasSubstr(path() + ":1: the column name 'a' is repeated"));
  EXPECT_THAT(refusal("a,b\n1,\"2\n3,4\n"), HasSubstr(path() + ":2: a quote is opened"));
  EXPECT_THAT(refusal("a,b\n1,\"2\"x\n"), HasSubstr(path() + ":2: text after the closing quote"));
  EXPECT_THAT(refusal("a,b\n1,2\"3\n"), HasSubstr(path() + ":2: a quote inside"));
  EXPECT_THAT(refusal(std::string("a,b\n1,\0\n", 8)), HasSubstr("zero byte at offset 6"));
}

TEST_F(CsvTableFile, LinesAreCountedThroughQuotedLineFeeds) {
  EXPECT_THAT(refusal("a,b\n\"1\n1\n1\",2\n3\n"), HasSubstr(path() + ":5: number of fields"));
  EXPECT_EQ(read("a\n\"x\ny\"\nz\n").where(1), path() + ":4");
}

TEST_F(CsvTableFile, NumbersThatAreNotFiniteAreRefusedWithLineColumnAndValue) {
  for (const char* bad :
       {"", "x", "1x", "nan", "inf", "-inf", "1e999", "1,5", "0x10", "--1", "+-1", "1 2"}) {
    const CsvTable table = read("a,value\n0,0\n1,\"" + std::string(bad) + "\"\n");
    EXPECT_THAT(message_of<FileError>([&] { static_cast<void>(table.number(1, "value")); }),
                AllOf(HasSubstr(path() + ":3: value"), HasSubstr("'" + std::string(bad) + "'")));
  }
}

TEST_F(CsvTableFile, NumbersMayHaveBlanksAndASign) {
  const CsvTable table = read("a\n +1.5e3 \n");
  EXPECT_EQ(table.number(0, "a"), 1500.0);
}

TEST_F(CsvTableFile, UnknownColumnIsNamed) {
  const CsvTable table = read("a\n1\n");
  EXPECT_EQ(table.find_column("b"), std::nullopt);
  EXPECT_THAT(message_of<FileError>([&] { static_cast<void>(table.number(0, "b")); }),
              HasSubstr("has no column 'b'"));
}

TEST_F(CsvTableFile, DamagedFilesAreReadOrRefused) {
  const std::string good =
      "case,\"quoted \"\"x\"\"\",value\nskull,\"a,b\",1.5\nskull,\"c\nd\",-2e-3\n";
  const std::size_t refused =
      test::refused_damaged_copies(good, 1, 500, [&](const std::string& text) {
        const CsvTable table = read(text);
        for (std::size_t row = 0; row < table.row_count(); ++row)
          static_cast<void>(table.number(row, "value"));
      });
  EXPECT_GT(refused, 100U);
}

TEST_F(CsvTableFile, WrittenInPartsIsTheSameFile) {
  for (const std::size_t count : {0u, 1u, 4096u, 10'000u}) {
    const auto part = [](std::size_t first, std::size_t end) {
      CsvTable table({"index", "text"});
      for (std::size_t i = first; i < end; ++i) table.add_row({std::to_string(i), "a,\"b\"\n"});
      return table;
    };
    write_csv_in_parts(path(), count, part);
    EXPECT_EQ(read_text_file(path()), part(0, count).to_text()) << count << " rows";
  }
}

TEST_F(CsvTableFile, IsReadInPartsLikeAsAWhole) {
  // Files are read 64 KiB at a time. A first row that grows by one byte moves that seam over all
  // that a row has.
  const std::string rows = "plain,\"quoted\",\"a \"\"b\"\", c\"\r\n1,\"two\r\nlines\",\r\r\n";
  for (std::size_t shift = 0; shift < rows.size(); ++shift) {
    std::string text = "a,b,c\n" + std::string(shift, 'x') + ",,\n";
    while (text.size() < (std::size_t{200} << 10)) text += rows;
    const CsvTable whole = read(text);
    std::size_t row = 0;
    CsvTable::read_in_parts(path(), [&](const CsvTable& part) {
      for (std::size_t i = 0; i < part.row_count(); ++i, ++row) {
        ASSERT_EQ(part.where(i), whole.where(row));
        for (const std::string& column : whole.columns())
          ASSERT_EQ(part.text(i, column), whole.text(row, column)) << part.where(i);
      }
    });
    ASSERT_EQ(row, whole.row_count());
  }
}

TEST_F(CsvTableFile, ReadInPartsIsRefusedLikeAsAWhole) {
  const auto refusal_in_parts = [&](const std::string& text) {
    test::write_input(path(), text);
    return message_of<FileError>([&] { CsvTable::read_in_parts(path(), [](const CsvTable&) {}); });
  };
  std::string many = "a,b\n";
  for (int i = 0; i < 100'000; ++i) many += "1,2\n";
  for (const std::string& text :
       {std::string(), many + "1\n", many + "1,\"2\n", many + '\0', std::string("a,a\n")})
    EXPECT_EQ(refusal_in_parts(text), refusal(text));
  EXPECT_THAT(refusal_in_parts(many + "1,\"" + std::string(std::size_t{65} << 20, 'x')),
              AllOf(HasSubstr(path() + ":100002"), HasSubstr("a row is larger than")));
  int parts = 0;
  test::write_input(path(), "a,b\n");
  CsvTable::read_in_parts(path(), [&](const CsvTable& part) {
    EXPECT_EQ(part.row_count(), 0U);
    ++parts;
  });
  EXPECT_EQ(parts, 1);
}

TEST(CsvTable, RowsMustFitTheColumns) {
  CsvTable table({"a", "b"});
  EXPECT_THROW(table.add_row({"1"}), std::logic_error);
  EXPECT_THROW(static_cast<void>(table.text(0, "a")), std::logic_error);
}

TEST(NumberText, ReadsBackToTheSameDouble) {
  HashRandom random(1);
  for (int i = 0; i < 10'000; ++i) {
    const double value =
        std::ldexp(random.uniform(-1.0, 1.0), static_cast<int>(random.below(600)) - 300);
    EXPECT_EQ(std::strtod(number_text(value).c_str(), nullptr), value);
  }
  EXPECT_EQ(number_text(0.1), "0.1");
  EXPECT_EQ(number_text(650.0), "650");
  EXPECT_EQ(number_text(std::numeric_limits<double>::quiet_NaN()), "nan");
  EXPECT_EQ(number_text(-std::numeric_limits<double>::infinity()), "-inf");
}

TEST(FixedText, RoundsToItsDecimalsWithoutANegativeZero) {
  EXPECT_EQ(fixed_text(1.0 / 3.0, 3), "0.333");
  EXPECT_EQ(fixed_text(-0.0004, 3), "0.000");
  EXPECT_EQ(fixed_text(-0.0006, 3), "-0.001");
  EXPECT_EQ(fixed_text(2.0, 0), "2");
  EXPECT_EQ(fixed_text(1e300, 1).size(), 303U);
  EXPECT_EQ(fixed_text(std::numeric_limits<double>::quiet_NaN(), 2), "nan");
}

}  // namespace
}  // namespace af
