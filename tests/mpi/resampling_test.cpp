// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <gtest/gtest.h>

#include "base/error.h"
#include "precompute/resampling_program.h"
#include "unit/precompute/shear_warp_cases.h"

namespace af {
namespace {

TEST(ResampleOnNode, EqualsResamplingAlone) {
  const Communicator world = Communicator::world();
  const AttenuationVolume volume(test::smooth_ct(), AttenuationModel{});
  for (const Eigen::Matrix3d& rotation :
       {test::aligned_rotations()[1], test::oblique_rotations()[0]}) {
    RigidTransform slab_from_ct = RigidTransform::Identity();
    slab_from_ct.linear() = rotation;
    const SlabAlignedVolume alone(volume, slab_from_ct);
    const SlabAlignedVolume shared = resample_on_node(volume, slab_from_ct, {}, world);
    const auto values =
        static_cast<std::ptrdiff_t>(alone.grid().slice_offset(alone.grid().size[1]));
    ASSERT_EQ(shared.grid().value_count(), alone.grid().value_count());
    EXPECT_TRUE(std::equal(alone.slice(0), alone.slice(0) + values, shared.slice(0)));
    for (int y = 0; y < alone.grid().size[1]; ++y)
      for (int z = 0; z < alone.grid().size[2]; ++z) {
        ASSERT_EQ(shared.occupied(y, z).begin, alone.occupied(y, z).begin);
        ASSERT_EQ(shared.occupied(y, z).end, alone.occupied(y, z).end);
      }
    world.barrier();
  }
}

TEST(ResampleOnNode, RefusesABadSpacingOnAllRanks) {
  const Communicator world = Communicator::world();
  const AttenuationVolume volume(test::smooth_ct(), AttenuationModel{});
  EXPECT_THROW(
      static_cast<void>(resample_on_node(volume, RigidTransform::Identity(), {5.0}, world)), Error);
}

}  // namespace
}  // namespace af
