// SPDX-License-Identifier: Apache-2.0
#include "evaluate/scan/scan_file.h"

#include <regex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "files/output_file.h"
#include "study/study_template.h"
#include "support/test_paths.h"

namespace af::tools {
namespace {

using testing::HasSubstr;

const std::string kValid = R"(name = "small"
source_to_axis_mm = 200.0
axis_to_detector_mm = 100
pixel_spacing_mm = [0.9, 0.8]
size_px = [72, 60]
rotation_axis = "rows"
view_count = 120
first_angle_deg = 10
step_deg = -3.0
files = "p{:04}.png"
first_index = 7
xray_domain = "intensity"
dark_level = 900
flat = "flat.png"
)";

/// The valid text with `from` replaced.
std::string with(const std::string& from, const std::string& to) {
  std::string text = kValid;
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string message_of(const std::string& text) {
  try {
    parse_scan_file(text, "scan.toml");
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(ScanFile, ReadsEveryKey) {
  const ScanFile file = parse_scan_file(kValid, "scan.toml");
  EXPECT_EQ(file.name, "small");
  EXPECT_EQ(file.scan.source_to_axis_mm, 200.0);
  EXPECT_EQ(file.scan.source_to_detector_mm, 300.0);
  EXPECT_EQ(file.scan.pixel_spacing_mm, Eigen::Vector2d(0.9, 0.8));
  EXPECT_EQ(file.scan.size_px, Eigen::Vector2i(72, 60));
  EXPECT_EQ(file.scan.axis_along, AxisAlong::Rows);
  ASSERT_EQ(file.scan.angles_rad.size(), 120U);
  EXPECT_NEAR(file.scan.angles_rad[2] * kDegPerRad, 4.0, 1e-12);
  EXPECT_EQ(file.file_of(0), "p0007.png");
  EXPECT_EQ(file.file_of(119), "p0126.png");
  EXPECT_EQ(file.dark_level, 900.0);
  EXPECT_EQ(file.flat, "flat.png");
  EXPECT_FALSE(file.dark.has_value());
}

TEST(ScanFile, WritesIndicesWithoutZerosWhenNotAsked) {
  const ScanFile file = parse_scan_file(with("p{:04}.png", "a/Projection{}.png"), "scan.toml");
  EXPECT_EQ(file.file_of(0), "a/Projection7.png");
  EXPECT_EQ(file.file_of(113), "a/Projection120.png");
}

TEST(ScanFile, TakesEveryFewthFile) {
  const ScanFile file =
      parse_scan_file(with("first_index = 7", "first_index = 7\nindex_step = 3"), "scan.toml");
  EXPECT_EQ(file.file_of(0), "p0007.png");
  EXPECT_EQ(file.file_of(2), "p0013.png");
  const ScanFile sparse =
      parse_scan_file(with("first_index = 7", "first_index = 7\nindex_step = 100000"), "scan.toml");
  EXPECT_EQ(sparse.file_of(100000), "p10000000007.png");
}

TEST(ScanFile, KeepsTheStatedDistanceUnlessToldOtherwise) {
  EXPECT_EQ(parse_scan_file(kValid, "scan.toml").scan.distance_tolerance, 0.0);
  const std::string rough = "axis_to_detector_mm = 100\ndistance_tolerance = ";
  EXPECT_EQ(parse_scan_file(with("axis_to_detector_mm = 100", rough + "0.1"), "scan.toml")
                .scan.distance_tolerance,
            0.1);
  EXPECT_THAT(message_of(with("axis_to_detector_mm = 100", rough + "0.5")),
              HasSubstr("must be between 0 (the distances were measured) and 0.3"));
}

TEST(ScanFile, TheTemplateIsAValidScanWithAndWithoutItsOptionalKeys) {
  const std::string text = template_text("scan");
  const ScanFile plain = parse_scan_file(text, "scan.toml");
  EXPECT_EQ(plain.scan.angles_rad.size(), 360U);
  EXPECT_EQ(plain.file_of(12), "Projection12.png");
  const ScanFile full = parse_scan_file(
      std::regex_replace(text, std::regex("(^|\n)# ([a-z_]+ = )"), "$1$2"), "scan.toml");
  EXPECT_EQ(full.flat_level, 40000.0);
  EXPECT_EQ(full.scan.distance_tolerance, 0.1);
  EXPECT_TRUE(full.scan.beam_foot_px.has_value());
}

TEST(ScanFile, TakesAListOfFiles) {
  const test::ScratchFolder scratch;
  const std::string scan = (scratch / "scan.toml").string();
  const std::string pattern = "files = \"p{:04}.png\"\nfirst_index = 7\n";
  const std::string listed = with(pattern, "files_file = \"files.txt\"\n");
  std::string names;
  for (int view = 0; view < 120; ++view) names += "a" + std::to_string(3 * view) + ".tif\n";
  names.replace(0, 6, " a 0.tif ");  // blanks within a name stay
  write_text_file(scratch / "files.txt", "# every third\n" + names);
  const ScanFile file = parse_scan_file(listed, scan);
  EXPECT_FALSE(file.is_stack());
  EXPECT_EQ(file.file_of(0), "a 0.tif");
  EXPECT_EQ(file.file_of(2), "a6.tif");
  EXPECT_EQ(file.file_of(119), "a357.tif");
  write_text_file(scratch / "files.txt", "a.tif\nb.tif\n");
  EXPECT_THROW(parse_scan_file(listed, scan), InputError);
  EXPECT_THROW(parse_scan_file(with("first_index = 7", "files_file = \"files.txt\""), scan),
               InputError);
}

/// The valid text with its evenly spaced angles replaced by a line.
std::string with_angles(const std::string& line) {
  std::string text = kValid;
  for (const char* const key : {"view_count", "first_angle_deg", "step_deg"}) {
    const std::size_t begin = text.find(key);
    text.erase(begin, text.find('\n', begin) + 1 - begin);
  }
  return text + line + "\n";
}

std::string angles_of_a_turn(const std::string& separator, int count) {
  std::string text;
  for (int view = 0; view < count; ++view)
    text += (view > 0 ? separator : "") + std::to_string(view * 360.0 / count);
  return text;
}

TEST(ScanFile, TakesAnglesOneByOne) {
  const ScanFile file = parse_scan_file(
      with_angles("angles_deg = [" + angles_of_a_turn(", ", 24) + "]"), "scan.toml");
  ASSERT_EQ(file.scan.angles_rad.size(), 24U);
  EXPECT_NEAR(file.scan.angles_rad[23] * kDegPerRad, 345.0, 1e-9);
}

TEST(ScanFile, TakesAnglesFromAFileBesideIt) {
  const test::ScratchFolder scratch;
  write_text_file(scratch / "angles.txt", "# degrees\n" + angles_of_a_turn("\n", 30) + "\n");
  const ScanFile file = parse_scan_file(with_angles("angles_file = \"angles.txt\""),
                                        (scratch / "scan.toml").string());
  ASSERT_EQ(file.scan.angles_rad.size(), 30U);
  EXPECT_NEAR(file.scan.angles_rad[1] * kDegPerRad, 12.0, 1e-9);
}

TEST(ScanFile, RefusesAnAnglesFileThatHoldsOtherThings) {
  const test::ScratchFolder scratch;
  write_text_file(scratch / "angles.txt", "0.0\n3.0 six\n");
  try {
    parse_scan_file(with_angles("angles_file = \"angles.txt\""), (scratch / "scan.toml").string());
    FAIL() << "accepted";
  } catch (const FileError& error) {
    EXPECT_THAT(error.what(), HasSubstr("angles.txt:2"));
    EXPECT_THAT(error.what(), HasSubstr("'six' is not an angle"));
  }
}

TEST(ScanFile, WithoutBracesIsAStack) {
  std::string text = with("p{:04}.png", "views.mha");
  text.erase(text.find("first_index"), std::string("first_index = 7\n").size());
  const ScanFile file = parse_scan_file(text, "scan.toml");
  EXPECT_TRUE(file.is_stack());
  EXPECT_EQ(file.file_of(5), "views.mha");
  EXPECT_FALSE(parse_scan_file(kValid, "scan.toml").is_stack());
}

class MissingKey : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Keys,
                         MissingKey,
                         testing::Values("source_to_axis_mm",
                                         "axis_to_detector_mm",
                                         "pixel_spacing_mm",
                                         "size_px",
                                         "rotation_axis",
                                         "view_count",
                                         "step_deg",
                                         "files",
                                         "xray_domain"));

TEST_P(MissingKey, IsNamed) {
  const std::size_t begin = kValid.find(std::string("\n") + GetParam()) + 1;
  const std::size_t end = kValid.find('\n', begin) + 1;
  const std::string text = kValid.substr(0, begin) + kValid.substr(end);
  EXPECT_THAT(message_of(text), HasSubstr(std::string(GetParam()) + " is missing"));
}

struct BadValue {
  const char* from;
  const char* to;
  const char* message;
};

class BadScanFile : public testing::TestWithParam<BadValue> {};
INSTANTIATE_TEST_SUITE_P(
    Values,
    BadScanFile,
    testing::Values(
        BadValue{"= 200.0", "= -200.0", "source_to_axis_mm"},
        BadValue{"= 200.0", "= nan", "source_to_axis_mm"},
        BadValue{"= 200.0", "= 1e300", "source_to_axis_mm"},
        BadValue{"= 200.0", "= \"far\"", "source_to_axis_mm"},
        BadValue{"= 200.0", "= true", "source_to_axis_mm"},
        BadValue{"mm = 100", "mm = 0", "axis_to_detector_mm = 0: must be above 0"},
        BadValue{"[0.9, 0.8]", "[0.9, 0.0]", "pixel_spacing_mm"},
        BadValue{"[0.9, 0.8]", "[0.9]", "pixel_spacing_mm"},
        BadValue{"[72, 60]", "[72, 2147483647]", "size_px"},
        BadValue{"[72, 60]", "[72, -60]", "size_px"},
        BadValue{"\"rows\"", "\"z\"", "rotation_axis = \"z\": must be"},
        BadValue{"= 120", "= 12.5", "view_count"},
        BadValue{"= 120", "= 1000000000000", "view_count"},
        BadValue{"= 120", "= 60", "must go all the way round"},
        BadValue{"= -3.0", "= 0", "step_deg"},
        BadValue{"= -3.0", "= inf", "step_deg"},
        BadValue{"p{:04}.png", "p.mha", "first_index = 7: is for files with an index"},
        BadValue{"p{:04}.png", "p{}{}.png", "must contain {} once"},
        BadValue{"p{:04}.png", "p{:4}.png", "must contain {} once"},
        BadValue{"p{:04}.png", "p}{.png", "must contain {} once"},
        BadValue{"= 7", "= -1", "first_index"},
        BadValue{"[72, 60]", "[72, 60]\nbeam_foot_px = [72, 30]", "beam_foot_px"},
        BadValue{"[72, 60]", "[72, 60]\nbeam_foot_px = 36", "beam_foot_px"},
        BadValue{
            "[72, 60]", "[72, 60]\nangles_deg = [0, 3]", "must not be given together with a list"},
        BadValue{"\"intensity\"", "\"counts\"", "xray_domain"},
        BadValue{"\"intensity\"", "\"attenuation\"", "is for xray_domain = \"intensity\" alone"},
        BadValue{
            "flat = ", "dark = \"d.png\"\nflat = ", "must not be given together with dark_level"},
        BadValue{"flat = ", "flatt = ", "flatt"},
        BadValue{
            "flat = ", "flat_level = 40000\nflat = ", "must not be given together with flat_level"},
        BadValue{"flat = \"flat.png\"", "flat_level = 900", "must be above dark_level"},
        BadValue{"\"small\"", "\"../small\"", "must be usable in a file name"}));

TEST_P(BadScanFile, IsRefusedByName) {
  EXPECT_THAT(message_of(with(GetParam().from, GetParam().to)), HasSubstr(GetParam().message));
}

TEST(ScanFile, ThatIsNotTomlIsAFileError) {
  EXPECT_THROW(parse_scan_file("= 3", "scan.toml"), FileError);
  EXPECT_THROW(parse_scan_file("", "scan.toml"), FileError);
}

}  // namespace
}  // namespace af::tools
