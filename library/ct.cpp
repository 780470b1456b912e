// SPDX-License-Identifier: Apache-2.0
#include "attenuation_fields/ct.h"

#include <mutex>
#include <utility>

#include "base/error.h"
#include "ct/ct_reader.h"
#include "library/ct_impl.h"
#include "library/translation.h"

namespace attenuation_fields {

namespace library = af::library;

Vector3 CtGrid::center_mm() const {
  return library::vector_of(library::grid_of(*this).center_mm());
}

Ct::Ct(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

Ct Ct::read(const std::filesystem::path& path, const std::string& series_uid) {
  return library::translated_reading([&] {
    auto impl = std::make_shared<Impl>();
    af::CtReadOptions options;
    options.series_uid = series_uid;
    impl->ct = af::read_ct(path, options, &impl->warnings);
    impl->grid = library::grid_of(impl->ct.grid);
    return Ct(std::move(impl));
  });
}

Ct Ct::from_voxels(const CtGrid& grid,
                   std::shared_ptr<const void> owner,
                   std::span<const std::int16_t> hu) {
  return library::translated([&] {
    auto impl = std::make_shared<Impl>();
    impl->ct.grid = af::sound_grid(library::grid_of(grid), "CT", &impl->warnings);
    if (impl->ct.grid.voxel_count() != hu.size())
      throw af::InputError("CT: voxels",
                           std::to_string(hu.size()),
                           "its grid has " + std::to_string(impl->ct.grid.voxel_count()));
    impl->ct.hu = af::SharedArray<std::int16_t>(std::move(owner), hu);
    impl->grid = grid;
    return Ct(std::move(impl));
  });
}

const CtGrid& Ct::grid() const {
  return impl_->grid;
}

std::span<const std::int16_t> Ct::hu() const {
  return impl_->ct.hu.view();
}

const std::vector<std::string>& Ct::warnings() const {
  return impl_->warnings;
}

std::string Ct::content_sha256() const {
  return library::translated([&] { return af::identity_of(impl_->ct).content_sha256; });
}

std::shared_ptr<const af::AttenuationVolume> Ct::Impl::attenuation(
    const af::AttenuationModel& model) const {
  const std::lock_guard lock(mutex_);
  auto volume = latest_.lock();
  if (volume && volume->model().mu_water_per_mm == model.mu_water_per_mm &&
      volume->model().air_below_hu == model.air_below_hu)
    return volume;
  volume = std::make_shared<const af::AttenuationVolume>(ct, model);
  latest_ = volume;
  return volume;
}

}  // namespace attenuation_fields
