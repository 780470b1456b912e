// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "base/error.h"
#include "precompute/pipeline/shared_resampling.h"
#include "unit/precompute/casting/shear_warp_cases.h"

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
    ASSERT_EQ(shared.bytes(), alone.bytes());
    for (int y = 0; y < alone.grid().size[1]; ++y)
      for (int z = 0; z < alone.grid().size[2]; ++z) {
        ASSERT_EQ(shared.row(y, z).begin, alone.row(y, z).begin);
        ASSERT_EQ(shared.row(y, z).end, alone.row(y, z).end);
        for (int x = 0; x < alone.grid().size[0]; ++x)
          ASSERT_EQ(shared.level(x, y, z), alone.level(x, y, z));
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
