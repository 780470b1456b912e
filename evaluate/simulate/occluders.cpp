// SPDX-License-Identifier: Apache-2.0
#include "evaluate/simulate/occluders.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/hash_random.h"

namespace af {

namespace {

constexpr int kMostDraws = 1000;
constexpr double kLeastRodOffset = 0.2;    // share of the reach
constexpr double kLargestRodOffset = 0.6;  // share of the reach
constexpr double kBallReach = 0.8;         // share of the reach
constexpr double kLeastPinDistanceMm = 8.0;

Eigen::Vector3d draw_direction(HashRandom& random) {
  const double x = random.normal();
  const double y = random.normal();
  const double z = random.normal();
  return Eigen::Vector3d(x, y, z).normalized();
}

Eigen::Vector3d draw_within_ball(HashRandom& random, double radius_mm) {
  const Eigen::Vector3d direction = draw_direction(random);
  return radius_mm * std::cbrt(random.uniform()) * direction;
}

bool crosses_beams(const Eigen::Vector3d& axis_direction, const OccluderSite& site) {
  const double largest_cosine = std::cos(30.0 * kRadPerDeg);
  return std::all_of(site.beam_directions_ct.begin(),
                     site.beam_directions_ct.end(),
                     [&](const Eigen::Vector3d& beam) {
                       return std::abs(beam.dot(axis_direction)) <= largest_cosine;
                     });
}

SteelCylinder draw_rod(const OccluderSite& site,
                       const OccluderOptions& options,
                       HashRandom random) {
  SteelCylinder rod;
  rod.radius_mm = 0.5 * options.rod_diameter_mm;
  rod.length_mm = options.rod_length_mm;
  rod.axis_direction = draw_direction(random);
  for (int draw = 1; draw < kMostDraws && !crosses_beams(rod.axis_direction, site); ++draw)
    rod.axis_direction = draw_direction(random);
  const Eigen::Vector3d aside = rod.axis_direction.cross(draw_direction(random)).normalized();
  const double offset_mm = site.reach_mm * random.uniform(kLeastRodOffset, kLargestRodOffset);
  rod.center_point = site.center_ct_mm + offset_mm * aside;
  return rod;
}

bool is_free(const Eigen::Vector3d& point,
             const std::vector<SteelBall>& placed,
             const std::vector<SteelCylinder>& pins,
             double least_distance_mm) {
  return std::all_of(placed.begin(),
                     placed.end(),
                     [&](const SteelBall& ball) {
                       return (ball.center_point - point).norm() >= least_distance_mm;
                     }) &&
         std::all_of(pins.begin(), pins.end(), [&](const SteelCylinder& pin) {
           return (pin.center_point - point).norm() >= kLeastPinDistanceMm;
         });
}

}  // namespace

double SteelBall::chord_length_mm(const Eigen::Vector3d& source_point,
                                  const Eigen::Vector3d& through_point) const {
  const Eigen::Vector3d direction = (through_point - source_point).normalized();
  const Eigen::Vector3d to_center = center_point - source_point;
  const double along = to_center.dot(direction);
  const double half_squared = radius_mm * radius_mm - (to_center - along * direction).squaredNorm();
  return along > 0.0 && half_squared > 0.0 ? 2.0 * std::sqrt(half_squared) : 0.0;
}

double SteelBodies::chord_length_mm(const Eigen::Vector3d& source_point,
                                    const Eigen::Vector3d& through_point) const {
  double sum_mm = 0.0;
  for (const SteelCylinder& cylinder : cylinders)
    sum_mm += cylinder.chord_length_mm(source_point, through_point);
  for (const SteelBall& ball : balls) sum_mm += ball.chord_length_mm(source_point, through_point);
  return sum_mm;
}

OccluderSite occluder_site(const std::vector<View>& views,
                           const RigidTransform& room_from_ct,
                           const Eigen::Vector3d& center_ct_mm) {
  check(!views.empty(), "occluder_site() needs a view");
  OccluderSite site;
  site.center_ct_mm = center_ct_mm;
  site.reach_mm = std::numeric_limits<double>::infinity();
  const Eigen::Vector3d center_room_mm = room_from_ct * center_ct_mm;
  for (const View& view : views) {
    const CameraGeometry& camera = view.camera;
    const double mm_per_detector_mm =
        camera.depth_mm(center_room_mm) / camera.source_detector_distance_mm();
    const double side_mm = std::min(view.roi.width * camera.pixel_spacing_mm.x(),
                                    view.roi.height * camera.pixel_spacing_mm.y());
    site.reach_mm = std::min(site.reach_mm, 0.5 * side_mm * mm_per_detector_mm);
    site.beam_directions_ct.emplace_back(room_from_ct.linear().transpose() *
                                         (center_room_mm - camera.source_point).normalized());
  }
  return site;
}

std::vector<SteelCylinder> place_rods(const OccluderSite& site,
                                      const OccluderOptions& options,
                                      std::uint64_t seed,
                                      std::uint64_t key) {
  std::vector<SteelCylinder> rods(static_cast<std::size_t>(options.rod_count));
  for (std::size_t i = 0; i < rods.size(); ++i)
    rods[i] = draw_rod(site, options, HashRandom(seed, key, i));
  return rods;
}

std::vector<SteelBall> place_balls(const OccluderSite& site,
                                   const std::vector<SteelCylinder>& pins,
                                   const OccluderOptions& options,
                                   std::uint64_t seed,
                                   std::uint64_t key) {
  std::vector<SteelBall> balls;
  for (int i = 0; i < options.ball_count; ++i) {
    HashRandom random(seed, key, static_cast<std::uint64_t>(i));
    const auto draw_point = [&] {
      return Eigen::Vector3d(site.center_ct_mm +
                             draw_within_ball(random, kBallReach * site.reach_mm));
    };
    SteelBall ball{draw_point(), 0.5 * options.ball_diameter_mm};
    for (int draw = 1; draw < kMostDraws &&
                       !is_free(ball.center_point, balls, pins, 3.0 * options.ball_diameter_mm);
         ++draw)
      ball.center_point = draw_point();
    balls.push_back(ball);
  }
  return balls;
}

}  // namespace af
