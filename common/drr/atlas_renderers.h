// SPDX-License-Identifier: Apache-2.0
// Renderers of an atlas that open its members when a pose first needs them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <vector>

#include "base/fork_aware_mutex.h"
#include "drr/drr_renderer.h"
#include "drr/field_set_drr.h"
#include "geometry/light_slab.h"

namespace af {

/// The renderers of one member: its own, then those of the levels of its image pyramid.
using MemberLevels = std::vector<std::shared_ptr<const DrrRenderer>>;

/// The members of an atlas that are in memory: at most `most`, those used last. Safe for any number
/// of threads. \test MembersInUse.KeepsThoseThatWereUsedLast
class MembersInUse {
 public:
  using Open = std::function<std::shared_ptr<const MemberLevels>(std::size_t member)>;

  /// `open` is called by one thread at a time, and get() throws what it throws. At least two
  /// members are kept, because a seam needs two.
  MembersInUse(Open open, std::size_t most);

  /// Returns the member, opened if need be. It stays usable for the caller after it is dropped
  /// here.
  std::shared_ptr<const MemberLevels> get(std::size_t member);
  /// Keeps a member for good that was opened elsewhere.
  void keep(std::size_t member, std::shared_ptr<const MemberLevels> levels);
  [[nodiscard]] std::size_t count() const;

 private:
  struct Kept {
    std::shared_ptr<const MemberLevels> levels;
    std::uint64_t used = 0;  ///< a count that grows with every use
    bool is_for_good = false;
  };

  void dropped();

  Open open_;
  std::size_t most_;
  std::uint64_t uses_ = 0;
  std::map<std::size_t, Kept> kept_;
  mutable ForkAwareMutex mutex_;
};

/// One level of every member, opened when it is rendered; level 0 gives the DRRs themselves.
/// `coverage`: the planes of every member. What is rendered does not depend on which members are in
/// memory.
std::vector<FieldSetMember> atlas_level(
    const std::vector<std::shared_ptr<const LightSlab>>& coverage,
    const std::shared_ptr<MembersInUse>& members,
    std::size_t level);

}  // namespace af
