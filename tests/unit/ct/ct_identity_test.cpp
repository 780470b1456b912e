// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <random>
#include <string>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ct/ct_reader.h"
#include "files/input_file.h"
#include "files/output_file.h"
#include "support/test_paths.h"
#include "unit/ct/ct_test_data.h"

namespace af {
namespace {

namespace fs = std::filesystem;
using test::asymmetric_ct;
using test::ScratchFolder;
using test::small_grid;
using testing::HasSubstr;

std::string difference(const CtVolume& expected, const CtVolume& found) {
  return ct_difference(identity_of(expected), identity_of(found));
}

/// How a file may store a CT: which of its axes come first, second and third, and which of these
/// run backwards.
struct StoredOrder {
  std::array<int, 3> axis = {0, 1, 2};
  std::array<bool, 3> reversed = {false, false, false};
};

/// The same CT with its voxels in another order.
CtVolume stored_in(const CtVolume& ct, const StoredOrder& order) {
  CtVolume stored;
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  for (std::size_t a = 0; a < 3; ++a) {
    const int from = order.axis[a];
    const auto to = static_cast<Eigen::Index>(a);
    stored.grid.size[a] = ct.grid.size[static_cast<std::size_t>(from)];
    stored.grid.spacing_mm[to] = ct.grid.spacing_mm[from];
    stored.grid.direction.col(to) = (order.reversed[a] ? -1.0 : 1.0) * ct.grid.direction.col(from);
    if (order.reversed[a]) first[from] = stored.grid.size[a] - 1.0;
  }
  stored.grid.origin_mm = ct.grid.point_mm(first);
  std::vector<std::int16_t> hu;
  std::array<int, 3> at{};
  const auto& size = stored.grid.size;
  for (at[2] = 0; at[2] < size[2]; ++at[2])
    for (at[1] = 0; at[1] < size[1]; ++at[1])
      for (at[0] = 0; at[0] < size[0]; ++at[0]) {
        std::array<int, 3> source{};
        for (std::size_t a = 0; a < 3; ++a)
          source[static_cast<std::size_t>(order.axis[a])] =
              order.reversed[a] ? size[a] - 1 - at[a] : at[a];
        hu.push_back(ct.hu[static_cast<std::size_t>(
            source[0] + ct.grid.size[0] * (source[1] + ct.grid.size[1] * source[2]))]);
      }
  stored.hu = SharedArray<std::int16_t>(std::move(hu));
  return stored;
}

/// Random choices for one run after another.
class Draw {
 public:
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  int below(int count) { return std::uniform_int_distribution<int>(0, count - 1)(random_); }
  Eigen::Vector3d direction() {
    return Eigen::Vector3d(between(-1, 1), between(-1, 1), between(-1, 1)).normalized();
  }
  StoredOrder order() {
    StoredOrder order;
    std::shuffle(order.axis.begin(), order.axis.end(), random_);
    for (bool& is_reversed : order.reversed) is_reversed = below(2) == 1;
    return order;
  }
  /// Along the patient's axes, hardly or thoroughly oblique, or halfway between two orders of axes.
  Eigen::Matrix3d axes() {
    switch (below(4)) {
      case 0:
        return Eigen::Matrix3d::Identity();
      case 1:
        return turn(direction(), std::pow(10.0, between(-6.0, -2.0)));
      case 2:
        return turn(direction(), between(-M_PI, M_PI));
      default:
        return turn(Eigen::Vector3d::Unit(below(3)), M_PI / 4.0);
    }
  }
  CtVolume ct() {
    CtVolume ct;
    for (int& extent : ct.grid.size) extent = 3 + below(4);
    for (double& spacing : ct.grid.spacing_mm) spacing = between(0.5, 5.0);
    ct.grid.origin_mm = 500.0 * direction();
    ct.grid.direction = axes();
    std::vector<std::int16_t> hu(ct.grid.voxel_count());
    for (std::int16_t& value : hu) value = static_cast<std::int16_t>(below(4000) - 1000);
    hu.front() = 1000;
    ct.hu = SharedArray<std::int16_t>(std::move(hu));
    return ct;
  }
  /// The same voxels moved, resized, turned or mirrored; or the same grid with mirrored voxels.
  CtVolume changed(const CtVolume& ct) {
    CtVolume other = ct;
    const int axis = below(3);
    switch (below(5)) {
      case 0:
        other.grid.origin_mm += std::pow(10.0, between(-2.5, 1.0)) * direction();
        break;
      case 1:
        other.grid.spacing_mm *= between(1.01, 1.1);
        break;
      case 2:
        other.grid.direction =
            turn(ct.grid.direction.col(axis), between(0.01, 0.1)) * ct.grid.direction;
        break;
      case 3:
        other.grid.direction.col(axis) *= -1.0;
        break;
      default: {
        StoredOrder mirrored;
        mirrored.reversed[static_cast<std::size_t>(axis)] = true;
        other.hu = stored_in(ct, mirrored).hu;
      }
    }
    return other;
  }

 private:
  static Eigen::Matrix3d turn(const Eigen::Vector3d& axis, double angle_rad) {
    return Eigen::AngleAxisd(angle_rad, axis).toRotationMatrix();
  }
  std::mt19937 random_{53};
};

/// MetaImage with its header in a file of its own.
fs::path write_header_and_voxels(const CtVolume& ct, const fs::path& folder) {
  write_ct(ct, folder / "ct.mha");
  const std::string whole = read_text_file(folder / "ct.mha");
  const std::string local = "ElementDataFile = LOCAL\n";
  const std::size_t end = whole.find(local);
  write_text_file(folder / "ct.mhd", whole.substr(0, end) + "ElementDataFile = ct.raw\n");
  write_text_file(folder / "ct.raw", whole.substr(end + local.size()));
  return folder / "ct.mhd";
}

/// DICOM has right-handed stacks only.
fs::path write_slices(const CtVolume& ct, const fs::path& folder) {
  fs::remove_all(folder / "dicom");
  StoredOrder order;
  order.reversed[2] = ct.grid.direction.determinant() < 0.0;
  test::write_dicom_series(stored_in(ct, order), folder / "dicom");
  return folder / "dicom";
}

constexpr int kFormats = 5;

CtVolume written_and_read(const CtVolume& ct, int format, const fs::path& folder) {
  constexpr std::array<const char*, kFormats - 2> kNames = {"ct.nii.gz", "ct.mha", "ct.nrrd"};
  if (format == kFormats - 1) return read_ct(write_slices(ct, folder));
  if (format == kFormats - 2) return read_ct(write_header_and_voxels(ct, folder));
  const fs::path file = folder / kNames.at(static_cast<std::size_t>(format));
  write_ct(ct, file);
  return read_ct(file);
}

TEST(CtIdentity, IsThatOfVoxelsAndOfEveryCornersPlace) {
  const CtVolume ct = asymmetric_ct(small_grid());
  CtVolume other = ct;
  other.grid.origin_mm.x() += 7.0;
  EXPECT_THAT(difference(ct, other), HasSubstr("7 mm off"));
  other.grid.origin_mm.x() = ct.grid.origin_mm.x() + 9e-4;
  EXPECT_EQ(difference(ct, other), "");
  // The first voxel stays; the last of 5 slices of 1.5 mm is 0.6 mm off.
  other = ct;
  other.grid.spacing_mm.z() *= 1.1;
  EXPECT_THAT(difference(ct, other), HasSubstr("0.6 mm off"));
  other.grid.spacing_mm = ct.grid.spacing_mm;
  other.grid.direction.col(1) *= -1.0;
  EXPECT_THAT(difference(ct, other), HasSubstr("SHA-256"));
  EXPECT_THAT(difference(ct, stored_in(ct, {{2, 0, 1}, {true, false, true}})), "");
}

TEST(CtIdentity, OfAThousandRewrittenCtsIsThatOfTheSameAndOfNoOtherOnes) {
  constexpr int kRuns = 1000;
  // Still the same place after single precision has rounded 500 mm by 3e-5 mm.
  constexpr double kHardlyMm = 9e-4;
  const ScratchFolder folder;
  Draw draw;
  for (int run = 0; run < kRuns; ++run) {
    SCOPED_TRACE(run);
    const CtVolume ct = draw.ct();
    CtVolume same = ct;
    if (draw.below(2) == 1) same.grid.origin_mm += kHardlyMm * draw.direction();
    const auto again = [&](const CtVolume& volume) {
      return written_and_read(stored_in(volume, draw.order()), draw.below(kFormats), folder.path());
    };
    ASSERT_EQ(difference(ct, again(same)), "");
    ASSERT_NE(difference(ct, again(draw.changed(ct))), "");
  }
}

}  // namespace
}  // namespace af
