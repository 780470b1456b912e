// SPDX-License-Identifier: Apache-2.0
// Absurd poses and cameras, in every way of looking up and in ray casting.
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "drr/field_renderer.h"
#include "drr/field_set_drr.h"
#include "drr/ray_cast_drr.h"
#include "drr/slab_rays.h"
#include "drr/two_pass_af_drr.h"
#include "support/ct_phantoms.h"
#include "unit/drr/small_fields.h"

namespace af {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// A renderer and the field whose planes limit its rays; ray casting has none.
struct NamedRenderer {
  std::string name;
  std::shared_ptr<const DrrRenderer> renderer;
  std::shared_ptr<const CompressedAttenuationField> field;
};

/// Every way of looking up in the field and, where possible, in its decoded samples.
std::vector<NamedRenderer> look_ups(const std::shared_ptr<CompressedAttenuationField>& field) {
  std::vector<NamedRenderer> found;
  const auto decoded = std::make_shared<const FieldLevel>(decode_field(field));
  for (const std::string& look_up : field_look_up_names()) {
    found.push_back({look_up, make_field_renderer(field, look_up), field});
    if (look_up != "nearest" && look_up != "quadrilinear")
      found.push_back({look_up + " of samples", make_field_renderer(decoded, look_up), field});
  }
  return found;
}

std::vector<NamedRenderer> all_look_ups() {
  std::vector<NamedRenderer> found;
  for (const int slabs : {1, 3}) {
    const auto field = small_field(waves, slabs);
    for (const auto& each : {field, mean_removed(*field, 2)})
      for (NamedRenderer& renderer : look_ups(each)) found.push_back(std::move(renderer));
    const std::shared_ptr<const LightSlab> planes(field, &field->light_slab);
    const auto linear = make_field_renderer(field, "linear");
    found.push_back({"set",
                     std::make_shared<const FieldSetDrr>(
                         std::vector<FieldSetMember>{{planes, linear}, {planes, linear}}),
                     field});
  }
  return found;
}

NamedRenderer ray_casting() {
  CtGrid grid;
  grid.size = {24, 20, 22};
  grid.spacing_mm = {5, 6, 5};
  grid.origin_mm = {-57.5, -57, -52.5};
  const CtVolume ct =
      ellipsoid_phantom(grid, {{{0, 0, 0}, {50, 50, 45}, Eigen::Matrix3d::Identity(), 500}});
  return {
      "raycast",
      std::make_shared<const RayCastDrr>(
          std::make_shared<const AttenuationVolume>(ct, AttenuationModel{}), RayCasterOptions{2.0}),
      nullptr};
}

/// Renders with and without gradients. Values must be finite, and 0 where all rays are outside.
void expect_sound(const NamedRenderer& named, const RigidTransform& pose, const View& view) {
  const auto workspace = named.renderer->make_workspace();
  std::vector<float> values(view.pixel_count(), -1.0f);
  std::vector<float> planes(6 * values.size(), -1.0f);
  const std::int64_t outside = named.renderer->render(pose, view, *workspace, values).rays_outside;
  EXPECT_EQ(outside, named.renderer->rays_outside(pose, view)) << named.name;
  for (const float value : values) ASSERT_TRUE(std::isfinite(value)) << named.name;
  const bool has_any_inside = outside < static_cast<std::int64_t>(values.size());
  for (const float value : values) ASSERT_TRUE(has_any_inside || value == 0.0f) << named.name;
  const PoseGradients gradients{Eigen::Vector3d::Zero(), planes};
  EXPECT_EQ(named.renderer->render(pose, view, *workspace, values, gradients).rays_outside,
            outside);
  if (const auto* two_pass = dynamic_cast<const TwoPassAfDrr*>(named.renderer.get())) {
    const auto columns = std::span(planes).first(values.size());
    const auto rows = std::span(planes).last(values.size());
    EXPECT_EQ(two_pass->render_gradient_images(pose, view, *workspace, columns, rows).rays_outside,
              outside);
  }
}

/// Absurd numbers among plausible ones.
double odd_number(HashRandom& random) {
  constexpr std::array kOdd = {
      kNan, kInfinity, -kInfinity, 1e300, -1e300, 1e30, -1e12, 1e7, 1e-300, -1e-12, 0.0, 45.0};
  return kOdd[static_cast<std::size_t>(random.uniform() * kOdd.size())];
}

/// The small camera with one to three numbers replaced.
CameraGeometry odd_camera(HashRandom& random) {
  CameraGeometry camera = small_camera();
  const std::array<double*, 14> numbers = {&camera.source_point[0],
                                           &camera.source_point[1],
                                           &camera.source_point[2],
                                           &camera.detector_origin_point[0],
                                           &camera.detector_origin_point[1],
                                           &camera.detector_origin_point[2],
                                           &camera.column_direction[0],
                                           &camera.column_direction[1],
                                           &camera.column_direction[2],
                                           &camera.row_direction[0],
                                           &camera.row_direction[1],
                                           &camera.row_direction[2],
                                           &camera.pixel_spacing_mm[0],
                                           &camera.pixel_spacing_mm[1]};
  for (double left = random.uniform(); left < 1.0; left += 0.4)
    *numbers[static_cast<std::size_t>(random.uniform() * numbers.size())] = odd_number(random);
  return camera;
}

RigidTransform odd_pose(HashRandom& random) {
  RigidTransform pose = pose_from_parameters({}, small_pose(3));
  for (double left = random.uniform(); left < 1.0; left += 0.4)
    pose.matrix()(static_cast<int>(3 * random.uniform()), static_cast<int>(4 * random.uniform())) =
        odd_number(random);
  return pose;
}

TEST(OddRays, AreOutsideOrHaveAFiniteValueInEveryRenderer) {
  std::vector<NamedRenderer> renderers = all_look_ups();
  renderers.push_back(ray_casting());
  const RigidTransform usual_pose = pose_from_parameters({}, small_pose(5));
  for (int i = 0; i < 300; ++i) {
    HashRandom random(53, static_cast<std::uint64_t>(i));
    const bool has_odd_pose = i % 3 != 0;
    const RigidTransform pose = has_odd_pose ? odd_pose(random) : usual_pose;
    const View view =
        View::whole_detector(i % 3 != 1 ? odd_camera(random) : small_camera()).coarser(4);
    for (const NamedRenderer& renderer : renderers) {
      SCOPED_TRACE(i);
      expect_sound(renderer, pose, view);
      if (HasFatalFailure()) return;
    }
  }
}

/// The small camera with its source at a height of the slab frame, its detector left where it is.
CameraGeometry camera_at(const LightSlab& planes, double source_y_mm) {
  CameraGeometry camera = small_camera();
  const Eigen::Vector3d axis = planes.slab_from_ct.linear().row(1);
  const double now_mm = (planes.slab_from_ct * camera.source_point).y();
  camera.source_point += (source_y_mm - now_mm) * axis;
  return camera;
}

TEST(OddRays, OfASourceBehindOrWithinTheAttenuationAreOutside) {
  const RigidTransform pose = RigidTransform::Identity();
  for (NamedRenderer& named : all_look_ups()) {
    const LightSlab& planes = named.field->light_slab;
    std::vector<double> heights = {planes.attenuation_end_y_mm, 0.5, -1.0, -200.0};
    for (const SlabGeometry& slab : planes.slabs) heights.push_back(slab.st_plane_y_mm);
    for (const double y_mm : heights) {
      // A small region about the beam, whose lines all lie within the planes.
      const View view{camera_at(planes, y_mm), {14, 11, 3, 3}};
      EXPECT_EQ(named.renderer->rays_outside(pose, view), 9) << named.name << ' ' << y_mm;
      EXPECT_FALSE(SlabRays(planes, pose, view).all_cross());
      expect_sound(named, pose, view);
    }
    const View before{camera_at(planes, planes.attenuation_end_y_mm + 1.0), {14, 11, 3, 3}};
    EXPECT_EQ(named.renderer->rays_outside(pose, before), 0) << named.name;
  }
}

TEST(OddRays, OfAFieldThatDoesNotSayWhereAttenuationEndsBeginAboveItsPlanes) {
  const auto field = small_field(waves, 3);
  field->light_slab.attenuation_end_y_mm = kInfinity;
  const auto renderer = make_field_renderer(field, "linear");
  const double highest_mm = field->light_slab.slabs.back().st_plane_y_mm;
  const auto outside = [&](double y_mm) {
    return renderer->rays_outside(RigidTransform::Identity(),
                                  View{camera_at(field->light_slab, y_mm), {14, 11, 3, 3}});
  };
  EXPECT_EQ(outside(highest_mm), 9);
  EXPECT_EQ(outside(highest_mm + 20.0), 0);
}

TEST(OddRays, OfARayCasterFromASourceFarAwayMissTheVolume) {
  // A double's rounding at 1e15 mm is 0.1 mm; farther away it is more than the volume.
  const NamedRenderer cast = ray_casting();
  CameraGeometry camera = small_camera();
  camera.source_point *= 1e20;
  const Image2d drr =
      render_image(*cast.renderer, RigidTransform::Identity(), View::whole_detector(camera));
  for (const float value : drr.pixels) ASSERT_EQ(value, 0.0f);
}

}  // namespace
}  // namespace af
