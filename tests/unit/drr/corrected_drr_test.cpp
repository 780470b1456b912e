// SPDX-License-Identifier: Apache-2.0
#include "drr/corrected_drr.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "unit/drr/small_fields.h"

namespace af {
namespace {

/// A renderer in closed form: pixel i is sin(w x_i) of a point x_i of the CT in the room.
class WaveDrr final : public DrrRenderer {
 public:
  explicit WaveDrr(const Eigen::Vector3d& per_mm, bool is_inside = true)
      : per_mm_(per_mm), is_inside_(is_inside) {}

  static Eigen::Vector3d point_ct(std::size_t pixel) {
    const auto i = static_cast<double>(pixel);
    return {std::fmod(7.0 * i, 61.0) - 30.0, std::fmod(11.0 * i, 53.0) - 26.0, 0.1 * i - 40.0};
  }

  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& view,
                      RenderWorkspace& /*workspace*/,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& gradients) const override {
    const std::size_t pixels = view.pixel_count();
    for (std::size_t i = 0; i < pixels; ++i) {
      const Eigen::Vector3d x = room_from_ct * point_ct(i);
      total_attenuation[i] = static_cast<float>(std::sin(per_mm_.dot(x)));
      if (!gradients) continue;
      const Eigen::Vector3d by_translation = std::cos(per_mm_.dot(x)) * per_mm_;
      const Eigen::Vector3d by_rotation = (x - gradients->pivot_room_point).cross(by_translation);
      for (std::size_t k = 0; k < 3; ++k) {
        const auto axis = static_cast<Eigen::Index>(k);
        gradients->planes[k * pixels + i] = static_cast<float>(by_rotation[axis]);
        gradients->planes[(3 + k) * pixels + i] = static_cast<float>(by_translation[axis]);
      }
    }
    return {is_inside_ ? 0 : 1};
  }
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override {
    return std::make_unique<RenderWorkspace>();
  }
  [[nodiscard]] const char* name() const override { return "wave"; }

 private:
  Eigen::Vector3d per_mm_;
  bool is_inside_;
};

const Eigen::Vector3d kReferenceWave(0.011, -0.013, 0.017);
const Eigen::Vector3d kOtherWave(0.015, -0.009, 0.012);
const Eigen::Vector3d kPivot(10.0, -20.0, 30.0);

View whole_view() {
  return View::whole_detector(small_camera());
}

RigidTransform some_pose() {
  return pose_from_parameters({}, PoseParameters::from_deg_and_mm({2, -1, 3, 4, -5, 6}));
}

/// `pose`, moved about the pivot by a share of a degree and of a few millimetres.
RigidTransform moved(const RigidTransform& pose, double share) {
  const PoseFrame about_pivot{Eigen::Matrix3d::Identity(), kPivot, kPivot};
  return pose_from_parameters(about_pivot,
                              PoseParameters::from_deg_and_mm(
                                  {share, -0.5 * share, 0.7 * share, share, 2 * share, -share})) *
         pose;
}

CorrectedDrr corrected(DefectSlopes slopes) {
  const auto other = std::make_shared<const WaveDrr>(kOtherWave);
  return {other,
          drr_defect(WaveDrr(kReferenceWave), *other, some_pose(), whole_view(), kPivot, slopes)
              .value()};
}

double largest_difference(const std::vector<float>& a, const std::vector<float>& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i)
    largest = std::max(largest, std::abs(static_cast<double>(a[i]) - static_cast<double>(b[i])));
  return largest;
}

double error_at(const DrrRenderer& renderer, const RigidTransform& pose) {
  return largest_difference(render_image(renderer, pose, whole_view()).pixels,
                            render_image(WaveDrr(kReferenceWave), pose, whole_view()).pixels);
}

/// Values are at most 1, and three are added.
constexpr double kEpsilon = std::numeric_limits<float>::epsilon();
constexpr double kValueRounding = 4 * kEpsilon;

TEST(CorrectedDrr, IsTheReferenceWhereTheDefectWasTaken) {
  for (const DefectSlopes slopes : {DefectSlopes::LeftOut, DefectSlopes::Taken})
    EXPECT_LT(error_at(corrected(slopes), some_pose()), kValueRounding);
  EXPECT_GT(error_at(WaveDrr(kOtherWave), some_pose()), 0.1);
}

TEST(CorrectedDrr, HasTheReferencesDerivativesAboutAnyPivot) {
  const View view = whole_view();
  const std::size_t pixels = view.pixel_count();
  std::vector<float> values(pixels);
  std::vector<float> found(6 * pixels);
  std::vector<float> expected(6 * pixels);
  const CorrectedDrr renderer = corrected(DefectSlopes::Taken);
  const auto workspace = renderer.make_workspace();
  const Eigen::Vector3d other_pivot(-15.0, 5.0, 25.0);
  renderer.render(some_pose(), view, *workspace, values, PoseGradients{other_pivot, found});
  WaveDrr(kReferenceWave)
      .render(some_pose(), view, *workspace, values, PoseGradients{other_pivot, expected});
  // Derivatives are at most |w| (|x| + |p|) < 0.025 * 150; up to six such terms are added.
  constexpr double kRounding = 24 * kEpsilon;
  EXPECT_LT(largest_difference(found, expected), kRounding);
}

TEST(CorrectedDrr, WithSlopesIsTheReferenceToFirstOrder) {
  const CorrectedDrr renderer = corrected(DefectSlopes::Taken);
  const double far = error_at(renderer, moved(some_pose(), 0.8));
  const double near = error_at(renderer, moved(some_pose(), 0.4));
  EXPECT_GT(near, 100 * kValueRounding);
  // Half as far, a quarter of the error; terms of third order are a few percent here.
  EXPECT_NEAR(far / near, 4.0, 0.4);
  EXPECT_GT(error_at(corrected(DefectSlopes::LeftOut), moved(some_pose(), 0.4)), 5 * near);
}

TEST(CorrectedDrr, AddsNothingWhereRaysAreOutside) {
  const WaveDrr reference(kReferenceWave);
  const auto outside = std::make_shared<const WaveDrr>(kOtherWave, false);
  EXPECT_FALSE(
      drr_defect(reference, *outside, some_pose(), whole_view(), kPivot, DefectSlopes::Taken)
          .has_value());
  DrrDefect ones{some_pose(), std::vector<float>(whole_view().pixel_count(), 1.0f), kPivot, {}};
  std::int64_t rays_outside = 0;
  EXPECT_EQ(
      render_image(CorrectedDrr(outside, ones), some_pose(), whole_view(), &rays_outside).pixels,
      render_image(*outside, some_pose(), whole_view()).pixels);
  EXPECT_EQ(rays_outside, 1);
}

}  // namespace
}  // namespace af
