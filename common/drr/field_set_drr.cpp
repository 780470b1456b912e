// SPDX-License-Identifier: Apache-2.0
#include "drr/field_set_drr.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "base/error.h"
#include "drr/slab_rays.h"

namespace af {

namespace {

/// In units of how_well_held(). Members that hold a pose less well than the best by this much are
/// not looked up. The seam is narrow enough that few poses need two look-ups, and wide enough that
/// an optimiser's steps see a smooth change.
constexpr double kSeam = 0.4;

/// How well a field holds a view's rays: the sum over its axes of the logarithm of how far they
/// keep from the edges. It falls without bound where rays leave a plane. An axis along which two
/// fields hold the rays alike does not favour either. None where a ray is outside.
std::optional<double> how_well_held(const SlabRays& rays) {
  double sum = 0.0;
  for (const double share : rays.shares_to_edges()) {
    if (!(share > 0.0)) return std::nullopt;
    sum += std::log(share);
  }
  return sum;
}

class SetWorkspace final : public RenderWorkspace {
 public:
  std::vector<std::unique_ptr<RenderWorkspace>> members;
  std::vector<float> values;
  std::vector<float> planes;
};

}  // namespace

FieldSetDrr::FieldSetDrr(std::vector<FieldSetMember> members) : members_(std::move(members)) {
  check(!members_.empty(), "a set of fields has at least one");
}

std::vector<double> FieldSetDrr::weights(const RigidTransform& room_from_ct,
                                         const View& view) const {
  std::vector<std::optional<double>> held;
  for (const FieldSetMember& member : members_)
    held.push_back(how_well_held(SlabRays(*member.field_geometry, room_from_ct, view)));
  // An empty optional is below any number.
  const std::optional<double> best = *std::max_element(held.begin(), held.end());
  std::vector<double> weights(members_.size(), 0.0);
  if (!best) return weights;
  double sum = 0.0;
  for (std::size_t i = 0; i < held.size(); ++i) {
    if (!held[i]) continue;
    // The weight falls to 0 as a member ceases to be nearly the best. This happens before it loses
    // a ray that another holds.
    const double behind = std::max(0.0, 1.0 - (*best - *held[i]) / kSeam);
    weights[i] = behind * behind;
    sum += weights[i];
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

RenderStatus FieldSetDrr::render(const RigidTransform& room_from_ct,
                                 const View& view,
                                 RenderWorkspace& workspace,
                                 std::span<float> total_attenuation,
                                 const std::optional<PoseGradients>& gradients) const {
  auto& scratch = dynamic_cast<SetWorkspace&>(workspace);
  const auto render_member = [&](std::size_t i,
                                 std::span<float> values,
                                 const std::optional<PoseGradients>& wanted) {
    if (!scratch.members[i]) scratch.members[i] = members_[i].renderer->make_workspace();
    return members_[i].renderer->render(room_from_ct, view, *scratch.members[i], values, wanted);
  };
  std::vector<double> weight = weights(room_from_ct, view);
  if (std::all_of(weight.begin(), weight.end(), [](double w) { return w == 0.0; })) {
    std::int64_t fewest = std::numeric_limits<std::int64_t>::max();
    std::size_t best = 0;
    for (std::size_t i = 0; i < members_.size(); ++i) {
      const std::int64_t outside =
          SlabRays(*members_[i].field_geometry, room_from_ct, view).count_outside();
      if (outside >= fewest) continue;
      fewest = outside;
      best = i;
    }
    return render_member(best, total_attenuation, gradients);
  }
  const auto first = static_cast<std::size_t>(
      std::find_if(weight.begin(), weight.end(), [](double w) { return w > 0.0; }) -
      weight.begin());
  const RenderStatus status = render_member(first, total_attenuation, gradients);
  if (weight[first] == 1.0) return status;
  const auto scale = [](std::span<float> values, double factor) {
    for (float& value : values) value = static_cast<float>(factor * static_cast<double>(value));
  };
  const auto add = [](std::span<float> sum, std::span<const float> values, double factor) {
    for (std::size_t i = 0; i < sum.size(); ++i)
      sum[i] += static_cast<float>(factor * static_cast<double>(values[i]));
  };
  scale(total_attenuation, weight[first]);
  if (gradients) scale(gradients->planes, weight[first]);
  scratch.values.resize(total_attenuation.size());
  if (gradients) scratch.planes.resize(gradients->planes.size());
  for (std::size_t i = first + 1; i < members_.size(); ++i) {
    if (weight[i] == 0.0) continue;
    std::optional<PoseGradients> its_gradients = gradients;
    if (its_gradients) its_gradients->planes = scratch.planes;
    render_member(i, scratch.values, its_gradients);
    add(total_attenuation, scratch.values, weight[i]);
    if (gradients) add(gradients->planes, scratch.planes, weight[i]);
  }
  return status;
}

std::int64_t FieldSetDrr::rays_outside(const RigidTransform& room_from_ct, const View& view) const {
  std::int64_t fewest = std::numeric_limits<std::int64_t>::max();
  for (const FieldSetMember& member : members_) {
    fewest = std::min(fewest, SlabRays(*member.field_geometry, room_from_ct, view).count_outside());
    if (fewest == 0) break;
  }
  return fewest;
}

std::unique_ptr<RenderWorkspace> FieldSetDrr::make_workspace() const {
  auto workspace = std::make_unique<SetWorkspace>();
  workspace->members.resize(members_.size());
  return workspace;
}

}  // namespace af
