// SPDX-License-Identifier: Apache-2.0
#include "drr/kept_images.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "base/vector_width.h"
#include "drr/two_pass_af_drr.h"
#include "unit/drr/small_fields.h"

namespace af {
namespace {

constexpr TwoPassOptions kCubicInSt{.st = AxisInterpolation::Cubic};
constexpr TwoPassOptions kCubicSum{.sums_on_more_nodes = true};

struct Drr {
  std::vector<float> values, planes;

  bool operator==(const Drr&) const = default;
};

/// A DRR of a small field, with or without gradients.
Drr rendered(const TwoPassAfDrr& renderer,
             const RigidTransform& pose,
             RenderWorkspace& workspace,
             bool has_gradients) {
  const View view = View::whole_detector(small_camera());
  Drr drr{std::vector<float>(view.pixel_count()), {}};
  std::optional<PoseGradients> gradients;
  if (has_gradients) {
    drr.planes.resize(6 * view.pixel_count());
    gradients = PoseGradients{Eigen::Vector3d(10.0, -20.0, 30.0), drr.planes};
  }
  renderer.render(pose, view, workspace, drr.values, gradients);
  return drr;
}

/// One of the small fields' poses, moved by `share` of a small motion along all six parameters.
RigidTransform beside(double share) {
  PoseParameters parameters = small_pose(8);
  parameters.rotation_rad += share * Eigen::Vector3d(0.002, -0.0015, 0.001);
  parameters.translation_mm += share * Eigen::Vector3d(0.5, 0.8, -0.4);
  return pose_from_parameters({}, parameters);
}

double distance(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i)
    sum += std::pow(static_cast<double>(a[i]) - static_cast<double>(b[i]), 2);
  return std::sqrt(sum);
}

double length(const std::vector<float>& values) {
  return distance(values, std::vector<float>(values.size()));
}

TEST(KeptImages, AreNearTheLookUpWhileTheSourceIsNear) {
  for (const TwoPassOptions& options : {TwoPassOptions{}, kCubicSum, kCubicInSt})
    for (const bool has_gradients : {false, true}) {
      const TwoPassAfDrr renderer(small_field(waves, 2, 7, 51), options);
      const auto exact = renderer.make_workspace();
      const Drr at_first = rendered(renderer, beside(0.0), *exact, true);
      // The error is of second order: half the way leaves a quarter of it. Rounding and the kinks
      // of the nodes' interpolation raise that, but not to a third.
      std::array<double, 2> errors{};
      for (std::size_t i = 0; i < errors.size(); ++i) {
        const RigidTransform pose = beside(i == 0 ? 1.0 : 0.5);
        const auto workspace = renderer.make_workspace();
        workspace->reuse_images(true);
        // A larger image counts its nodes from another origin, so it rounds differently.
        const Drr first = rendered(renderer, beside(0.0), *workspace, true);
        EXPECT_LT(distance(first.values, at_first.values), 1e-5 * length(at_first.values));
        EXPECT_LT(distance(first.planes, at_first.planes), 1e-4 * length(at_first.planes));
        const Drr there = rendered(renderer, pose, *exact, has_gradients);
        const Drr reused = rendered(renderer, pose, *workspace, has_gradients);
        errors[i] = distance(reused.values, there.values);
        EXPECT_GT(errors[i], 0.0) << "made anew";
        EXPECT_LT(errors[i], 0.02 * distance(at_first.values, there.values));
        if (has_gradients) {
          EXPECT_LT(distance(reused.planes, there.planes), 0.02 * length(there.planes));
        }
      }
      EXPECT_LT(errors[1], errors[0] / 3.0);
    }
}

TEST(KeptImages, DoNotServeFarPosesNorAfterTheyAreForgotten) {
  const TwoPassAfDrr renderer(small_field(waves, 2, 7, 51), kCubicInSt);
  const auto exact = renderer.make_workspace();
  const auto workspace = renderer.make_workspace();
  const auto begin = [&] {
    workspace->reuse_images(true);
    rendered(renderer, beside(0.0), *workspace, true);
  };
  begin();
  const RigidTransform far = beside(20.0);
  EXPECT_EQ(rendered(renderer, far, *workspace, false), rendered(renderer, far, *exact, false));
  // The far DRR had no gradients, so nothing of it is kept. Its images overwrote those kept before.
  const RigidTransform near = beside(1.0);
  const Drr there = rendered(renderer, near, *exact, false);
  EXPECT_EQ(rendered(renderer, near, *workspace, false), there);
  begin();
  EXPECT_NE(rendered(renderer, near, *workspace, false), there);
  workspace->reuse_images(false);
  EXPECT_EQ(rendered(renderer, near, *workspace, false), there);
  begin();
  std::vector<float> columns(there.values.size());
  std::vector<float> rows(there.values.size());
  renderer.render_gradient_images(
      near, View::whole_detector(small_camera()), *workspace, columns, rows);
  EXPECT_EQ(rendered(renderer, near, *workspace, false), there);
}

/// By how many nodes, at most, a slab shifts against the plane of the slabs' sum when the source
/// moves from one pose's place to another's. That plane lies midway between the outermost slabs.
double parallax_nodes(const LightSlab& field,
                      const RigidTransform& from,
                      const RigidTransform& to) {
  const View view = View::whole_detector(small_camera());
  const Eigen::Vector3d source = SlabRays(field, from, view).source;
  const double way_mm = (SlabRays(field, to, view).source - source).norm();
  const double sum_y_mm =
      0.5 * (field.slabs.front().st_plane_y_mm + field.slabs.back().st_plane_y_mm);
  double nodes = 0.0;
  for (const SlabGeometry& slab : field.slabs)
    nodes = std::max(nodes,
                     way_mm * std::abs((slab.st_plane_y_mm - sum_y_mm) / (source.y() - sum_y_mm)) /
                         std::min(slab.s.spacing_mm(), slab.t.spacing_mm()));
  return nodes;
}

TEST(KeptImages, ServeNoPoseThatShiftsASlabByMoreThanAnEighthOfANode) {
  const auto field = small_field(waves, 2, 3, 61);
  const TwoPassAfDrr renderer(field, kCubicSum);
  const auto exact = renderer.make_workspace();
  const auto is_reused = [&](const RigidTransform& pose) {
    const auto workspace = renderer.make_workspace();
    workspace->reuse_images(true);
    rendered(renderer, RigidTransform::Identity(), *workspace, true);
    return rendered(renderer, pose, *workspace, false) != rendered(renderer, pose, *exact, false);
  };
  // A turn about the middle of the plane hardly moves corners on it.
  const auto turned = [](double degrees) {
    PoseParameters parameters;
    parameters.rotation_rad = {0.0, 0.0, degrees * kRadPerDeg};
    return pose_from_parameters({}, parameters);
  };
  double degrees = 0.05;
  while (degrees < 8.0 && is_reused(turned(degrees))) degrees += 0.05;
  const auto nodes = [&](double of_degrees) {
    return parallax_nodes(field->light_slab, RigidTransform::Identity(), turned(of_degrees));
  };
  EXPECT_LE(nodes(degrees - 0.05), 0.125);
  EXPECT_GT(nodes(degrees), 0.125);
}

TEST(KeptImages, GiveTheSameBitsByEveryVectorWidth) {
  const TwoPassAfDrr renderer(small_field(waves, 2, 7, 51), kCubicInSt);
  std::vector<Drr> found;
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    const auto workspace = renderer.make_workspace();
    workspace->reuse_images(true);
    rendered(renderer, beside(0.0), *workspace, true);
    for (const bool has_gradients : {false, true})
      found.push_back(rendered(renderer, beside(1.0), *workspace, has_gradients));
  }
  force_vector_width(std::nullopt);
  for (std::size_t i = 2; i < found.size(); ++i) EXPECT_EQ(found[i], found[i % 2]);
  // Values do not depend on whether gradients come with them.
  EXPECT_EQ(found[0].values, found[1].values);
}

}  // namespace
}  // namespace af
