// SPDX-License-Identifier: Apache-2.0
#include "physics/caster_accuracy.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "ct/ray_caster.h"
#include "geometry/slab_sizing.h"
#include "precompute/casting/shear_warp_caster.h"

namespace af::test {

namespace {

class PsnrSum {
 public:
  void add(double value, double reference) {
    if (!(reference > 0.0)) return;
    squared_error_ += (value - reference) * (value - reference);
    largest_ = std::max(largest_, reference);
    ++count_;
  }
  [[nodiscard]] double psnr_db() const {
    return 20.0 * std::log10(largest_ / std::sqrt(squared_error_ / count_));
  }
  [[nodiscard]] int count() const { return count_; }

 private:
  double squared_error_ = 0.0;
  double largest_ = 0.0;
  int count_ = 0;
};

/// The rays of a unit that is one viewpoint and one row of nodes.
RayFan fan_of(const WorkUnit& row, const LightSlab& light_slab) {
  const RigidTransform ct_from_slab = light_slab.slab_from_ct.inverse();
  const SlabGeometry& slab = light_slab.slabs[row.slab];
  RayFan fan;
  fan.source_point = ct_from_slab * light_slab.viewpoint(row.u.begin, row.v.begin);
  fan.first_point = ct_from_slab * light_slab.st_point(slab, row.s.begin, row.t.begin);
  fan.column_step = ct_from_slab.linear() * Eigen::Vector3d(0.0, 0.0, slab.t.spacing_mm());
  fan.row_step = Eigen::Vector3d::Zero();
  fan.columns = row.t.count;
  fan.rows = 1;
  return fan;
}

}  // namespace

CasterAccuracy measure_caster_accuracy(const AttenuationVolume& volume,
                                       const CameraGeometry& camera,
                                       const PoseFrame& frame,
                                       const MotionRange& range,
                                       int rows) {
  const LightSlab light_slab =
      make_light_slab(camera, frame, range, volume.corner_points(), LightSlabSpec{});
  const SlabGeometry& slab = light_slab.slabs.front();
  const AttenuationQuantizer quantizer =
      AttenuationQuantizer::for_maximum(volume.max_total_attenuation());
  const SlabAlignedVolume resampled(volume, light_slab.slab_from_ct);
  const ShearWarpFieldCaster caster(resampled, light_slab, quantizer);
  const RayCaster reference(volume, {0.1});
  const RayCaster coarser(volume, {0.2});
  const auto columns = static_cast<std::size_t>(slab.stored_t.count);
  std::vector<std::uint16_t> samples(columns);
  std::vector<float> expected(columns);
  std::vector<float> expected_coarser(columns);
  std::mt19937 random(1);
  const auto one_of = [&](int begin, int count) {
    return NodeRange{begin + static_cast<int>(random() % static_cast<unsigned>(count)), 1};
  };
  PsnrSum of_caster;
  PsnrSum of_reference;
  for (int i = 0; i < rows; ++i) {
    const NodeRange u = one_of(0, light_slab.u.nodes);
    const NodeRange v = one_of(0, light_slab.v.nodes);
    const NodeRange s = one_of(slab.stored_s.begin, slab.stored_s.count);
    const WorkUnit row{0, 0, u, v, s, slab.stored_t};
    caster.cast(row, samples);
    reference.cast(fan_of(row, light_slab), expected);
    coarser.cast(fan_of(row, light_slab), expected_coarser);
    for (std::size_t t = 0; t < columns; ++t) {
      const auto value = static_cast<double>(expected[t]);
      of_caster.add(static_cast<double>(quantizer.dequantize(samples[t])), value);
      of_reference.add(static_cast<double>(expected_coarser[t]), value);
    }
  }
  return {of_caster.psnr_db(), of_reference.psnr_db(), of_caster.count(), resampled.bytes()};
}

}  // namespace af::test
