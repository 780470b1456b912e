// SPDX-License-Identifier: Apache-2.0
#include "drr/polychromatic_attenuation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/vector_width.h"

namespace af {

PolychromaticAttenuation::PolychromaticAttenuation(const SpectrumOptions& options,
                                                   const TissueModel& tissue) {
  const double mu_water = tissue.attenuation_model().mu_water_per_mm;
  for (const SpectrumBin& bin : tube_spectrum(options, tissue.effective_energy_kev()))
    bins_.push_back({bin.weight,
                     tissue.water_mu_per_mm(bin.energy_kev) / mu_water,
                     tissue.bone_mu_per_mm(bin.energy_kev) / mu_water});
  polynomial_ = fitted_hardening(
      bins_,
      [this](double water, double bone) { return summed(water, bone).u; },
      summed(0.0, 0.0).by_water);
}

PolychromaticAttenuation::Sum PolychromaticAttenuation::summed(double water, double bone) const {
  // The bin that comes through best is factored out, so that no ray is too long for the sum.
  double least = std::numeric_limits<double>::infinity();
  for (const HardeningBin& bin : bins_)
    least = std::min(least, water * bin.water + bone * bin.bone);
  double sum = 0.0;
  Sum mean;
  for (const HardeningBin& bin : bins_) {
    const double signal = bin.weight * std::exp(least - (water * bin.water + bone * bin.bone));
    sum += signal;
    mean.by_water += signal * bin.water;
    mean.by_bone += signal * bin.bone;
  }
  mean.by_water /= sum;
  mean.by_bone /= sum;
  mean.u = least - std::log(sum);
  return mean;
}

void PolychromaticAttenuation::apply(std::span<float> all, std::span<const float> bone) const {
  check(all.size() == bone.size(), "bone has as many pixels");
  const auto harden = select_kernel<HardenPixels>(
      kernels_128::harden_pixels, kernels_256::harden_pixels, kernels_512::harden_pixels);
  harden(polynomial_, static_cast<std::int64_t>(all.size()), all.data(), bone.data());
}

void PolychromaticAttenuation::apply(std::span<float> all,
                                     std::span<const float> bone,
                                     std::span<float> all_slopes,
                                     std::span<const float> bone_slopes) const {
  if (all.empty()) return;
  check(all.size() == bone.size() && all_slopes.size() == bone_slopes.size() &&
            all_slopes.size() % all.size() == 0,
        "bone has as many pixels and slopes");
  const auto harden = select_kernel<HardenWithSlopes>(kernels_128::harden_with_slopes,
                                                      kernels_256::harden_with_slopes,
                                                      kernels_512::harden_with_slopes);
  harden(polynomial_,
         static_cast<std::int64_t>(all.size()),
         all.data(),
         bone.data(),
         static_cast<std::int32_t>(all_slopes.size() / all.size()),
         all_slopes.data(),
         bone_slopes.data());
}

PolychromaticAttenuation::Value PolychromaticAttenuation::at(double all, double bone) const {
  auto u = static_cast<float>(all);
  const auto of_bone = static_cast<float>(bone);
  // The slope where all grows and bone stays, then where bone grows and all stays.
  std::array<float, 2> slopes{1.0f, 0.0f};
  const std::array<float, 2> bone_slopes{0.0f, 1.0f};
  apply({&u, 1}, {&of_bone, 1}, slopes, bone_slopes);
  return {static_cast<double>(u), static_cast<double>(slopes[0]), static_cast<double>(slopes[1])};
}

PolychromaticAttenuation::Value PolychromaticAttenuation::exactly(double all, double bone) const {
  if (!(all > 0.0)) {
    const double by_all = summed(0.0, 0.0).by_water;
    return {by_all * all, by_all, 0.0};
  }
  if (bone < 0.0) {
    const Sum water = summed(all, 0.0);
    return {water.u, water.by_water, 0.0};
  }
  if (bone > all) {
    const Sum only_bone = summed(0.0, all);
    return {only_bone.u, only_bone.by_bone, 0.0};
  }
  const Sum sum = summed(all - bone, bone);
  return {sum.u, sum.by_water, sum.by_bone - sum.by_water};
}

}  // namespace af
