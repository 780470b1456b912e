// SPDX-License-Identifier: Apache-2.0
#include "precompute/casting/measured_residual.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "precompute/casting/corrected_caster.h"
#include "precompute/casting/trilinear_caster.h"
#include "precompute/casting/unit_planner.h"
#include "support/ct_phantoms.h"

namespace af {
namespace {

using testing::HasSubstr;

constexpr double kRadiusMm = 500.0;
constexpr double kDistanceMm = 800.0;
constexpr int kColumns = 81;
constexpr int kRows = 61;
constexpr double kPixelMm = 2.0;

/// A box of water of 64 x 48 x 56 mm about the origin: 16 x 12 x 14 voxels of 4 mm, in air.
AttenuationVolume water_box() {
  CtGrid grid;
  grid.size = {20, 16, 18};
  grid.spacing_mm = Eigen::Vector3d::Constant(4.0);
  grid.origin_mm = -grid.point_mm(Eigen::Vector3d(9.5, 7.5, 8.5));
  return {box_phantom(grid, {2, 2, 2}, {17, 13, 15}, 0), AttenuationModel{}};
}

/// The camera at an angle of a circle about z; at 0 its source is at (0, -500, 0) mm.
CameraGeometry camera_at(double angle_deg) {
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(angle_deg * kRadPerDeg, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  CameraGeometry camera;
  camera.name = "at " + std::to_string(angle_deg);
  camera.size_px = {kColumns, kRows};
  camera.pixel_spacing_mm = {kPixelMm, kPixelMm};
  camera.source_point = turn * Eigen::Vector3d(0.0, -kRadiusMm, 0.0);
  camera.column_direction = turn.col(0);
  camera.row_direction = -turn.col(2);
  camera.detector_origin_point = turn * Eigen::Vector3d(-0.5 * (kColumns - 1) * kPixelMm,
                                                        kDistanceMm - kRadiusMm,
                                                        0.5 * (kRows - 1) * kPixelMm);
  return camera;
}

/// Views of a scan, each with an image of its own that `value(view, column, row)` fills.
class Views {
 public:
  template <typename Value>
  Views(const std::vector<double>& angles_deg, Value&& value) {
    images_.resize(angles_deg.size());
    for (std::size_t view = 0; view < angles_deg.size(); ++view) {
      for (int row = 0; row < kRows; ++row)
        for (int column = 0; column < kColumns; ++column)
          images_[view].push_back(static_cast<float>(value(view, column, row)));
      views_.push_back({camera_at(angles_deg[view]), images_[view]});
    }
  }
  [[nodiscard]] const std::vector<ResidualView>& all() const { return views_; }

 private:
  std::vector<std::vector<float>> images_;
  std::vector<ResidualView> views_;
};

std::vector<double> angles(double step_deg) {
  std::vector<double> all;
  for (double angle = 0.0; angle < 360.0; angle += step_deg) all.push_back(angle);
  return all;
}

constexpr double kInfinity = std::numeric_limits<double>::infinity();
const Eigen::Vector3d kTowardFirst(0.0, -1.0, 0.0);

double random_value(std::size_t view, int column, int row) {
  return HashRandom(view, static_cast<std::uint64_t>(column), static_cast<std::uint64_t>(row))
      .uniform(-1.0, 1.0);
}

TEST(MeasuredResidual, OfARayThatWasMeasuredIsItsPixel) {
  const Views views(angles(4.0), random_value);
  const AttenuationVolume volume = water_box();
  const MeasuredResidual residual(views.all(), volume, kTowardFirst);
  // Every point of the ray projects to the pixel's centre, to rounding: some 1e-12 of a pixel,
  // between neighbours that differ by at most 2.
  constexpr double kRounding = 1e-9;
  for (const std::size_t view : {0U, 1U, 5U, 85U, 89U})
    for (const auto& [column, row] : {std::pair{40, 30}, {33, 41}, {47, 22}}) {
      const CameraGeometry& camera = views.all()[view].camera;
      const double expected =
          static_cast<double>(static_cast<float>(random_value(view, column, row)));
      // From the source itself, and from a point of the ray beyond the source.
      const Eigen::Vector3d pixel = camera.detector_point(column, row);
      const Eigen::Vector3d behind = camera.source_point + 0.1 * (camera.source_point - pixel);
      EXPECT_NEAR(residual.along(camera.source_point, pixel, 0.0, kInfinity), expected, kRounding);
      EXPECT_NEAR(residual.along(behind, pixel, 0.0, kInfinity), expected, kRounding);
    }
}

TEST(MeasuredResidual, BetweenTwoViewsGoesLinearlyAlongTheChordOfTheirSources) {
  const Views views(angles(4.0), [](std::size_t view, int, int) {
    return 1.0 + 0.5 * static_cast<double>(view);
  });
  const AttenuationVolume volume = water_box();
  const MeasuredResidual residual(views.all(), volume, kTowardFirst);
  const Eigen::Vector3d a = views.all()[2].camera.source_point;
  const Eigen::Vector3d b = views.all()[3].camera.source_point;
  for (const double share : {0.0, 0.25, 0.5, 0.9}) {
    const Eigen::Vector3d on_chord = a + share * (b - a);
    for (const double height_mm : {0.0, 30.0})
      EXPECT_NEAR(residual.along(on_chord + Eigen::Vector3d(0.0, 0.0, height_mm),
                                 Eigen::Vector3d(3.0, 2.0, -4.0),
                                 0.0,
                                 kInfinity),
                  2.0 + 0.5 * share,
                  1e-12);
  }
}

TEST(MeasuredResidual, PartsOfARaySumToTheWhole) {
  const Views views(angles(4.0), random_value);
  const AttenuationVolume volume = water_box();
  const MeasuredResidual residual(views.all(), volume, kTowardFirst);
  const Eigen::Vector3d start(20.0, -510.0, 60.0);
  const Eigen::Vector3d through(2.0, 1.0, 3.0);
  const double whole = residual.along(start, through, 0.0, kInfinity);
  double sum = 0.0;
  const std::array ends = {-kInfinity, 0.97, 0.99, 1.0, 1.02, kInfinity};
  for (std::size_t i = 0; i + 1 < ends.size(); ++i)
    sum += residual.along(start, through, ends[i], ends[i + 1]);
  EXPECT_NE(whole, 0.0);
  EXPECT_NEAR(sum, whole, 1e-12);
}

/// The image is linear in its rows. In a uniform box its mean over a ray's points is an integral in
/// closed form, from where the ray enters the CT's grid to where it leaves.
TEST(MeasuredResidual, AboveTheCircleIsTheMeanOverTheRaysPoints) {
  const auto of_row = [](std::size_t, int, int row) { return 0.1 * row; };
  const Views views(angles(4.0), of_row);
  const AttenuationVolume volume = water_box();
  const MeasuredResidual residual(views.all(), volume, kTowardFirst);
  for (const double height_mm : {20.0, 80.0}) {
    const Eigen::Vector3d start(0.0, -kRadiusMm, height_mm);
    // At depth y the ray is at z = -height y / R; camera 0 sees it at row 30 + z / pixel_mm *
    // 800 / (500 + y) below the middle: linear in y / (500 + y), whose mean over [-h, h] is
    // 1 - R / (2 h) log((R + h) / (R - h)).
    constexpr double kHalfDepthMm = 24.0;
    const double mean = 1.0 - kRadiusMm / (2.0 * kHalfDepthMm) *
                                  std::log((kRadiusMm + kHalfDepthMm) / (kRadiusMm - kHalfDepthMm));
    const double expected = 0.1 * (30.0 + height_mm / kRadiusMm * kDistanceMm / kPixelMm * mean);
    // The box's faces lie half a voxel of 4 mm within cells that are a voxel wide. Midpoints of
    // steps of about one voxel are that far from the integral's ends, on both sides. One step of
    // the 12 at an end changes at most 1/12 of the half range of rows.
    const double half_range =
        0.1 * height_mm / kRadiusMm * kDistanceMm / kPixelMm * kHalfDepthMm / kRadiusMm;
    EXPECT_NEAR(residual.along(start, Eigen::Vector3d::Zero(), 0.0, kInfinity),
                expected,
                half_range / 12.0);
  }
}

/// Every view of a ball in the middle is the same, and so is the view between two: what the
/// neighbours predict misses it only by the parallax of points that are not in the middle.
TEST(MeasuredResidual, OfNothingButDenseViewsIsTheHeldOutView) {
  constexpr double kBallMm = 40.0;
  constexpr double kStepDeg = 2.0;
  const auto line_integral = [](const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
    const Eigen::Vector3d along = (to - from).normalized();
    const double beside_mm = from.cross(along).norm();
    return 2.0 * std::sqrt(std::max(0.0, kBallMm * kBallMm - beside_mm * beside_mm));
  };
  const CameraGeometry first = camera_at(0.0);
  const Views views(angles(kStepDeg), [&](std::size_t, int column, int row) {
    return line_integral(first.source_point, first.detector_point(column, row));
  });
  const AttenuationVolume volume = water_box();
  const MeasuredResidual residual(views.all(), volume, kTowardFirst);
  const CameraGeometry held_out = camera_at(0.5 * kStepDeg);
  // A chord 2 sqrt(R^2 - x^2) bends by at most 2 / (0.8^3 R) = 0.098 per mm where x < 0.6 R. A
  // point at depth y stands beside the ray of a view that is a degree away by y sin(1 deg): 0.8 mm
  // for the box's 46 mm from middle to corner. Linear interpolation between pixels 1.25 mm apart at
  // the axis adds (1.25 mm)^2 / 8.
  constexpr double kBend = 0.098;
  const double parallax_mm = 46.0 * std::sin(0.5 * kStepDeg * kRadPerDeg);
  const double tolerance = kBend * (0.5 * parallax_mm * parallax_mm + 1.25 * 1.25 / 8.0);
  for (const int column : {25, 33, 40, 52})
    for (const int row : {24, 30, 38}) {
      const Eigen::Vector3d pixel = held_out.detector_point(column, row);
      EXPECT_NEAR(residual.along(held_out.source_point, pixel, 0.0, kInfinity),
                  line_integral(held_out.source_point, pixel),
                  tolerance);
    }
}

TEST(MeasuredResidual, IsZeroWhereNothingWasMeasured) {
  const std::vector<double> arc = {-8.0, -4.0, 0.0, 4.0, 8.0};
  const Views views(arc, [](std::size_t, int, int) { return 1.0; });
  const AttenuationVolume volume = water_box();
  const MeasuredResidual residual(views.all(), volume, kTowardFirst);
  EXPECT_EQ(residual.view_count(), arc.size());
  const auto from = [&](double angle_deg, const Eigen::Vector3d& through) {
    return residual.along(camera_at(angle_deg).source_point, through, 0.0, kInfinity);
  };
  EXPECT_NEAR(from(7.9, Eigen::Vector3d::Zero()), 1.0, 1e-12);
  EXPECT_EQ(from(8.5, Eigen::Vector3d::Zero()), 0.0) << "beyond the last view";
  EXPECT_EQ(from(-30.0, Eigen::Vector3d::Zero()), 0.0);
  EXPECT_EQ(from(1.0, Eigen::Vector3d(0.0, 0.0, 60.0)), 0.0) << "past the CT";
}

TEST(MeasuredResidual, CountsPointsThatAViewDoesNotSeeAsZero) {
  const Views views(angles(4.0), [](std::size_t, int, int) { return 1.0; });
  std::vector<ResidualView> lower = views.all();
  // 30 of 61 rows further down: the first row sees the plane of the circle.
  for (ResidualView& view : lower)
    view.camera.detector_origin_point += 30.0 * kPixelMm * view.camera.row_direction;
  const AttenuationVolume volume = water_box();
  const MeasuredResidual residual(lower, volume, kTowardFirst);
  const auto from_height = [&](double height_mm) {
    return residual.along(
        Eigen::Vector3d(0.0, -kRadiusMm, height_mm), Eigen::Vector3d::Zero(), 0.0, kInfinity);
  };
  // The ray crosses the plane in the box's middle, so the views see the further half of its points.
  // There is one point per voxel of the 12; one of them may lie in the plane itself.
  EXPECT_NEAR(from_height(100.0), 0.5, 1.0 / 12.0);
  EXPECT_NEAR(from_height(-100.0), 0.5, 1.0 / 12.0);
}

TEST(MeasuredResidual, RefusesSourcesThatAreOnNoCircle) {
  const auto one = [](std::size_t, int, int) { return 1.0; };
  EXPECT_THAT(orbit_problems(Views({0.0, 90.0}, one).all()).at(0), HasSubstr("at least 3"));
  EXPECT_TRUE(orbit_problems(Views(angles(4.0), one).all()).empty());
  std::vector<ResidualView> views = Views(angles(4.0), one).all();
  views[7].camera.source_point.z() += 100.0;
  EXPECT_THAT(orbit_problems(views).at(0), HasSubstr("must lie on a circle"));
  for (std::size_t i = 0; i < views.size(); ++i)
    views[i].camera.source_point = Eigen::Vector3d(10.0 * static_cast<double>(i), -500.0, 0.0);
  EXPECT_THAT(orbit_problems(views).at(0), HasSubstr("lie on a line"));
}

// ---- the caster ----

/// Viewpoints about the first source, two slabs.
LightSlab slab_before_first_view() {
  LightSlab light_slab;
  light_slab.slab_from_ct = slab_from_ct_at_nominal(camera_at(0.0), PoseFrame{});
  light_slab.uv_plane_y_mm = kRadiusMm;
  light_slab.u = {-60.0, 60.0, 6};
  light_slab.v = {-60.0, 60.0, 6};
  SlabGeometry slab;
  slab.s = {-40.0, 40.0, 18};
  slab.t = {-40.0, 40.0, 18};
  slab.stored_s = {0, 18};
  slab.stored_t = {0, 18};
  light_slab.slabs = {slab, slab};
  light_slab.slabs[0].y_high_mm = light_slab.slabs[1].y_low_mm = 3.0;
  return light_slab;
}

std::vector<std::uint16_t> cast_all(const FieldCaster& caster,
                                    const LightSlab& light_slab,
                                    std::int64_t rays_per_unit) {
  std::vector<std::uint16_t> all;
  for (const WorkUnit& unit : plan_units(light_slab.lattice(), {rays_per_unit})) {
    std::vector<std::uint16_t> samples(unit.sample_count());
    caster.cast(unit, samples);
    all.insert(all.end(), samples.begin(), samples.end());
  }
  return all;
}

class CorrectedCaster : public testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<const FieldCaster> plain() const {
    return std::make_unique<const TrilinearFieldCaster>(
        volume_, light_slab_, quantizer_, RayCasterOptions{2.0});
  }
  [[nodiscard]] std::unique_ptr<const FieldCaster> corrected(const Views& views) const {
    return std::make_unique<const CorrectedFieldCaster>(
        plain(), MeasuredResidual(views.all(), volume_, kTowardFirst), light_slab_, quantizer_);
  }

  AttenuationVolume volume_ = water_box();
  AttenuationQuantizer quantizer_ =
      AttenuationQuantizer::for_maximum(volume_.max_total_attenuation());
  LightSlab light_slab_ = slab_before_first_view();
};

TEST_F(CorrectedCaster, OfACtThatLeavesNothingHasThePlainCastersBytes) {
  const Views nothing(angles(4.0), [](std::size_t, int, int) { return 0.0; });
  EXPECT_EQ(cast_all(*corrected(nothing), light_slab_, 1000),
            cast_all(*plain(), light_slab_, 1000));
}

TEST_F(CorrectedCaster, AddsAResidualThatIsTheSameEverywhereToEveryRayOfTheCt) {
  constexpr double kResidual = 0.05;
  const Views same(angles(4.0), [&](std::size_t, int, int) { return kResidual; });
  const std::vector<std::uint16_t> before = cast_all(*plain(), light_slab_, 1 << 20);
  const std::vector<std::uint16_t> after = cast_all(*corrected(same), light_slab_, 1 << 20);
  const std::size_t of_slab = before.size() / 2;
  const auto attenuation = [&](const std::vector<std::uint16_t>& samples, std::size_t node) {
    return static_cast<double>(quantizer_.dequantize(samples[node])) +
           static_cast<double>(quantizer_.dequantize(samples[node + of_slab]));
  };
  int whole = 0;
  for (std::size_t node = 0; node < of_slab; ++node) {
    // A slab that holds nothing gets nothing, so its part would be missing.
    if (before[node] == 0 || before[node + of_slab] == 0) continue;
    ++whole;
    // Two levels are rounded anew.
    EXPECT_NEAR(attenuation(after, node) - attenuation(before, node),
                kResidual,
                2.0 * static_cast<double>(quantizer_.step()));
  }
  EXPECT_GT(whole, 3000);
}

TEST_F(CorrectedCaster, LeavesEmptyNodesEmptyAndNoSumBelowZero) {
  light_slab_.slabs.resize(1);
  light_slab_.slabs[0].y_low_mm = -kInfinity;
  const Views less(angles(4.0), [](std::size_t, int, int) { return -100.0; });
  const std::vector<std::uint16_t> before = cast_all(*plain(), light_slab_, 1 << 20);
  const std::vector<std::uint16_t> after = cast_all(*corrected(less), light_slab_, 1 << 20);
  // Interpolated attenuation reaches half a voxel beyond the voxels: rays that only graze it meet
  // no voxel, and keep what was cast.
  std::ptrdiff_t emptied = 0;
  std::ptrdiff_t grazing = 0;
  for (std::size_t node = 0; node < before.size(); ++node) {
    if (before[node] == 0) continue;
    ++(after[node] == 0 ? emptied : grazing);
    if (after[node] != 0) {
      EXPECT_EQ(after[node], before[node]);
    }
  }
  EXPECT_GT(emptied, 4000);
  EXPECT_LT(grazing, emptied / 5);
  const Views more(angles(4.0), [](std::size_t, int, int) { return 0.1; });
  const std::vector<std::uint16_t> raised = cast_all(*corrected(more), light_slab_, 1 << 20);
  for (std::size_t node = 0; node < before.size(); ++node)
    if (before[node] == 0) {
      EXPECT_EQ(raised[node], 0);
    }
}

TEST_F(CorrectedCaster, SamplesDoNotDependOnThePlan) {
  const Views views(angles(4.0), random_value);
  const std::unique_ptr<const FieldCaster> caster = corrected(views);
  std::vector<std::vector<std::uint16_t>> sorted;
  for (const std::int64_t rays_per_unit : {1, 300, 1 << 20}) {
    sorted.push_back(cast_all(*caster, light_slab_, rays_per_unit));
    std::sort(sorted.back().begin(), sorted.back().end());
  }
  EXPECT_EQ(sorted[0], sorted[1]);
  EXPECT_EQ(sorted[1], sorted[2]);
}

}  // namespace
}  // namespace af
