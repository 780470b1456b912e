// SPDX-License-Identifier: Apache-2.0
#include "evaluate/shared_measuring_program.h"

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "gold/tre.h"

namespace af::evaluation {
namespace {

using Matrix = Eigen::Matrix<double, 3, 4>;
constexpr std::size_t kMatrixBytes = sizeof(double) * Matrix::SizeAtCompileTime;

std::vector<std::byte> bytes_of(std::span<const RigidTransform> poses) {
  std::vector<std::byte> bytes(poses.size() * kMatrixBytes);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Matrix matrix = poses[i].affine();
    std::memcpy(bytes.data() + i * kMatrixBytes, matrix.data(), kMatrixBytes);
  }
  return bytes;
}

/// Collective. The TREs of rank 0's poses, on every rank.
std::vector<double> tres_of_all(const Communicator& world,
                                const Yardstick& yardstick,
                                std::span<const RigidTransform> poses) {
  std::vector<std::byte> bytes = bytes_of(poses);
  world.broadcast(bytes);
  // Of every sum one term alone is not zero: the bits are kept.
  std::vector<std::uint64_t> bits(bytes.size() / kMatrixBytes);
  for (auto i = static_cast<std::size_t>(world.rank()); i < bits.size();
       i += static_cast<std::size_t>(world.size())) {
    Matrix matrix;
    std::memcpy(matrix.data(), bytes.data() + i * kMatrixBytes, kMatrixBytes);
    RigidTransform pose = RigidTransform::Identity();
    pose.affine() = matrix;
    bits[i] = std::bit_cast<std::uint64_t>(
        mean_tre_mm(pose, yardstick.gold_room_from_ct, yardstick.points_ct_mm));
  }
  world.sum(bits);
  std::vector<double> tres_mm;
  tres_mm.reserve(bits.size());
  for (const std::uint64_t value : bits) tres_mm.push_back(std::bit_cast<double>(value));
  return tres_mm;
}

}  // namespace

StratifiedStarts starts_measured_together(
    const Communicator& world,
    const Yardstick& yardstick,
    const std::function<StratifiedStarts(const MeasureTres& measure_tres)>& make) {
  const MeasureTres measure = [&](std::span<const RigidTransform> poses) {
    return tres_of_all(world, yardstick, poses);
  };
  return all_or_none(world, [&]() -> StratifiedStarts {
    if (world.size() == 1) return make({});
    if (!world.is_root()) {
      while (!measure({}).empty()) continue;
      return {};
    }
    // No poses: the others need not wait for more.
    const auto end = [&] { static_cast<void>(measure({})); };
    try {
      StratifiedStarts starts = make(measure);
      end();
      return starts;
    } catch (...) {
      end();
      throw;
    }
  });
}

}  // namespace af::evaluation
