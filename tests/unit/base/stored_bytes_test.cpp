// SPDX-License-Identifier: Apache-2.0
#include "base/stored_bytes.h"

#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <optional>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace af {
namespace {

enum class Colour { Red, Green };

struct Inner {
  int count = 0;
  std::vector<double> values;
  auto members() { return std::tie(count, values); }
};

struct Outer {
  std::uint64_t large = 0;
  bool is_set = false;
  Colour colour = Colour::Red;
  std::string text;
  std::array<double, 3> numbers{};
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  std::vector<Inner> list;
  std::optional<Inner> given;
  std::optional<Inner> missing;
  std::filesystem::path path;
  std::map<std::string, Inner> named;
  auto members() {
    return std::tie(large, is_set, colour, text, numbers, pose, list, given, missing, path, named);
  }
};

Outer example() {
  Outer outer;
  outer.large = 0xFFFFFFFFFFFFFFF0u;
  outer.is_set = true;
  outer.colour = Colour::Green;
  outer.text = std::string("a\0b", 3);
  outer.numbers = {std::nan(""), -0.0, std::numeric_limits<double>::denorm_min()};
  outer.pose.translate(Eigen::Vector3d(1.0, 2.0, 1.0 / 3));
  outer.list = {{1, {}}, {2, {std::numeric_limits<double>::infinity(), 5.0}}};
  outer.given = Inner{7, {0.5}};
  outer.path = "folder/./file.toml";
  outer.named = {{"", {3, {}}}, {"two", {4, {1.5}}}};
  return outer;
}

TEST(StoredBytes, KeepEveryBitOfEveryMember) {
  const Outer back = value_of<Outer>(bytes_of(example()), "journal");
  EXPECT_EQ(back.large, 0xFFFFFFFFFFFFFFF0u);
  EXPECT_TRUE(back.is_set);
  EXPECT_EQ(back.colour, Colour::Green);
  EXPECT_EQ(back.text, std::string("a\0b", 3));
  EXPECT_TRUE(std::isnan(back.numbers[0]));
  EXPECT_TRUE(std::signbit(back.numbers[1]));
  EXPECT_EQ(back.numbers[2], std::numeric_limits<double>::denorm_min());
  EXPECT_EQ(back.pose.matrix(), example().pose.matrix());
  ASSERT_EQ(back.list.size(), 2u);
  EXPECT_EQ(back.list[0].count, 1);
  EXPECT_TRUE(back.list[0].values.empty());
  EXPECT_EQ(back.list[1].values, (std::vector<double>{INFINITY, 5.0}));
  ASSERT_TRUE(back.given.has_value());
  EXPECT_EQ(back.given->count, 7);
  EXPECT_FALSE(back.missing.has_value());
  EXPECT_EQ(back.path.native(), "folder/./file.toml");
  ASSERT_EQ(back.named.size(), 2u);
  EXPECT_EQ(back.named.at("").count, 3);
  EXPECT_EQ(back.named.at("two").values, (std::vector<double>{1.5}));
  EXPECT_EQ(bytes_of(back), bytes_of(example()));
}

TEST(StoredBytes, AnyOtherNumberOfThemIsAFileErrorThatNamesTheSource) {
  std::vector<std::byte> bytes = bytes_of(example());
  for (std::size_t count = 0; count < bytes.size(); ++count)
    EXPECT_THROW(value_of<Outer>(std::span(bytes).first(count), "journal"), FileError) << count;
  bytes.push_back(std::byte{0});
  try {
    value_of<Outer>(bytes, "skull.journal");
    FAIL() << "was read";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("skull.journal"));
  }
}

TEST(StoredBytes, ACountThatTheRecordCannotHoldAsksForNoMemory) {
  const std::vector<std::byte> bytes = bytes_of(std::numeric_limits<std::uint64_t>::max());
  EXPECT_THROW(value_of<std::vector<double>>(bytes, "journal"), FileError);
  EXPECT_THROW(value_of<std::string>(bytes, "journal"), FileError);
}

}  // namespace
}  // namespace af
