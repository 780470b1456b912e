// SPDX-License-Identifier: Apache-2.0
#include "drr/atlas_renderers.h"

#include <algorithm>
#include <mutex>
#include <utility>

#include "base/error.h"
#include "drr/slab_rays.h"

namespace af {

namespace {

/// Scratch memory for the member as it is open now. A member that is opened again makes its own.
class MemberWorkspace final : public RenderWorkspace {
 public:
  std::weak_ptr<const MemberLevels> levels;
  std::unique_ptr<RenderWorkspace> scratch;
};

/// One level of one member, opened when it is rendered.
class MemberDrr final : public DrrRenderer {
 public:
  MemberDrr(std::shared_ptr<const LightSlab> coverage,
            std::shared_ptr<MembersInUse> members,
            std::size_t member,
            std::size_t level)
      : coverage_(std::move(coverage)),
        members_(std::move(members)),
        member_(member),
        level_(level) {}

  RenderStatus render(const RigidTransform& room_from_ct,
                      const View& view,
                      RenderWorkspace& workspace,
                      std::span<float> total_attenuation,
                      const std::optional<PoseGradients>& gradients) const override {
    auto& own = dynamic_cast<MemberWorkspace&>(workspace);
    const std::shared_ptr<const MemberLevels> levels = members_->get(member_);
    const DrrRenderer& renderer = *levels->at(level_);
    if (own.scratch == nullptr || own.levels.lock() != levels) {
      own.scratch = renderer.make_workspace();
      own.levels = levels;
    }
    return renderer.render(room_from_ct, view, *own.scratch, total_attenuation, gradients);
  }

  [[nodiscard]] std::int64_t rays_outside(const RigidTransform& room_from_ct,
                                          const View& view) const override {
    return SlabRays(*coverage_, room_from_ct, view).count_outside();
  }
  [[nodiscard]] std::unique_ptr<RenderWorkspace> make_workspace() const override {
    return std::make_unique<MemberWorkspace>();
  }
  [[nodiscard]] const char* name() const override { return "field"; }

 private:
  std::shared_ptr<const LightSlab> coverage_;
  std::shared_ptr<MembersInUse> members_;
  std::size_t member_;
  std::size_t level_;
};

constexpr std::size_t kFewestKept = 2;

}  // namespace

MembersInUse::MembersInUse(Open open, std::size_t most)
    : open_(std::move(open)), most_(std::max(most, kFewestKept)) {}

std::shared_ptr<const MemberLevels> MembersInUse::get(std::size_t member) {
  const std::scoped_lock lock(mutex_);
  const auto found = kept_.find(member);
  if (found != kept_.end()) {
    found->second.used = ++uses_;
    return found->second.levels;
  }
  std::shared_ptr<const MemberLevels> levels = open_(member);
  kept_[member] = {levels, ++uses_, false};
  dropped();
  return levels;
}

void MembersInUse::keep(std::size_t member, std::shared_ptr<const MemberLevels> levels) {
  const std::scoped_lock lock(mutex_);
  kept_[member] = {std::move(levels), ++uses_, true};
  dropped();
}

std::size_t MembersInUse::count() const {
  const std::scoped_lock lock(mutex_);
  return kept_.size();
}

void MembersInUse::dropped() {
  const auto later = [](const auto& a, const auto& b) {
    if (a.second.is_for_good != b.second.is_for_good) return b.second.is_for_good;
    return a.second.used < b.second.used;
  };
  while (kept_.size() > most_) {
    const auto oldest = std::min_element(kept_.begin(), kept_.end(), later);
    if (oldest->second.is_for_good) return;
    kept_.erase(oldest);
  }
}

std::vector<FieldSetMember> atlas_level(
    const std::vector<std::shared_ptr<const LightSlab>>& coverage,
    const std::shared_ptr<MembersInUse>& members,
    std::size_t level) {
  std::vector<FieldSetMember> set;
  for (std::size_t i = 0; i < coverage.size(); ++i)
    set.push_back({coverage[i], std::make_shared<const MemberDrr>(coverage[i], members, i, level)});
  return set;
}

}  // namespace af
