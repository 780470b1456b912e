// SPDX-License-Identifier: Apache-2.0
#include "study/xray_reader.h"

#include <cmath>
#include <functional>
#include <limits>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/hash_random.h"
#include "geometry/pinhole_camera.h"
#include "support/io_checks.h"
#include "support/test_paths.h"
#include "unit/ct/ct_test_data.h"
#include "unit/ct/encoded_frames.h"
#include "xray/dicom_xray.h"
#include "xray/image_file.h"

namespace af {
namespace {

using test::ScratchFolder;
using testing::AllOf;
using testing::HasSubstr;

/// Single-precision rounding of a logarithm of at most 10.
constexpr float kLogRounding = 1e-6f;

CameraGeometry camera(int columns, int rows) {
  CameraGeometry geometry;
  geometry.name = "A";
  geometry.size_px = {columns, rows};
  geometry.pixel_spacing_mm = {0.4, 0.4};
  return geometry;
}

/// A 40 x 50 image of open beam 4000 with three darker pixels in the first row.
Image2d intensities() {
  Image2d image(40, 50);
  std::fill(image.pixels.begin(), image.pixels.end(), 4000.0f);
  image.at(0, 0) = 1000.0f;
  image.at(1, 0) = 1.0f;
  image.at(2, 0) = 0.0f;
  return image;
}

StudyView view_of(const ScratchFolder& folder,
                  const Image2d& image,
                  XrayDomain domain = XrayDomain::Intensity) {
  write_image(image, folder / "xray.mha", 0.4, 0.4);
  StudyView view;
  view.camera = "A";
  view.xray = folder / "xray.mha";
  view.xray_domain = domain;
  return view;
}

TEST(XrayReader, TakesTheNegativeLogarithmRelativeToTheOpenBeam) {
  const ScratchFolder folder;
  const Image2d found = read_view_xray(view_of(folder, intensities()), camera(40, 50)).attenuation;
  EXPECT_NEAR(found.at(0, 0), std::log(4.0f), kLogRounding);
  EXPECT_NEAR(found.at(1, 0), std::log(4000.0f), kLogRounding);
  EXPECT_NEAR(found.at(2, 0), std::log(8000.0f), kLogRounding) << "zero is half a level";
  EXPECT_EQ(found.at(3, 0), 0.0f);
}

TEST(XrayReader, TakesThe999thPermilleAsOpenBeamSoThatSinglePixelsDoNotDecide) {
  const ScratchFolder folder;
  Image2d image = intensities();
  image.at(5, 5) = 65535.0f;  // one of 2000 pixels
  const Image2d found = read_view_xray(view_of(folder, image), camera(40, 50)).attenuation;
  EXPECT_EQ(found.at(3, 0), 0.0f);
  EXPECT_LT(found.at(5, 5), 0.0f);
}

TEST(XrayReader, LeavesAttenuationAsItIs) {
  const ScratchFolder folder;
  Image2d image(2, 2);
  image.pixels = {0.0f, 1.5f, -0.25f, 7.0f};
  const auto view = view_of(folder, image, XrayDomain::Attenuation);
  EXPECT_EQ(read_view_xray(view, camera(2, 2)).attenuation.pixels, image.pixels);
}

void expect_refused(const StudyView& view, const CameraGeometry& geometry, const char* message) {
  try {
    (void)read_view_xray(view, geometry);
    FAIL() << "accepted; expected: " << message;
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(message));
    EXPECT_THAT(error.what(), HasSubstr("xray.mha"));
  }
}

void expect_refused_with(const StudyView& view,
                         const char* message,
                         const CameraGeometry& geometry = camera(40, 50)) {
  EXPECT_THAT(test::message_of<InputError>([&] { (void)read_view_xray(view, geometry); }),
              HasSubstr(message));
}

TEST(XrayReader, RefusesAnotherSizeAConstantImageAndImpossibleValues) {
  const ScratchFolder folder;
  expect_refused(view_of(folder, intensities()), camera(50, 40), "40 x 50 px");
  Image2d image(40, 50);
  expect_refused(view_of(folder, image), camera(40, 50), "constant image");
  image = intensities();
  image.at(7, 3) = -1.0f;
  expect_refused(view_of(folder, image), camera(40, 50), "pixel (7, 3) = -1");
  image.at(7, 3) = std::numeric_limits<float>::quiet_NaN();
  expect_refused(view_of(folder, image), camera(40, 50), "must be finite");
  image = Image2d(40, 50);
  image.at(0, 0) = 1.0f;
  expect_refused(view_of(folder, image), camera(40, 50), "open-beam intensity");
}

TEST(XrayReader, RefusesAMissingFileAsAFileError) {
  StudyView view;
  view.xray = "/nonexistent/xray.mha";
  EXPECT_THROW((void)read_view_xray(view, camera(2, 2)), FileError);
}

TEST(MaskReader, IsEmptyWithoutAMaskAndRefusesOneThatHidesEverything) {
  const ScratchFolder folder;
  StudyView view = view_of(folder, intensities());
  EXPECT_TRUE(read_view_xray(view, camera(40, 50)).mask.pixels.empty());
  Image2d mask(40, 50);
  write_png_image(mask, folder / "mask.png", 0, 1);
  view.mask = folder / "mask.png";
  EXPECT_THROW((void)read_view_xray(view, camera(40, 50)), InputError);
  mask.at(3, 4) = 1.0f;
  write_png_image(mask, folder / "mask.png", 0, 1);
  EXPECT_NE(read_view_xray(view, camera(40, 50)).mask.at(3, 4), 0.0f);
  EXPECT_THROW((void)read_view_xray(view, camera(40, 51)), InputError);
}

const std::vector<int> kLevels = {4000, 2000, 1000, 500, 4000, 4000};

class DicomXrayView : public testing::Test {
 protected:
  /// The view's X-ray from `file`, which `edit` has changed.
  ViewXray read(const std::function<void(test::DicomTestFile&)>& edit = {},
                const std::function<void(StudyView&)>& edit_view = {},
                int frames = 1) {
    test::DicomTestFile file = test::xa_file(3, 2, frames, kLevels);
    if (edit) edit(file);
    file.write(folder_ / "xray.dcm");
    StudyView view;
    view.camera = "A";
    view.xray = folder_ / "xray.dcm";
    view.reading.air = AirSource::Value;
    view.reading.air_level = 4000.0;
    if (edit_view) edit_view(view);
    return read_view_xray(view, camera(3, 2));
  }
  std::string refusal(const std::function<void(test::DicomTestFile&)>& edit,
                      const std::function<void(StudyView&)>& edit_view = {},
                      int frames = 1) {
    return test::message_of<InputError>([&] { (void)read(edit, edit_view, frames); });
  }
  static void expect_lines_of_levels(const ViewXray& xray, int added = 0) {
    for (std::size_t i = 0; i < kLevels.size(); ++i)
      EXPECT_NEAR(xray.attenuation.pixels[i],
                  -std::log((kLevels[i] + added) / 4000.0),
                  static_cast<double>(kLogRounding))
          << i << " " << xray.note;
  }

 private:
  ScratchFolder folder_;
};

constexpr test::DicomTestFile::Tag kPhotometricTag = {0x0028, 0x0004};
constexpr test::DicomTestFile::Tag kSignTag = {0x0028, 0x1041};

TEST_F(DicomXrayView, GivesTheLineIntegralsOfItsStoredBitsAndIgnoresItsWindow) {
  const ViewXray xray = read();
  expect_lines_of_levels(xray);
  EXPECT_THAT(xray.note, HasSubstr("DICOM XA, 12 bits, MONOCHROME2"));
  EXPECT_THAT(xray.note, HasSubstr("PixelIntensityRelationship LIN"));
  EXPECT_THAT(xray.note, HasSubstr("window 40/80 ignored"));
  EXPECT_THAT(xray.note, HasSubstr("air level 4000 (stated)"));
}

TEST_F(DicomXrayView, ReadsTheFrameThatIsAskedForAndNoOther) {
  const auto frame = [](int number) {
    return [number](StudyView& view) { view.reading.frame = number; };
  };
  expect_lines_of_levels(read({}, frame(3), 3), 2);
  expect_lines_of_levels(read({}, frame(1), 3), 0);
  EXPECT_THAT(read({}, frame(2), 3).note, HasSubstr("frame 2 of 3"));
  EXPECT_THAT(refusal({}, {}, 3), HasSubstr("NumberOfFrames = 3: say which frame"));
  EXPECT_THAT(refusal({}, frame(4), 3), HasSubstr("frame = 4: must be 1 to 3"));
}

TEST_F(DicomXrayView, Monochrome1IsTurnedRoundByItsStoredBits) {
  const ViewXray xray = read([](test::DicomTestFile& file) {
    file.set_text(kPhotometricTag, "CS", "MONOCHROME1");
    std::vector<std::int16_t> pixels;
    for (const int level : kLevels) pixels.push_back(static_cast<std::int16_t>(4095 - level));
    file.set_pixels(pixels);
  });
  expect_lines_of_levels(xray);
  EXPECT_THAT(xray.note, HasSubstr("values inverted: 4095 - stored"));
}

TEST_F(DicomXrayView, TheSignOfTheRelationshipDecidesOverThePhotometricInterpretation) {
  // Shown with bone white, stored in proportion to intensity.
  expect_lines_of_levels(read([](test::DicomTestFile& file) {
    file.set_text(kPhotometricTag, "CS", "MONOCHROME1");
    file.set_text(kSignTag, "SS", std::string("\1\0", 2));
  }));
  // Values fall with intensity although the file says MONOCHROME2.
  expect_lines_of_levels(read([](test::DicomTestFile& file) {
    file.set_text(kSignTag, "SS", std::string("\xff\xff", 2));
    std::vector<std::int16_t> pixels;
    for (const int level : kLevels) pixels.push_back(static_cast<std::int16_t>(4095 - level));
    file.set_pixels(pixels);
  }));
  EXPECT_THAT(refusal([](test::DicomTestFile& file) {
                file.set_text(kSignTag, "SS", std::string("\2\0", 2));
              }),
              HasSubstr("PixelIntensityRelationshipSign = '2': must be 1 or -1"));
}

TEST_F(DicomXrayView, TheStudyMayOverruleTheHeader) {
  const ViewXray xray =
      read([](test::DicomTestFile& file) { file.set_text(kPhotometricTag, "CS", "MONOCHROME1"); },
           [](StudyView& view) { view.reading.polarity = XrayPolarity::AsStored; });
  expect_lines_of_levels(xray);
}

TEST_F(DicomXrayView, RescalesBeforeItTakesTheLogarithm) {
  const ViewXray xray = read([](test::DicomTestFile& file) {
    file.set_text({0x0028, 0x1052}, "DS", "-100");
    file.set_text({0x0028, 0x1053}, "DS", "2");
  });
  for (std::size_t i = 0; i < kLevels.size(); ++i)
    EXPECT_NEAR(xray.attenuation.pixels[i],
                -std::log((2.0 * kLevels[i] - 100.0) / 4000.0),
                static_cast<double>(kLogRounding));
  EXPECT_THAT(xray.note, HasSubstr("rescaled"));
}

TEST_F(DicomXrayView, LogarithmsAreNoIntensitiesAndDisplayValuesAreWarnedOf) {
  const auto relationship = [](const char* text) {
    return [text](test::DicomTestFile& file) { file.set_text({0x0028, 0x1040}, "CS", text); };
  };
  const auto attenuation = [](StudyView& view) {
    view.xray_domain = XrayDomain::Attenuation;
    view.reading.air = AirSource::NotAsked;
  };
  EXPECT_THAT(refusal(relationship("LOG")), HasSubstr("xray_domain = \"attenuation\""));
  const ViewXray xray = read(relationship("LOG"), attenuation);
  EXPECT_EQ(xray.attenuation.pixels[3], 500.0f);
  EXPECT_THAT(xray.warnings, testing::Contains(HasSubstr("unknown scale")));
  EXPECT_THAT(read(relationship("DISP")).warnings, testing::Contains(HasSubstr("for display")));
  EXPECT_THAT(read({}, attenuation).warnings, testing::Contains(HasSubstr("takes no logarithm")));
}

constexpr test::DicomTestFile::Tag kPaddingTag = {0x0028, 0x0120};

TEST_F(DicomXrayView, PaddingIsMaskedAndNeitherAirNorMetal) {
  // The 500 of kLevels becomes padding: by a value below all others, one above all, and one beyond
  // the bits.
  for (const int padding : {0, 4095, 63536}) {
    SCOPED_TRACE(padding);
    const auto pad = [&](test::DicomTestFile& file) {
      std::vector<std::int16_t> pixels(kLevels.begin(), kLevels.end());
      pixels[3] = static_cast<std::int16_t>(padding);
      file.set_pixels(pixels);
      file.set_u16(kPaddingTag, static_cast<std::uint16_t>(padding));
    };
    const ViewXray xray = read(pad);
    EXPECT_THAT(xray.mask.pixels, testing::ElementsAre(1, 1, 1, 0, 1, 1));
    EXPECT_NEAR(xray.attenuation.pixels[2], std::log(4.0), kLogRounding);
    EXPECT_LE(xray.attenuation.pixels[3], xray.attenuation.pixels[2]) << "padding is not metal";
    EXPECT_GT(xray.attenuation.pixels[3], xray.attenuation.pixels[0]) << "padding is not air";
    EXPECT_THAT(xray.note, HasSubstr("16.7 % masked as padding (PixelPaddingValue"));
    const ViewXray turned = read([&](test::DicomTestFile& file) {
      pad(file);
      file.set_text(kPhotometricTag, "CS", "MONOCHROME1");
    });
    EXPECT_EQ(turned.mask.pixels, xray.mask.pixels);
  }
}

TEST_F(DicomXrayView, PaddingDoesNotMoveTheAirLevel) {
  const auto by_percentile = [](StudyView& view) { view.reading.air = AirSource::Percentile; };
  const ViewXray xray = read(
      [](test::DicomTestFile& file) {
        std::vector<std::int16_t> pixels(kLevels.begin(), kLevels.end());
        pixels[3] = 4095;
        file.set_pixels(pixels);
        file.set_u16(kPaddingTag, 4095);
      },
      by_percentile);
  EXPECT_THAT(xray.note, HasSubstr("air level 4000"));
}

TEST_F(DicomXrayView, PaddingThatHidesTheRegionIsRefused) {
  const auto all_but_one = [](test::DicomTestFile& file) {
    file.set_pixels({0, 0, 0, 500, 0, 4000});
    file.set_u16(kPaddingTag, 0);
  };
  const auto region = [](StudyView& view) { view.roi = {0, 0, 3, 2}; };
  EXPECT_THAT(refusal(all_but_one, region),
              HasSubstr("PixelPaddingValue 0 = padding: hides 66.7 %"));
  EXPECT_THAT(refusal([](test::DicomTestFile& file) {
                file.set_pixels({9, 9, 9, 9, 9, 9});
                file.set_u16(kPaddingTag, 9);
              }),
              HasSubstr("nothing but padding"));
}

TEST_F(DicomXrayView, PixelSpacingThatIsNoneIsIgnoredWhenTheStudySaysSo) {
  const auto ignore = [](StudyView& view) { view.reading.ignores_spacing = true; };
  const auto of_detector = [](test::DicomTestFile& file) {
    file.set_text({0x0018, 0x1164}, "DS", "0.000\\0.000");
  };
  EXPECT_THAT(refusal(of_detector), HasSubstr("must be two positive numbers"));
  expect_lines_of_levels(read(of_detector, ignore));
  const auto of_patient = [](test::DicomTestFile& file) {
    file.erase({0x0018, 0x1164});
    file.set_text({0x0028, 0x0030}, "DS", "0.000\\0.000");
  };
  expect_lines_of_levels(read(of_patient, ignore));
  EXPECT_THAT(read(of_patient, ignore).warnings, testing::IsEmpty());
  expect_lines_of_levels(read(of_patient));
  EXPECT_THAT(read(of_patient).warnings, testing::ElementsAre(HasSubstr("not checked")));
}

TEST_F(DicomXrayView, ItsPixelSpacingIsTheCamerasOrTheErrorNamesBoth) {
  const auto spacing = [](test::DicomTestFile& file) {
    file.set_text({0x0018, 0x1164}, "DS", "0.3\\0.4");  // rows, then columns
  };
  EXPECT_THAT(refusal(spacing),
              AllOf(HasSubstr("ImagerPixelSpacing = 0.4 x 0.3 mm"),
                    HasSubstr("camera 'A': 0.4 x 0.4 mm"),
                    HasSubstr("xray.dcm")));
  expect_lines_of_levels(
      read(spacing, [](StudyView& view) { view.reading.ignores_spacing = true; }));
  const ViewXray calibrated = read([](test::DicomTestFile& file) {
    file.erase({0x0018, 0x1164});
    file.set_text({0x0028, 0x0030}, "DS", "0.3\\0.3");
  });
  EXPECT_THAT(calibrated.warnings, testing::Contains(HasSubstr("PixelSpacing = 0.3 x 0.3 mm")));
}

TEST(XrayReader, ComparesTheSpacingOfOtherFormatsUnlessNobodyHasSetIt) {
  const ScratchFolder folder;
  StudyView view = view_of(folder, intensities());
  CameraGeometry geometry = camera(40, 50);
  geometry.pixel_spacing_mm = {0.41, 0.4};
  expect_refused(view, geometry, "pixel spacing = 0.4 x 0.4 mm");
  geometry.pixel_spacing_mm = {0.4035, 0.4};  // within 1 %
  EXPECT_NO_THROW((void)read_view_xray(view, geometry));
  write_image(intensities(), view.xray, 1.0, 1.0);
  EXPECT_NO_THROW((void)read_view_xray(view, geometry));
  view.reading.frame = 1;
  expect_refused(view, geometry, "xray_frame = 1");
}

TEST(XrayReader, FlatAndDarkImagesGiveTheLineIntegralsOfAnUnevenBeam) {
  const ScratchFolder folder;
  Image2d beam(40, 50);
  Image2d xray(40, 50);
  Image2d dark(40, 50);
  for (int row = 0; row < 50; ++row)
    for (int column = 0; column < 40; ++column) {
      dark.at(column, row) = static_cast<float>(100 + row % 3);
      beam.at(column, row) = dark.at(column, row) + 1024.0f + 32.0f * static_cast<float>(column);
      const float share = column < 20 ? 0.25f : 1.0f;
      xray.at(column, row) =
          dark.at(column, row) + share * (beam.at(column, row) - dark.at(column, row));
    }
  beam.at(7, 7) = dark.at(7, 7);
  StudyView view = view_of(folder, xray);
  write_image(beam, folder / "flat.mha", 0.4, 0.4);
  write_image(dark, folder / "dark.mha", 0.4, 0.4);
  view.reading.flat = folder / "flat.mha";
  view.reading.dark = folder / "dark.mha";
  const ViewXray found = read_view_xray(view, camera(40, 50));
  EXPECT_NEAR(found.attenuation.at(3, 3), std::log(4.0f), kLogRounding);
  EXPECT_NEAR(found.attenuation.at(30, 40), 0.0f, kLogRounding);
  EXPECT_EQ(found.mask.at(7, 7), 0.0f) << "a pixel without a beam";
  EXPECT_NE(found.mask.at(8, 7), 0.0f);
  EXPECT_THAT(found.note, HasSubstr("flat field (1 dead pixels masked)"));
  write_image(dark, folder / "flat.mha", 0.4, 0.4);
  expect_refused_with(view, "flat.mha: flat");
  write_image(Image2d(3, 3), folder / "flat.mha", 0.4, 0.4);
  expect_refused_with(view, "flat.mha: size = 3 x 3 px");
}

TEST(XrayReader, KeepsTheStudysMaskBesideAFlatFieldWithoutDeadPixels) {
  const ScratchFolder folder;
  Image2d xray(40, 50);
  Image2d beam(40, 50);
  Image2d mask(40, 50);
  for (std::size_t i = 0; i < xray.pixels.size(); ++i) {
    beam.pixels[i] = 1000.0f;
    xray.pixels[i] = i % 40 < 20 ? 250.0f : 1000.0f;
    mask.pixels[i] = i < 80 ? 0.0f : 255.0f;
  }
  StudyView view = view_of(folder, xray);
  write_image(beam, folder / "flat.mha", 0.4, 0.4);
  write_image_u16(mask, folder / "mask.png", 0.4, 0.4);
  view.reading.flat = folder / "flat.mha";
  view.mask = folder / "mask.png";
  const ViewXray found = read_view_xray(view, camera(40, 50));
  ASSERT_FALSE(found.mask.pixels.empty());
  EXPECT_EQ(found.mask.at(3, 1), 0.0f);
  EXPECT_NE(found.mask.at(3, 2), 0.0f);
}

TEST(XrayReader, TurnsAFlatFieldRoundByTheXraysFullScale) {
  const ScratchFolder folder;
  // Stored inverted, 16 bits: 65535 - counts. The open beam of 65000 counts is stored as 535.
  Image2d xray(40, 50);
  Image2d flat(40, 50);
  for (std::size_t i = 0; i < xray.pixels.size(); ++i) {
    flat.pixels[i] = 535.0f;
    xray.pixels[i] = 65535.0f - (i % 40 < 20 ? 6500.0f : 65000.0f);
  }
  StudyView view = view_of(folder, xray);
  view.reading.polarity = XrayPolarity::Inverted;
  write_image(flat, folder / "flat.mha", 0.4, 0.4);
  view.reading.flat = folder / "flat.mha";
  const ViewXray found = read_view_xray(view, camera(40, 50));
  EXPECT_NEAR(found.attenuation.at(3, 3), std::log(10.0f), kLogRounding);
  EXPECT_NEAR(found.attenuation.at(30, 3), 0.0f, kLogRounding);
  for (float& value : flat.pixels) value = 70000.0f;
  write_image(flat, folder / "flat.mha", 0.4, 0.4);
  expect_refused_with(view, "must not exceed 65535");
}

TEST(XrayReader, FindsTheOpenBeamAndMasksTheApertureWhenAskedTo) {
  const ScratchFolder folder;
  Image2d image(120, 100);
  for (int row = 0; row < 100; ++row)
    for (int column = 0; column < 120; ++column)
      image.at(column, row) = std::hypot(column - 60, row - 50) > 45   ? 3.0f
                              : std::hypot(column - 60, row - 50) < 20 ? 500.0f
                                                                       : 3000.0f;
  StudyView view = view_of(folder, image);
  view.roi = {40, 30, 40, 40};
  ViewXray found = read_view_xray(view, camera(120, 100));
  EXPECT_TRUE(found.mask.pixels.empty());
  EXPECT_THAT(found.note, HasSubstr("99.9th percentile, the default"));
  EXPECT_THAT(found.warnings, testing::Contains(HasSubstr("mask = \"auto\"")));
  view.reading.masks_borders = true;
  view.reading.air = AirSource::OpenBeam;
  found = read_view_xray(view, camera(120, 100));
  EXPECT_TRUE(found.warnings.empty());
  EXPECT_EQ(found.mask.at(60, 1), 0.0f);
  EXPECT_NE(found.mask.at(60, 50), 0.0f);
  EXPECT_NEAR(found.attenuation.at(60, 50), std::log(6.0f), kLogRounding);
  EXPECT_THAT(found.note, HasSubstr("air level 3000 (open beam"));
  EXPECT_THAT(found.note, HasSubstr("a round edge about pixel (60, 50)"));
  view.roi = {0, 0, 20, 20};
  expect_refused_with(view, "of roi_px, which cannot be border", camera(120, 100));
}

TEST(XrayReader, InvertedGreysAreToldAndTurnedRoundOnRequest) {
  const ScratchFolder folder;
  Image2d image(60, 60);
  for (int row = 0; row < 60; ++row)
    for (int column = 0; column < 60; ++column)
      image.at(column, row) = std::hypot(column - 30, row - 30) < 20 ? 155.0f : 5.0f;
  StudyView view = view_of(folder, image);
  EXPECT_THAT(read_view_xray(view, camera(60, 60)).warnings,
              testing::ElementsAre(HasSubstr("xray_polarity = \"inverted\"")));
  view.reading.polarity = XrayPolarity::Inverted;
  const ViewXray found = read_view_xray(view, camera(60, 60));
  EXPECT_TRUE(found.warnings.empty());
  EXPECT_THAT(found.note, HasSubstr("values inverted: 255 - stored"));
  EXPECT_NEAR(found.attenuation.at(30, 30), std::log(2.5f), kLogRounding);
}

// Photon noise: a body of 3 units of attenuation in the middle and 4.5 at the edge, no air at all.
TEST(XrayReader, AnatomyThatFillsThePictureIsNoNegative) {
  const ScratchFolder folder;
  HashRandom random(3);
  Image2d image(90, 90);
  for (int row = 0; row < 90; ++row)
    for (int column = 0; column < 90; ++column) {
      const double radius = std::hypot(column - 45, row - 45) / 45.0;
      const double mean = 60000.0 * std::exp(-1.0 - 2.5 * std::min(1.0, radius));
      image.at(column, row) =
          static_cast<float>(std::round(mean + std::sqrt(mean) * random.normal()));
    }
  StudyView view = view_of(folder, image);
  ViewXray found = read_view_xray(view, camera(90, 90));
  EXPECT_TRUE(found.warnings.empty());
  EXPECT_THAT(found.note, HasSubstr("background looks dark"));
  EXPECT_THAT(found.note, HasSubstr("detail grows with brightness: no negative"));
  view.reading.polarity = XrayPolarity::Inverted;
  found = read_view_xray(view, camera(90, 90));
  EXPECT_TRUE(found.warnings.empty()) << "air is at the edge of the negative, as it should be";
  EXPECT_THAT(found.note, HasSubstr("background looks bright"));
}

/// A LUT from 12 stored bits to intensities: 4095 - stored, but for the first and last entries.
test::DicomTestFile falling_lut(std::uint16_t first, std::size_t entries) {
  std::vector<std::uint16_t> data;
  for (std::size_t i = 0; i < entries; ++i) data.push_back(static_cast<std::uint16_t>(5000 - i));
  test::DicomTestFile item;
  item.set_u16s({0x0028, 0x3002}, {static_cast<std::uint16_t>(entries), first, 16});
  item.set_text({0x0028, 0x3004}, "LO", "US");
  item.set_u16s({0x0028, 0x3006}, data, "OW");
  return item;
}

TEST_F(DicomXrayView, ModalityLutIsApplied) {
  // Stored 500 becomes 5000, 1000 4500, 2000 3500; beyond the last entry 1001 stays.
  const ViewXray read_back = read([](test::DicomTestFile& file) {
    file.set_items({0x0028, 0x3000}, {falling_lut(500, 4000)});
  });
  EXPECT_NEAR(read_back.attenuation.pixels[3], -std::log(5000.0f / 4000.0f), kLogRounding);
  EXPECT_NEAR(read_back.attenuation.pixels[2], -std::log(4500.0f / 4000.0f), kLogRounding);
  EXPECT_NEAR(read_back.attenuation.pixels[1], -std::log(3500.0f / 4000.0f), kLogRounding);
  EXPECT_THAT(read_back.note, HasSubstr("Modality LUT applied (US, 4000 entries)"));
  const ViewXray clamped = read([](test::DicomTestFile& file) {
    file.set_items({0x0028, 0x3000}, {falling_lut(800, 1000)}, true);
  });
  EXPECT_NEAR(clamped.attenuation.pixels[3], -std::log(5000.0f / 4000.0f), kLogRounding);
  EXPECT_NEAR(clamped.attenuation.pixels[0], -std::log(4001.0f / 4000.0f), kLogRounding);
}

TEST_F(DicomXrayView, ModalityLutMakesTheLogarithmsOfAngiographyIntensities) {
  const auto logarithms = [](test::DicomTestFile& file) {
    file.set_text({0x0028, 0x1040}, "CS", "LOG");
    file.set_text({0x0028, 0x0004}, "CS", "MONOCHROME1");
    file.set_items({0x0028, 0x3000}, {falling_lut(500, 4000)});
  };
  const ViewXray xray = read(logarithms);
  EXPECT_NEAR(xray.attenuation.pixels[3], -std::log(5000.0f / 4000.0f), kLogRounding);
  EXPECT_THAT(xray.note, HasSubstr("which makes logarithms intensities"));
  const auto of_radiography = [&](test::DicomTestFile& file) {
    logarithms(file);
    file.set_text({0x0008, 0x0060}, "CS", "DX");
  };
  EXPECT_THAT(refusal(of_radiography), HasSubstr("the values are logarithms"));
}

TEST_F(DicomXrayView, BrokenModalityLutsAreRefused) {
  const auto refused = [&](const std::function<void(test::DicomTestFile&)>& edit_lut) {
    try {
      (void)read([&](test::DicomTestFile& file) {
        test::DicomTestFile lut = falling_lut(500, 40);
        edit_lut(lut);
        file.set_items({0x0028, 0x3000}, {lut});
      });
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(refused([](auto& lut) {
                lut.set_u16s({0x0028, 0x3002}, {41, 0, 16});
              }),
              HasSubstr("41 entries"));
  EXPECT_THAT(refused([](auto& lut) {
                lut.set_u16s({0x0028, 0x3002}, {40, 0});
              }),
              HasSubstr("LUTDescriptor"));
  EXPECT_THAT(refused([](auto& lut) {
                lut.set_u16s({0x0028, 0x3002}, {40, 0, 60});
              }),
              HasSubstr("1 to 16 bits"));
  EXPECT_THAT(refused([](auto& lut) { lut.erase({0x0028, 0x3006}); }), HasSubstr("40 entries"));
  EXPECT_THAT(refusal([](test::DicomTestFile& file) {
                file.set_items({0x0028, 0x3000}, {falling_lut(500, 40)});
                file.set_text({0x0028, 0x1052}, "DS", "0");
                file.set_text({0x0028, 0x1053}, "DS", "2");
              }),
              HasSubstr("contradict"));
}

TEST_F(DicomXrayView, FunctionalGroupsGiveTheSpacingOfAFrame) {
  const auto spaced = [](const char* spacing) {
    return [spacing](test::DicomTestFile& file) {
      file.erase({0x0018, 0x1164});
      test::DicomTestFile pixels;
      pixels.set_text({0x0018, 0x1164}, "DS", spacing);
      test::DicomTestFile other;
      other.set_text({0x0018, 0x1164}, "DS", "9\\9");
      test::DicomTestFile first;
      first.set_items({0x0028, 0x9443}, {other});
      test::DicomTestFile second;
      second.set_items({0x0028, 0x9443}, {pixels});
      file.set_items({0x5200, 0x9230}, {first, second});
    };
  };
  const auto frame_two = [](StudyView& view) { view.reading.frame = 2; };
  expect_lines_of_levels(read(spaced("0.4\\0.4"), frame_two, 2), 1);
  const auto spaced_twice = [&](test::DicomTestFile& file) {
    spaced("0.4\\0.4")(file);
    file.set_text({0x0018, 0x1164}, "DS", "0.5\\0.5");
  };
  expect_lines_of_levels(read(spaced_twice, frame_two, 2), 1);
  EXPECT_THAT(refusal(spaced("0.5\\0.5"), frame_two, 2), HasSubstr("ImagerPixelSpacing = 0.5"));
}

TEST(XrayReader, FramesThatOtherProgramsEncodedAreReadExactly) {
  const ScratchFolder folder;
  for (const test::EncodedFrame& frame : test::kEncodedFrames) {
    test::DicomTestFile file = test::xa_file(16, 12, 1, std::vector<int>(16 * 12, 0));
    file.set_fragment(frame.transfer_syntax, test::bytes_of_hex(frame.hex));
    file.write(folder / "frame.dcm");
    const DicomXray xray = read_dicom_xray(folder / "frame.dcm", std::nullopt);
    for (int row = 0; row < 12; ++row)
      for (int column = 0; column < 16; ++column)
        ASSERT_EQ(xray.image.at(column, row),
                  static_cast<float>(2000 + 40 * column - 30 * row + (column * row) % 5))
            << frame.encoder << ", column " << column << ", row " << row;
  }
}

// GDCM 3.0.21 ends its process on some (an assertion), which must not end ours.
TEST(XrayReader, DamagedEncodedFramesAreReadOrRefused) {
  const ScratchFolder folder;
  constexpr int kCopies = 25;
  constexpr int kChangedBytes = 3;
  std::set<bool> was_refused;
  for (const test::EncodedFrame& frame : test::kEncodedFrames) {
    const std::string sound = test::bytes_of_hex(frame.hex);
    for (std::uint64_t copy = 0; copy < kCopies; ++copy) {
      std::string bytes = sound;
      HashRandom random(1, copy);
      for (int change = 0; change < kChangedBytes; ++change)
        bytes[random.below(bytes.size())] = static_cast<char>(random.below(256));
      test::DicomTestFile file = test::xa_file(16, 12, 1, std::vector<int>(16 * 12, 0));
      file.set_fragment(frame.transfer_syntax, bytes);
      file.write(folder / "frame.dcm");
      try {
        const DicomXray xray = read_dicom_xray(folder / "frame.dcm", std::nullopt);
        EXPECT_EQ(xray.image.pixels.size(), 16U * 12U);
        was_refused.insert(false);
      } catch (const FileError& error) {
        EXPECT_THAT(error.what(), HasSubstr("its compressed pixels are corrupt"));
        was_refused.insert(true);
      }
    }
  }
  EXPECT_EQ(was_refused.size(), 2U)
      << "some must be refused, and some, with changed pixels only, must be read";
}

TEST(XrayReader, AMaskFileAndAnAutomaticMaskHideWhatEitherHides) {
  const ScratchFolder folder;
  Image2d image(60, 50);
  for (int row = 0; row < 50; ++row)
    for (int column = 0; column < 60; ++column)
      image.at(column, row) =
          column < 10 ? 5.0f : 3000.0f + 10.0f * static_cast<float>((column * 7 + row * 13) % 50);
  Image2d mask(60, 50);
  std::fill(mask.pixels.begin(), mask.pixels.end(), 1.0f);
  mask.at(40, 25) = 0.0f;
  StudyView view = view_of(folder, image);
  write_image(mask, folder / "mask.mha", 0.4, 0.4);
  view.mask = folder / "mask.mha";
  view.reading.masks_borders = true;
  const Image2d found = read_view_xray(view, camera(60, 50)).mask;
  EXPECT_EQ(found.at(40, 25), 0.0f) << "the file's";
  EXPECT_EQ(found.at(3, 25), 0.0f) << "the border's";
  EXPECT_EQ(found.at(45, 25), 1.0f);
}

/// 256 x 200 pixels of 1 mm, seen through OpenCV's distortion.
CameraGeometry distorting_camera(const LensDistortion& lens) {
  PinholeCamera pinhole;
  pinhole.pixels_from_camera << 400, 0, 130.5, 0, 380, 100.25, 0, 0, 1;
  CameraGeometry camera = camera_from_pinhole("A", pinhole, 0.4, {256, 200});
  camera.distortion = lens;
  return camera;
}

StudyView distorted_view(const ScratchFolder& folder, const Image2d& image) {
  StudyView view = view_of(folder, image, XrayDomain::Attenuation);
  view.reading.ignores_spacing = true;
  view.roi = {60, 50, 100, 100};
  return view;
}

constexpr LensDistortion kBarrel = {{-0.35, 0.12, 0.004, -0.003, 0.05}};

// cv2.undistort of OpenCV 4.6 rounds places to 1/32 px; the picture's steepest slope is 20 per px.
TEST(XrayReader, UndistortsAsOpenCvDoes) {
  const ScratchFolder folder;
  Image2d image(256, 200);
  for (int row = 0; row < 200; ++row)
    for (int column = 0; column < 256; ++column)
      image.at(column, row) =
          static_cast<float>(1000.0 + 300.0 * std::sin(column / 17.0) +
                             200.0 * std::cos(row / 23.0) + 0.01 * column * row);
  constexpr float kOpenCvRounding = 20.0f * 2.0f / 64.0f;
  const auto at = [&](const LensDistortion& lens) {
    return read_view_xray(distorted_view(folder, image), distorting_camera(lens)).attenuation;
  };
  const Image2d five = at(kBarrel);
  EXPECT_NEAR(five.at(10, 12), 1391.8446f, kOpenCvRounding);
  EXPECT_NEAR(five.at(128, 100), 1341.0282f, kOpenCvRounding);
  EXPECT_NEAR(five.at(240, 180), 1736.2079f, kOpenCvRounding);
  EXPECT_NEAR(five.at(60, 150), 1157.5388f, kOpenCvRounding);
  EXPECT_NEAR(five.at(200, 20), 917.6590f, kOpenCvRounding);
  const Image2d eight = at({{0.3, -0.1, 0.002, 0.001, 0.02, 0.5, 0.1, -0.05}});
  EXPECT_NEAR(eight.at(10, 12), 1380.6473f, kOpenCvRounding);
  EXPECT_NEAR(eight.at(240, 180), 1739.8680f, kOpenCvRounding);
  EXPECT_NEAR(eight.at(200, 20), 933.8280f, kOpenCvRounding);
}

// A grid of waves 25 px long, as the lens shows it, becomes the grid again. Bilinear interpolation
// of such a wave of amplitude 1 is wrong by at most (2 pi / 25)^2 / 8 per axis.
TEST(XrayReader, AGridSeenThroughTheLensBecomesTheGrid) {
  const ScratchFolder folder;
  const auto grid = [](const Eigen::Vector2d& pixel) {
    constexpr double kWave = 2.0 * 3.14159265358979323846 / 25.0;
    return static_cast<float>(std::cos(kWave * pixel.x()) + std::cos(kWave * pixel.y()));
  };
  const CameraGeometry camera = distorting_camera(kBarrel);
  const PixelDistortion distortion(camera);
  Image2d stored(256, 200);
  for (int row = 0; row < 200; ++row)
    for (int column = 0; column < 256; ++column) {
      const auto ideal =
          distortion.ideal_from_stored({static_cast<double>(column), static_cast<double>(row)});
      ASSERT_TRUE(ideal.has_value());
      stored.at(column, row) = grid(*ideal);
    }
  const ViewXray read = read_view_xray(distorted_view(folder, stored), camera);
  constexpr float kBilinear = 2.0f * 0.0079f * 1.3f;  // 1.3: the lens shrinks the wave
  float worst = 0.0f;
  for (int row = 0; row < 200; ++row)
    for (int column = 0; column < 256; ++column)
      worst = std::max(worst,
                       std::abs(read.attenuation.at(column, row) -
                                grid({static_cast<double>(column), static_cast<double>(row)})));
  EXPECT_LT(worst, kBilinear);
  EXPECT_THAT(read.note,
              HasSubstr("undistorted (-0.35 0.12 0.004 -0.003 0.05, bilinear; 0 pixels"));
  float undone = 0.0f;
  for (int row = 0; row < 200; ++row)
    undone = std::max(undone, std::abs(stored.at(0, row) - grid({0.0, static_cast<double>(row)})));
  EXPECT_GT(undone, 0.5f) << "the lens must change something";
}

TEST(XrayReader, PixelsThatTheLensDoesNotShowAreMasked) {
  const ScratchFolder folder;
  Image2d image(256, 200);
  image.at(3, 3) = 1.0f;
  const CameraGeometry camera = distorting_camera({{0.3}});  // stored places lie further out
  const StudyView view = distorted_view(folder, image);
  const ViewXray read = read_view_xray(view, camera);
  ASSERT_EQ(read.mask.pixels.size(), image.pixels.size());
  EXPECT_EQ(read.mask.at(0, 0), 0.0f);
  EXPECT_EQ(read.mask.at(130, 100), 1.0f);
  const PixelDistortion distortion(camera);
  for (int column = 0; column < 256; ++column) {
    const Eigen::Vector2d stored = distortion.stored_from_ideal({static_cast<double>(column), 7.0});
    const bool is_inside = stored.minCoeff() >= 0.0 && stored.x() <= 255.0 && stored.y() <= 199.0;
    EXPECT_EQ(read.mask.at(column, 7) != 0.0f, is_inside) << column;
  }
  StudyView corner = view;
  corner.roi = {0, 0, 6, 6};
  EXPECT_THAT(test::message_of<InputError>([&] { (void)read_view_xray(corner, camera); }),
              HasSubstr("more than half of roi_px without data"));
}

TEST(XrayReader, MasksAreThoseOfTheStoredXray) {
  const ScratchFolder folder;
  Image2d image(256, 200);
  image.at(3, 3) = 1.0f;
  Image2d mask(256, 200);
  std::fill(mask.pixels.begin(), mask.pixels.end(), 1.0f);
  const CameraGeometry camera = distorting_camera(kBarrel);
  const Eigen::Vector2d stored = PixelDistortion(camera).stored_from_ideal({30, 180});
  mask.at(static_cast<int>(stored.x()), static_cast<int>(stored.y())) = 0.0f;
  write_image(mask, folder / "mask.mha", 0.4, 0.4);
  StudyView view = distorted_view(folder, image);
  view.mask = folder / "mask.mha";
  const Image2d found = read_view_xray(view, camera).mask;
  EXPECT_EQ(found.at(30, 180), 0.0f);
  EXPECT_EQ(found.at(33, 177), 1.0f) << "not where it stands in the file";
}

TEST(XrayReader, PreparesValuesAsTheFileThatHoldsThem) {
  const ScratchFolder folder;
  const auto counts = [](std::uint64_t seed) {
    HashRandom random(seed, 0);
    Image2d image(256, 200);
    for (float& value : image.pixels)
      value = static_cast<float>(std::floor(random.uniform(500.0, 3500.0)));
    return image;
  };
  Image2d mask = counts(1);
  mask.pixels[7] = 0.0f;
  write_image(mask, folder / "mask.mha", 0.4, 0.4);
  Image2d beam(256, 200);
  std::fill(beam.pixels.begin(), beam.pixels.end(), 4000.0f);
  write_image(beam, folder / "flat.mha", 0.4, 0.4);
  const CameraGeometry camera = distorting_camera(kBarrel);
  StudyView plain = distorted_view(folder, counts(2));
  plain.xray_domain = XrayDomain::Intensity;
  StudyView corrected = plain;
  corrected.mask = folder / "mask.mha";
  corrected.reading.flat = folder / "flat.mha";
  corrected.reading.dark_level = 20.0;
  StudyView inverted = plain;
  inverted.reading.polarity = XrayPolarity::Inverted;
  inverted.reading.masks_borders = true;
  StudyView attenuation = plain;
  attenuation.xray_domain = XrayDomain::Attenuation;
  for (const StudyView& view : {plain, corrected, inverted, attenuation}) {
    write_image(counts(2), view.xray, 0.4, 0.4);
    ViewXrayReader reader(view, camera);
    (void)reader.read();
    const ViewXray found = reader.prepared(counts(3));
    write_image(counts(3), view.xray, 0.4, 0.4);
    const ViewXray expected = read_view_xray(view, camera);
    EXPECT_EQ(found.attenuation.pixels, expected.attenuation.pixels);
    EXPECT_EQ(found.mask.pixels, expected.mask.pixels);
    EXPECT_EQ(found.note, expected.note);
  }
  ViewXrayReader reader(plain, camera);
  Image2d broken = counts(2);
  broken.at(3, 1) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(test::message_of<InputError>([&] { (void)reader.prepared(broken); }),
              AllOf(HasSubstr("X-ray of '"), HasSubstr("pixel (3, 1)"), HasSubstr("finite")));
  EXPECT_THAT(test::message_of<InputError>([&] { (void)reader.prepared(Image2d(3, 3)); }),
              HasSubstr("size = 3 x 3 px"));
}

}  // namespace
}  // namespace af
