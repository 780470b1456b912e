// SPDX-License-Identifier: Apache-2.0
#include "support/itk_ray_cast.h"

#include <algorithm>

#include <itkIdentityTransform.h>
#include <itkImage.h>
#include <itkRayCastInterpolateImageFunction.h>

namespace af::test {

namespace {

using ItkImage = itk::Image<double, 3>;
using Caster = itk::RayCastInterpolateImageFunction<ItkImage, double>;

}  // namespace

struct ItkRayCaster::Impl {
  Caster::Pointer caster = Caster::New();
};

ItkRayCaster::ItkRayCaster(const ItkGrid& grid, const std::vector<double>& mu_per_mm)
    : impl_(std::make_unique<Impl>()) {
  const auto image = ItkImage::New();
  ItkImage::SizeType size;
  for (unsigned axis = 0; axis < 3; ++axis)
    size[axis] = static_cast<itk::SizeValueType>(grid.size[axis]);
  image->SetRegions(ItkImage::RegionType(size));
  image->SetSpacing(grid.spacing_mm.data());
  image->SetOrigin(grid.origin_mm.data());
  image->Allocate();
  std::copy(mu_per_mm.begin(), mu_per_mm.end(), image->GetBufferPointer());
  impl_->caster->SetInputImage(image);
  impl_->caster->SetTransform(itk::IdentityTransform<double, 3>::New());
  impl_->caster->SetThreshold(0.0);
}

ItkRayCaster::~ItkRayCaster() = default;

std::vector<float> ItkRayCaster::cast(const ItkFan& fan) const {
  impl_->caster->SetFocalPoint(Caster::InputPointType(fan.source_point.data()));
  std::vector<float> values;
  values.reserve(static_cast<std::size_t>(fan.columns) * static_cast<std::size_t>(fan.rows));
  for (int row = 0; row < fan.rows; ++row)
    for (int column = 0; column < fan.columns; ++column) {
      Caster::PointType through;
      for (unsigned axis = 0; axis < 3; ++axis)
        through[axis] =
            fan.first_point[axis] + column * fan.column_step[axis] + row * fan.row_step[axis];
      values.push_back(static_cast<float>(impl_->caster->Evaluate(through)));
    }
  return values;
}

}  // namespace af::test
