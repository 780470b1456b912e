// SPDX-License-Identifier: Apache-2.0
#include "figures/study_pictures.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "figures/ct_pictures.h"
#include "figures/patient_directions.h"
#include "figures/picture_match.h"
#include "figures/room_sketch.h"
#include "study/rig_file.h"
#include "support/test_paths.h"
#include "xray/image_file.h"

namespace af {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

TEST(PatientLetters, NameTheNearestDirectionsFirst) {
  EXPECT_EQ(patient_letters({1, 0, 0}), "L");
  EXPECT_EQ(patient_letters({-1, 0, 0}), "R");
  EXPECT_EQ(patient_letters({0, 1, 0}), "P");
  EXPECT_EQ(patient_letters({0, -5, 0}), "A");
  EXPECT_EQ(patient_letters({0, 0, 1}), "H");
  EXPECT_EQ(patient_letters({0, 0, -1}), "F");
  EXPECT_EQ(patient_letters({0.9, -0.5, 0.1}), "LA");
  EXPECT_EQ(patient_letters({0.5, 0.6, -0.7}), "FPL");
}

// The contract's c-arm-12in with a supine patient: in AP the patient's right is on the picture's
// left and the head on top; LAT looks from the patient's left (+x), so the front (-y) is left.
TEST(EdgeLetters, OfTheShippedCArmAreThoseOfARadiograph) {
  const CameraRig rig = parse_rig(builtin_rig_text("c-arm-12in"), "c-arm-12in");
  const EdgeLetters ap = edge_letters(rig.camera("AP"), RigidTransform::Identity());
  EXPECT_EQ(ap.left + ap.right + ap.top + ap.bottom, "RLHF");
  EXPECT_EQ(ap.beam_from + ap.beam_to, "AP");
  const EdgeLetters lat = edge_letters(rig.camera("LAT"), RigidTransform::Identity());
  EXPECT_EQ(lat.left + lat.right + lat.top + lat.bottom, "APHF");
  EXPECT_EQ(lat.beam_from + lat.beam_to, "LR");
}

TEST(EdgeLetters, FollowThePatientWhenItIsTurned) {
  const CameraRig rig = parse_rig(builtin_rig_text("c-arm-12in"), "c-arm-12in");
  RigidTransform prone = RigidTransform::Identity();  // half a turn about the long axis
  prone.linear() = rotation_from_angles({0, 0, 180.0 * kRadPerDeg});
  const EdgeLetters ap = edge_letters(rig.camera("AP"), prone);
  EXPECT_EQ(ap.left + ap.right + ap.top + ap.bottom, "LRHF");
  EXPECT_EQ(ap.beam_from + ap.beam_to, "PA");
}

/// A picture without symmetry: an L of discs on a smooth ground.
Image2d uneven_picture(int side) {
  Image2d image(side, side);
  const std::vector<std::array<double, 3>> discs = {
      {0.3, 0.25, 0.12}, {0.32, 0.5, 0.1}, {0.35, 0.75, 0.13}, {0.65, 0.75, 0.08}};
  for (int row = 0; row < side; ++row)
    for (int column = 0; column < side; ++column) {
      double value = 0.3 * row / side;
      for (const auto& [x, y, radius] : discs)
        if (std::hypot((column + 0.5) / side - x, (row + 0.5) / side - y) < radius) value += 2.0;
      image.at(column, row) = static_cast<float>(value);
    }
  return image;
}

Image2d mirrored(const Image2d& image) {
  Image2d result(image.width, image.height);
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < image.width; ++column)
      result.at(column, row) = image.at(image.width - 1 - column, row);
  return result;
}

Image2d shifted(const Image2d& image, int columns, int rows) {
  Image2d result(image.width, image.height);
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < image.width; ++column)
      result.at(column, row) = image.at(std::clamp(column - columns, 0, image.width - 1),
                                        std::clamp(row - rows, 0, image.height - 1));
  return result;
}

Image2d turned_clockwise(const Image2d& image) {
  Image2d result(image.height, image.width);
  for (int row = 0; row < result.height; ++row)
    for (int column = 0; column < result.width; ++column)
      result.at(column, row) = image.at(row, image.height - 1 - column);
  return result;
}

TEST(LayingTelltale, IsSilentForPicturesThatAreMerelyShifted) {
  const Image2d drr = uneven_picture(96);
  EXPECT_EQ(laying_telltale(laying_matches(shifted(drr, 9, -7), drr)), "");
}

TEST(LayingTelltale, NamesHowThePictureWouldFit) {
  const Image2d drr = uneven_picture(96);
  EXPECT_THAT(laying_telltale(laying_matches(shifted(mirrored(drr), 6, 4), drr)),
              HasSubstr("when flipped left to right"));
  // A picture turned clockwise fits after a turn the other way.
  EXPECT_THAT(laying_telltale(laying_matches(turned_clockwise(drr), drr)),
              HasSubstr("when turned by 90 degrees anticlockwise"));
  EXPECT_THAT(laying_telltale(laying_matches(turned_clockwise(turned_clockwise(drr)), drr)),
              HasSubstr("when turned by 180 degrees"));
}

TEST(LayingTelltale, IsSilentForNoiseAndForConstantPictures) {
  HashRandom random(3);
  Image2d noise(64, 64);
  for (float& pixel : noise.pixels) pixel = static_cast<float>(random.normal());
  EXPECT_EQ(laying_telltale(laying_matches(noise, uneven_picture(64))), "");
  EXPECT_EQ(laying_telltale(laying_matches(Image2d(64, 64), uneven_picture(64))), "");
}

/// The picture scaled about its middle, as a detector with other pixels sees it. Takes nearest
/// neighbours.
Image2d scaled(const Image2d& image, double factor) {
  Image2d result(image.width, image.height);
  const auto source = [&](int at, int count) {
    const double middle = 0.5 * (count - 1);
    return std::clamp(static_cast<int>(std::lround(middle + (at - middle) / factor)), 0, count - 1);
  };
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < image.width; ++column)
      result.at(column, row) = image.at(source(column, image.width), source(row, image.height));
  return result;
}

// Factors between the steps of 2^(1/6): the nearest is named.
TEST(ScaleTelltale, NamesTheScaleThatWouldFit) {
  const Image2d drr = uneven_picture(128);
  EXPECT_THAT(scale_telltale(scale_matches(shifted(scaled(drr, 0.5), 5, -3), drr)),
              HasSubstr("when scaled by 2.00"));
  EXPECT_THAT(scale_telltale(scale_matches(scaled(drr, 1.0 / 1.6), drr)),
              HasSubstr("when scaled by 1.59"));
  EXPECT_THAT(scale_telltale(scale_matches(scaled(drr, 1.6), drr)),
              HasSubstr("when scaled by 0.63"));
}

TEST(ScaleTelltale, IsSilentForWhatPosesExplainAndForNoise) {
  const Image2d drr = uneven_picture(128);
  for (const double factor : {0.85, 1.0, 1.15})
    EXPECT_EQ(scale_telltale(scale_matches(shifted(scaled(drr, factor), 8, 6), drr)), "") << factor;
  HashRandom random(3);
  Image2d noise(64, 64);
  for (float& pixel : noise.pixels) pixel = static_cast<float>(random.normal());
  EXPECT_EQ(scale_telltale(scale_matches(noise, uneven_picture(64))), "");
  EXPECT_EQ(scale_telltale(scale_matches(Image2d(64, 64), uneven_picture(64))), "");
  EXPECT_EQ(scale_telltale(scale_matches(Image2d(1, 1), Image2d(1, 1))), "");
}

TEST(RoomSketch, ShowsEveryCameraWithinItsPaper) {
  const CameraRig rig = parse_rig(builtin_rig_text("c-arm-12in"), "c-arm-12in");
  CtGrid ct;
  ct.size = {100, 100, 50};
  for (const PicturePanel& panel : room_sketch(rig.cameras, ct, RigidTransform::Identity())) {
    // Per camera four rays, a detector and its first row; twelve edges of the CT.
    EXPECT_EQ(panel.lines.size(), 2U * 6U + 12U);
    EXPECT_EQ(panel.marks.size(), 2U * 2U + 6U);
    for (const PictureMark& mark : panel.marks) {
      EXPECT_GE(std::min(mark.place[0], mark.place[1]), 0.0);
      EXPECT_LE(std::max(mark.place[0], mark.place[1]), panel.image.width);
    }
  }
}

/// Renders DRRs of one value.
class FlatDrr final : public DrrRenderer {
 public:
  explicit FlatDrr(float value) : value_(value) {}
  RenderStatus render(const RigidTransform& /*room_from_ct*/,
                      const View& /*view*/,
                      RenderWorkspace& /*workspace*/,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& /*gradients*/) const override {
    std::ranges::fill(total_attenuation, value_);
    return {};
  }
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override {
    return std::make_unique<RenderWorkspace>();
  }
  [[nodiscard]] const char* name() const override { return "field"; }

 private:
  float value_;
};

TEST(StudyPictures, ShowTheDrrsOfTheRendererThatIsNamedForAView) {
  const test::ScratchFolder folder;
  Study study;
  study.rig = parse_rig(builtin_rig_text("c-arm-12in"), "c-arm-12in");
  const CameraGeometry& camera = study.rig.camera("AP");
  const Image2d xray = uneven_picture(camera.size_px.x());
  write_image(xray, folder / "xray.mha", camera.pixel_spacing_mm.x(), camera.pixel_spacing_mm.y());
  StudyCase& only = study.cases.emplace_back();
  only.name = "one";
  StudyView& view = only.views.emplace_back();
  view.camera = "AP";
  view.xray = folder / "xray.mha";
  view.xray_domain = XrayDomain::Attenuation;
  view.roi = {64, 64, 128, 128};
  CtGrid ct;
  ct.size = {100, 100, 50};
  for (const float value : {1.0F, 0.0F}) {
    std::vector<int> widths;
    const ViewRenderer renderer_of = [&](const View& seen, const RigidTransform& /*pose*/) {
      widths.push_back(seen.roi.width);
      return std::make_shared<const FlatDrr>(value);
    };
    const StudyPictures drawn =
        draw_study_pictures(study, only, ct, renderer_of, 128, folder.path(), "one");
    EXPECT_EQ(widths, std::vector<int>{camera.size_px.x() / 2}) << "the nominal pose, shrunk";
    EXPECT_EQ(drawn.problems.size(), value > 0.0F ? 0U : 1U) << "a DRR without matter";
    EXPECT_EQ(drawn.files.size(), 2U);
    for (const std::filesystem::path& file : drawn.files)
      EXPECT_TRUE(std::filesystem::exists(file)) << file;
  }
}

/// The middle of a panel's brightest pixels. White, which carries the coordinates, does not count.
std::array<double, 2> brightest_place(const PicturePanel& panel) {
  float highest = -1e9F;
  for (const float value : panel.image.pixels)
    if (value < 1e6F) highest = std::max(highest, value);
  std::array<double, 3> sums = {0.0, 0.0, 0.0};
  for (int row = 0; row < panel.image.height; ++row)
    for (int column = 0; column < panel.image.width; ++column)
      if (const float value = panel.image.at(column, row); value < 1e6F && value > highest - 1.0F)
        sums = {sums[0] + column, sums[1] + row, sums[2] + 1.0};
  return {sums[0] / sums[2], sums[1] / sums[2]};
}

// Axial is seen from the feet, coronal from the front, sagittal from the patient's left. So left is
// at the right, the back is below, and the head is on top. A marked point lies on what the CT has
// there, whatever the order of its voxels.
TEST(CtOverview, ShowsPointsOfTheCtWhereRadiographersExpectThem) {
  const Vector3d point(30.0, 20.0, 10.0);
  for (const Vector3d& signs : {Vector3d(1, 1, 1), Vector3d(-1, -1, 1), Vector3d(1, -1, -1)}) {
    CtVolume ct;
    ct.grid.size = {50, 40, 30};
    ct.grid.spacing_mm = {2.0, 2.5, 3.0};
    ct.grid.direction = signs.asDiagonal();
    ct.grid.origin_mm = -ct.grid.center_mm();
    std::vector<std::int16_t> hu(ct.grid.voxel_count(), -1000);
    const Vector3d index = ct.grid.index_of(point);
    const auto at = [&](int axis) { return static_cast<std::size_t>(std::lround(index[axis])); };
    hu[at(0) + 50 * (at(1) + 40 * at(2))] = 1000;
    ct.hu = SharedArray<std::int16_t>(std::move(hu));
    const std::vector<PicturePanel> panels =
        ct_overview(ct, {CtBox{point - Vector3d::Ones(), point + Vector3d::Ones()}, {point}});
    ASSERT_EQ(panels.size(), 6U);
    const std::array<const char*, 3> letters = {"RLAP", "RLHF", "APHF"};
    const std::array<bool, 3> is_below = {true, false, false};
    for (std::size_t i = 0; i < panels.size(); ++i) {
      const PicturePanel& panel = panels[i];
      std::string found;
      for (const PictureMark& mark : panel.marks) {
        if (mark.shape == PictureMark::Shape::None) found += mark.text;
        if (mark.shape != PictureMark::Shape::Cross) continue;
        // The nearest voxel: half of 3 mm at 5.6 px per mm.
        EXPECT_NEAR(mark.place[0], brightest_place(panel)[0], 8.5) << i;
        EXPECT_NEAR(mark.place[1], brightest_place(panel)[1], 8.5) << i;
        EXPECT_GT(mark.place[0], panel.image.width / 2.0) << i;
        EXPECT_EQ(mark.place[1] > panel.image.height / 2.0, is_below[i % 3]) << i;
      }
      EXPECT_EQ(found, letters[i % 3]);
    }
  }
}

}  // namespace
}  // namespace af
