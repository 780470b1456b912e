// SPDX-License-Identifier: Apache-2.0
// Derivatives of the ray caster against double-precision differences of what it computes, and
// against closed forms.
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/hash_random.h"
#include "base/vector_width.h"
#include "ct/ray_caster.h"
#include "support/ct_phantoms.h"
#include "support/cube_grid.h"

namespace af {
namespace {

using test::cube_grid;

/// Slopes by rotations per rad, then by translations per mm.
using SixSlopes = Eigen::Matrix<double, 6, 1>;

/// A ray by two of its points, and the part of it that counts, as in RayFan.
struct Ray {
  Eigen::Vector3d source;
  Eigen::Vector3d through;
  double begin = 0.0;
  double end = std::numeric_limits<double>::infinity();
};

const Eigen::Vector3d kPivot(7.0, -11.0, 5.0);
const Eigen::Matrix3d kAxes =
    Eigen::AngleAxisd(0.7, Eigen::Vector3d(3, -1, 2).normalized()).toRotationMatrix();

SixSlopes cast_slopes(const AttenuationVolume& volume, const Ray& ray, double step_mm) {
  const RayCaster caster(volume, {.step_mm = step_mm});
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  std::array<float, 1> value{};
  std::array<float, 6> slopes{};
  caster.cast_with_slopes({ray.source, ray.through, zero, zero, 1, 1, ray.begin, ray.end},
                          value,
                          {kPivot, kAxes, slopes});
  return Eigen::Map<const Eigen::Matrix<float, 6, 1>>(slopes.data()).cast<double>();
}

/// Central differences of a function of rays: the volume moves, so the ray moves the other way.
SixSlopes differences(const std::function<double(const Ray&)>& value, const Ray& ray, double step) {
  SixSlopes slopes;
  for (int k = 0; k < 6; ++k) {
    const auto moved = [&](double amount) {
      const Eigen::Vector3d axis = kAxes.col(k % 3);
      const Eigen::AngleAxisd turn(k < 3 ? -amount : 0.0, axis);
      const Eigen::Vector3d shift =
          k < 3 ? Eigen::Vector3d::Zero() : Eigen::Vector3d(-amount * axis);
      const auto move = [&](const Eigen::Vector3d& point) {
        return Eigen::Vector3d(kPivot + shift + turn * (point - kPivot));
      };
      return value({move(ray.source), move(ray.through), ray.begin, ray.end});
    };
    const double amount = k < 3 ? step / 100.0 : step;
    slopes[k] = (moved(amount) - moved(-amount)) / (2.0 * amount);
  }
  return slopes;
}

/// Sums over rays.
struct SlopeProducts {
  SixSlopes ab = SixSlopes::Zero();
  SixSlopes aa = SixSlopes::Zero();
  SixSlopes bb = SixSlopes::Zero();

  void add(const SixSlopes& a, const SixSlopes& b) {
    ab += a.cwiseProduct(b);
    aa += a.cwiseAbs2();
    bb += b.cwiseAbs2();
  }
  /// ||a - b|| / ||b||.
  [[nodiscard]] double relative_distance(int k) const {
    return std::sqrt((aa[k] - 2.0 * ab[k] + bb[k]) / bb[k]);
  }
  /// The factor by which b fits a best, by least squares.
  [[nodiscard]] double gain(int k) const { return ab[k] / bb[k]; }
};

/// The line integral of a volume's trilinear interpolant, in double precision.
class DoubleCaster {
 public:
  explicit DoubleCaster(const AttenuationVolume& volume) : volume_(volume) {}

  [[nodiscard]] double value(const Ray& ray) const {
    const auto [first, last] = path(ray);
    constexpr double kSamples = 4000.0;
    double sum = 0.0;
    for (double k = 0.5; k < kSamples; k += 1.0)
      sum += voxel_units(first + k / kSamples * (last - first));
    const double length_mm = (last - first).cwiseProduct(volume_.grid().spacing_mm).norm();
    return sum * length_mm / kSamples * volume_.model().mu_per_mm_per_unit();
  }

 private:
  /// Voxel indices of its two ends.
  [[nodiscard]] std::pair<Eigen::Vector3d, Eigen::Vector3d> path(const Ray& ray) const {
    const Eigen::Vector3d origin = volume_.grid().index_of(ray.source);
    const Eigen::Vector3d direction = volume_.grid().index_of(ray.through) - origin;
    double begin = ray.begin;
    double end = ray.end;
    for (int axis = 0; axis < 3; ++axis) {
      // The caster leaves out the outermost thousandth of the border.
      const double last = volume_.grid().size[static_cast<std::size_t>(axis)] - 1;
      const double a = (1e-3 - origin[axis]) / direction[axis];
      const double b = (last - 1e-3 - origin[axis]) / direction[axis];
      begin = std::max(begin, std::min(a, b));
      end = std::min(end, std::max(a, b));
    }
    return {origin + begin * direction, origin + end * direction};
  }
  [[nodiscard]] double voxel_units(const Eigen::Vector3d& index) const {
    double sum = 0.0;
    const auto& size = volume_.grid().size;
    for (int corner = 0; corner < 8; ++corner) {
      double weight = 1.0;
      std::array<int, 3> voxel{};
      for (int axis = 0; axis < 3; ++axis) {
        const double below = std::floor(index[axis]);
        const int upper = corner >> axis & 1;
        voxel[static_cast<std::size_t>(axis)] = static_cast<int>(below) + upper;
        weight *= upper == 1 ? index[axis] - below : 1.0 - (index[axis] - below);
      }
      const int offset = (voxel[2] * size[1] + voxel[1]) * size[0] + voxel[0];
      sum += weight * volume_.voxels()[static_cast<std::size_t>(offset)];
    }
    return sum;
  }

  const AttenuationVolume& volume_;
};

enum class Handedness { Right, Left };

/// Noise, up to the edges of the CT: the border's single voxel is a cliff.
CtVolume noise(Handedness handedness) {
  CtGrid grid;
  grid.size = {23, 19, 31};
  grid.spacing_mm = {1.6, 2.3, 0.7};
  grid.origin_mm = {-17.0, -21.0, -10.0};
  grid.direction =
      Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, -1, 2).normalized()).toRotationMatrix();
  if (handedness == Handedness::Left) grid.direction.col(1) *= -1.0;
  grid.origin_mm -= grid.center_mm();
  std::vector<std::int16_t> hu(grid.voxel_count());
  for (std::size_t i = 0; i < hu.size(); ++i)
    hu[i] = static_cast<std::int16_t>(hash64(3, i) % 3000 - 1000);
  return {grid, SharedArray<std::int16_t>(hu)};
}

TEST(RayCasterSlopes, ConvergeToThoseOfTheLineIntegral) {
  for (const Handedness handedness : {Handedness::Right, Handedness::Left}) {
    const AttenuationVolume volume(noise(handedness), {});
    const DoubleCaster reference(volume);
    HashRandom random(5);
    const auto within = [&](double reach) {
      return Eigen::Vector3d(random.uniform(-reach, reach),
                             random.uniform(-reach, reach),
                             random.uniform(-reach, reach));
    };
    for (int i = 0; i < 40; ++i) {
      Ray ray{100.0 * within(1.0).normalized(), within(6.0)};
      if (i % 4 == 1) ray.source = within(4.0);  // inside the volume
      if (i % 4 == 2) ray = {ray.source, ray.through, 0.97, 1.05};
      const SixSlopes expected =
          differences([&](const Ray& moved) { return reference.value(moved); }, ray, 1e-5);
      // Slopes jump by their own size between cells of 0.7 mm: samples 0.01 mm apart err by about
      // 1 %.
      const SixSlopes found = cast_slopes(volume, ray, 0.01);
      EXPECT_LT((found - expected).head<3>().norm(), 0.02 * expected.head<3>().norm() + 0.01)
          << "ray " << i << ":\n"
          << expected.transpose() << '\n'
          << found.transpose();
      EXPECT_LT((found - expected).tail<3>().norm(), 0.02 * expected.tail<3>().norm() + 1e-3)
          << "ray " << i << ":\n"
          << expected.transpose() << '\n'
          << found.transpose();
    }
  }
}

TEST(RayCasterSlopes, OfASmoothBallAreThoseOfItsClosedForm) {
  constexpr int kSide = 64;
  constexpr double kSpacingMm = 1.0;
  constexpr double kWidthMm = 7.0;
  constexpr double kHeight = 30000.0;
  CtVolume ct{cube_grid(kSide, kSpacingMm), {}};
  std::vector<std::int16_t> hu;
  for (int k = 0; k < kSide; ++k)
    for (int j = 0; j < kSide; ++j)
      for (int i = 0; i < kSide; ++i) {
        const double r = ct.grid.point_mm(Eigen::Vector3d(i, j, k)).norm() / kWidthMm;
        hu.push_back(
            static_cast<std::int16_t>(std::lround(kHeight * std::exp(-0.5 * r * r)) - 1000));
      }
  ct.hu = SharedArray<std::int16_t>(std::move(hu));
  const AttenuationVolume volume(ct, {0.02, -1000});
  // Trilinear interpolation widens the ball.
  const double width_squared = kWidthMm * kWidthMm + kSpacingMm * kSpacingMm / 6.0;
  const double peak = kHeight * volume.model().mu_per_mm_per_unit() * std::pow(kWidthMm, 3) /
                      width_squared * std::sqrt(2.0 * std::numbers::pi);
  const auto closed_form = [&](const Ray& ray) {
    const Eigen::Vector3d direction = (ray.through - ray.source).normalized();
    return peak * std::exp(-0.5 * ray.source.cross(direction).squaredNorm() / width_squared);
  };
  HashRandom random(6);
  SlopeProducts products;
  for (int i = 0; i < 400; ++i) {
    const Ray ray{
        300.0 * Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized(),
        {random.uniform(-9, 9), random.uniform(-9, 9), random.uniform(-9, 9)}};
    products.add(cast_slopes(volume, ray, 1.0), differences(closed_form, ray, 1e-4));
  }
  // Between voxels the slope is constant: it errs by up to spacing / (2 width) = 7 %, which a ray
  // through many cells averages.
  for (int k = 0; k < 6; ++k) {
    EXPECT_LT(products.relative_distance(k), 0.03) << "parameter " << k;
    EXPECT_NEAR(products.gain(k), 1.0, 0.005) << "parameter " << k;
  }
}

TEST(RayCasterSlopes, OfAnEllipsoidAreThoseOfItsChords) {
  Ellipsoid body;
  body.semi_axes_mm = {30.0, 20.0, 25.0};
  body.rotation = Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  body.hu = 300;
  const AttenuationVolume volume(ellipsoid_phantom(cube_grid(72, 1.0), {body}, 4), {});
  const auto closed_form = [&](const Ray& ray) {
    return 0.026 * body.chord_length_mm(ray.source, ray.through);
  };
  HashRandom random(7);
  SlopeProducts products;
  for (int i = 0; i < 1000; ++i) {
    const Ray ray{
        400.0 * Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized(),
        {random.uniform(-15, 15), random.uniform(-15, 15), random.uniform(-15, 15)}};
    if (closed_form(ray) < 20.0 * 0.026) continue;
    products.add(cast_slopes(volume, ray, 0.1), differences(closed_form, ray, 1e-4));
  }
  // Where a ray crosses a surface of voxels, two cells decide the surface's tilt. It is tens of
  // percent off, but without bias.
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(products.gain(k), 1.0, 0.05) << "parameter " << k;
}

/// A body that the edges of the CT cut, voxels of 0.5 mm: attenuation falls to 0 within half a
/// step.
CtVolume cut_body() {
  return box_phantom(cube_grid(80, 0.5), {0, 0, 0}, {79, 79, 79}, 0);
}

TEST(RayCasterSlopes, OfABodyCutByTheEdgeOfTheCtAreThoseOfItsChords) {
  const AttenuationVolume volume(cut_body(), {});
  // The cube's faces lie half-way between its last voxels and the border.
  const auto chord = [](const Ray& ray) {
    const Eigen::Vector3d direction = (ray.through - ray.source).normalized();
    double begin = 0.0;
    double end = 1e9;
    for (int axis = 0; axis < 3; ++axis) {
      const double a = (-20.0 - ray.source[axis]) / direction[axis];
      const double b = (20.0 - ray.source[axis]) / direction[axis];
      begin = std::max(begin, std::min(a, b));
      end = std::min(end, std::max(a, b));
    }
    return 0.02 * (end - begin);
  };
  // Through opposite faces, through neighbouring ones, and steeply along.
  for (const Ray& ray : {Ray{{-300, 60, -40}, {0, 3, 2}},
                         Ray{{-200, -190, 20}, {-12, 6, 1}},
                         Ray{{150, -260, 90}, {14, 9, 3}},
                         Ray{{30, 400, -120}, {-2, 1, -4}}}) {
    const SixSlopes expected = differences(chord, ray, 1e-5);
    // The first and last samples stand for the whole cliff: 0.5 of 1 mm steps.
    const SixSlopes found = cast_slopes(volume, ray, 1.0);
    EXPECT_LT((found - expected).norm(), 0.05 * expected.norm()) << found.transpose() << "\n"
                                                                 << expected.transpose();
  }
}

TEST(RayCasterSlopes, AreFiniteAlongTheFacesOfTheVolume) {
  const AttenuationVolume volume(cut_body(), {});
  // The ray enters through the face that it runs along. That face lies half a voxel outside the
  // cube's; the ray runs a thousandth of a voxel inside it.
  constexpr double kFaceMm = -20.2495;
  for (const double tilt : {0.0, 1e-300, 1e-12, 1e-5, 1e-2}) {
    const SixSlopes found = cast_slopes(
        volume, {{-300.0, kFaceMm - 300.0 * tilt, 1.0}, {300.0, kFaceMm + 300.0 * tilt, 1.0}}, 1.0);
    EXPECT_TRUE(found.allFinite()) << tilt;
    // Less than 41 mm in 0.02 per mm that falls to 0 within 0.5 mm.
    EXPECT_LT(found.tail<3>().cwiseAbs().maxCoeff(), 2.0) << tilt;
  }
}

/// Values, then six planes, of a fan of 37 x 31 rays.
std::vector<float> fan_of_bodies(const AttenuationVolume& volume, ThreadPool* pool = nullptr) {
  constexpr std::size_t kRays = 37 * 31;
  std::vector<float> all(7 * kRays);
  RayCaster(volume, {})
      .cast_with_slopes({{10, -500, 20}, {-30, 100, -30}, {1.7, 0.01, 0}, {0, 0, 1.9}, 37, 31},
                        std::span(all).first(kRays),
                        {kPivot, kAxes, std::span(all).subspan(kRays)},
                        pool);
  return all;
}

TEST(RayCasterSlopes, EveryVectorWidthAndNumberOfThreadsGivesTheSameBits) {
  const AttenuationVolume volume(noise(Handedness::Right), {});
  std::vector<float> values(37 * 31);
  RayCaster(volume, {})
      .cast({{10, -500, 20}, {-30, 100, -30}, {1.7, 0.01, 0}, {0, 0, 1.9}, 37, 31}, values);
  const std::vector<float> expected = fan_of_bodies(volume);
  EXPECT_TRUE(std::equal(values.begin(), values.end(), expected.begin()));
  EXPECT_GT(std::count_if(expected.begin(), expected.end(), [](float x) { return x != 0.0f; }),
            1000);
  EXPECT_EQ(std::count(expected.begin(), expected.end(), 0.0f) % 7, 0) << "rays that miss";
  for (const VectorWidth width : supported_vector_widths()) {
    force_vector_width(width);
    EXPECT_EQ(fan_of_bodies(volume), expected) << to_string(width) << " bits";
  }
  force_vector_width(std::nullopt);
  for (const int threads : {2, 5}) {
    ThreadPool pool(threads);
    EXPECT_EQ(fan_of_bodies(volume, &pool), expected) << threads << " threads";
  }
}

}  // namespace
}  // namespace af
