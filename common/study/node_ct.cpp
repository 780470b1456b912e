// SPDX-License-Identifier: Apache-2.0
#include "study/node_ct.h"

#include <array>
#include <cstddef>
#include <cstring>
#include <span>
#include <type_traits>

#include "volume/cut_faces.h"

namespace af {

namespace {

/// A CT grid as plain numbers, to be sent between ranks.
struct PlainGrid {
  std::array<int, 3> size;
  std::array<double, 15> values;
};
static_assert(std::is_trivially_copyable_v<PlainGrid>);

PlainGrid plain_grid(const CtGrid& grid) {
  PlainGrid plain{grid.size, {}};
  Eigen::Map<Eigen::Vector3d>(plain.values.data()) = grid.origin_mm;
  Eigen::Map<Eigen::Vector3d>(plain.values.data() + 3) = grid.spacing_mm;
  Eigen::Map<Eigen::Matrix3d>(plain.values.data() + 6) = grid.direction;
  return plain;
}

CtGrid grid_of(const PlainGrid& plain) {
  CtGrid grid;
  grid.size = plain.size;
  grid.origin_mm = Eigen::Map<const Eigen::Vector3d>(plain.values.data());
  grid.spacing_mm = Eigen::Map<const Eigen::Vector3d>(plain.values.data() + 3);
  grid.direction = Eigen::Map<const Eigen::Matrix3d>(plain.values.data() + 6);
  return grid;
}

CtFacts facts_of(const CtVolume& ct, const AttenuationModel& model) {
  return {ct.grid, ct_content_sha256(ct), cut_points(ct, model)};
}

/// Collective. Rank 0's points on every rank of `group`.
void share(std::vector<Eigen::Vector3d>& points, const Communicator& group) {
  std::vector<std::array<double, 3>> plain;
  for (const Eigen::Vector3d& point : points) plain.push_back({point.x(), point.y(), point.z()});
  std::vector<std::byte> bytes(plain.size() * sizeof(plain[0]));
  if (!plain.empty()) std::memcpy(bytes.data(), plain.data(), bytes.size());
  group.broadcast(bytes);
  plain.resize(bytes.size() / sizeof(plain[0]));
  if (!plain.empty()) std::memcpy(plain.data(), bytes.data(), bytes.size());
  points.clear();
  for (const auto& point : plain) points.emplace_back(point[0], point[1], point[2]);
}

/// Collective. Rank 0's facts on every rank of `group`.
void share(CtFacts& facts, const Communicator& group) {
  PlainGrid plain = plain_grid(facts.grid);
  std::vector<std::byte> bytes(sizeof(plain));
  std::memcpy(bytes.data(), &plain, sizeof(plain));
  group.broadcast(bytes);
  std::memcpy(&plain, bytes.data(), sizeof(plain));
  facts.grid = grid_of(plain);
  group.broadcast(facts.content_sha256);
  share(facts.cut_points_ct, group);
}

}  // namespace

NodeCt read_ct_per_node(const std::filesystem::path& path,
                        const CtReadOptions& options,
                        const AttenuationModel& model,
                        const Communicator& communicator,
                        std::vector<std::string>& warnings) {
  CtVolume ct;
  CtFacts facts;
  CtFacts bordered;
  all_or_none(communicator, [&] {
    if (!communicator.is_root()) return;
    ct = read_ct(path, options, &warnings);
    facts = facts_of(ct, model);
    bordered.grid = AttenuationVolume::bordered_grid_of(ct, model);
  });
  share(facts, communicator);
  share(bordered, communicator);
  const std::size_t count = bordered.grid.voxel_count();
  const auto owner = communicator.allocate_on_nodes_from_root(
      count * sizeof(std::uint16_t), [&](std::span<std::byte> memory) {
        AttenuationVolume::fill_voxels(
            ct, model, bordered.grid, {reinterpret_cast<std::uint16_t*>(memory.data()), count});
      });
  const auto* const voxels = reinterpret_cast<const std::uint16_t*>(owner.get());
  return {std::make_shared<const AttenuationVolume>(
              bordered.grid, model, SharedArray<std::uint16_t>(owner, {voxels, count})),
          facts};
}

CtFacts read_ct_facts(const std::filesystem::path& path,
                      const CtReadOptions& options,
                      const AttenuationModel& model,
                      const Communicator& communicator,
                      std::vector<std::string>& warnings) {
  CtFacts facts;
  all_or_none(communicator, [&] {
    if (!communicator.is_root()) return;
    const CtVolume ct = read_ct(path, options, &warnings);
    facts = facts_of(ct, model);
  });
  share(facts, communicator);
  return facts;
}

}  // namespace af
