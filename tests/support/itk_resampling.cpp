// SPDX-License-Identifier: Apache-2.0
#include "support/itk_resampling.h"

#include <algorithm>

#include <itkImage.h>
#include <itkLinearInterpolateImageFunction.h>
#include <itkResampleImageFilter.h>

namespace af::test {

namespace {

using Image = itk::Image<double, 3>;

struct Geometry {
  Image::SizeType size;
  Image::PointType origin;
  Image::SpacingType spacing;
  Image::DirectionType direction;
};

Geometry geometry_of(const ItkImageGrid& grid) {
  Geometry geometry;
  for (unsigned row = 0; row < 3; ++row) {
    geometry.size[row] = static_cast<itk::SizeValueType>(grid.size[row]);
    geometry.origin[row] = grid.origin_mm[row];
    geometry.spacing[row] = grid.spacing_mm[row];
    for (unsigned column = 0; column < 3; ++column)
      geometry.direction(row, column) = grid.direction[row][column];
  }
  return geometry;
}

}  // namespace

std::vector<double> itk_resampled(const ItkImageGrid& image_grid,
                                  const std::vector<double>& values,
                                  const ItkImageGrid& grid,
                                  double outside) {
  const Geometry from = geometry_of(image_grid);
  const auto image = Image::New();
  image->SetRegions(from.size);
  image->SetOrigin(from.origin);
  image->SetSpacing(from.spacing);
  image->SetDirection(from.direction);
  image->Allocate();
  std::copy(values.begin(), values.end(), image->GetBufferPointer());
  const Geometry to = geometry_of(grid);
  const auto filter = itk::ResampleImageFilter<Image, Image>::New();
  filter->SetInput(image);
  filter->SetInterpolator(itk::LinearInterpolateImageFunction<Image>::New());
  filter->SetDefaultPixelValue(outside);
  filter->SetSize(to.size);
  filter->SetOutputOrigin(to.origin);
  filter->SetOutputSpacing(to.spacing);
  filter->SetOutputDirection(to.direction);
  filter->Update();
  const double* const found = filter->GetOutput()->GetBufferPointer();
  return {found, found + filter->GetOutput()->GetBufferedRegion().GetNumberOfPixels()};
}

}  // namespace af::test
