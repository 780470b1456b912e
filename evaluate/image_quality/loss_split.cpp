// SPDX-License-Identifier: Apache-2.0
#include "evaluate/image_quality/loss_split.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace af::evaluation {
namespace {

/// Mean of (a - b)^2 over the reference's foreground, divided by its squared maximum.
double mean_square(const std::vector<float>& a,
                   const std::vector<float>& b,
                   const std::vector<float>& reference) {
  double sum = 0.0;
  double maximum = 0.0;
  std::size_t foreground = 0;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    if (reference[i] == 0.0f) continue;
    const double difference = static_cast<double>(a[i]) - static_cast<double>(b[i]);
    sum += difference * difference;
    maximum = std::max(maximum, static_cast<double>(reference[i]));
    ++foreground;
  }
  if (foreground == 0) return std::numeric_limits<double>::quiet_NaN();
  return sum / static_cast<double>(foreground) / (maximum * maximum);
}

}  // namespace

std::array<double, LossSplit::kParts> LossSplit::psnr_db() const {
  std::array<double, kParts> result{};
  for (std::size_t i = 0; i < kParts; ++i) result[i] = -10.0 * std::log10(mean_square[i]);
  return result;
}

LossSplitter::LossSplitter(const DrrRenderer& field,
                           const DrrRenderer& reference,
                           const InterpolatedRayCast& interpolated,
                           const View& view)
    : field_(field),
      reference_(reference),
      uv_(interpolated.on(InterpolatedPlanes::Uv)),
      st_(interpolated.on(InterpolatedPlanes::St)),
      both_(interpolated.on(InterpolatedPlanes::Both)),
      view_(view) {}

std::vector<float> LossSplitter::rendered(const DrrRenderer& renderer,
                                          const RigidTransform& room_from_ct,
                                          bool& is_inside) const {
  std::vector<float> pixels(view_.pixel_count());
  const auto workspace = renderer.make_workspace();
  const RenderStatus status = renderer.render(room_from_ct, view_, *workspace, pixels);
  is_inside = is_inside && status.is_inside();
  return pixels;
}

LossSplit LossSplitter::at_pose(const RigidTransform& room_from_ct) const {
  bool is_inside = true;
  const std::vector<float> reference = rendered(reference_, room_from_ct, is_inside);
  const std::vector<float> field = rendered(field_, room_from_ct, is_inside);
  const std::vector<float> uv = rendered(uv_, room_from_ct, is_inside);
  const std::vector<float> st = rendered(st_, room_from_ct, is_inside);
  const std::vector<float> both = rendered(both_, room_from_ct, is_inside);
  LossSplit split;
  split.mean_square.fill(std::numeric_limits<double>::quiet_NaN());
  if (!is_inside) return split;
  split.mean_square = {mean_square(uv, reference, reference),
                       mean_square(st, reference, reference),
                       mean_square(both, reference, reference),
                       mean_square(field, both, reference),
                       mean_square(field, reference, reference)};
  return split;
}

}  // namespace af::evaluation
