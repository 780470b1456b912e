// SPDX-License-Identifier: Apache-2.0
#include "xray/image2d.h"

#include "base/error.h"

namespace af {

std::vector<std::string> problems(const RegionOfInterest& roi, int columns, int rows) {
  std::vector<std::string> found;
  const std::string value = "[" + std::to_string(roi.column) + ", " + std::to_string(roi.row) +
                            ", " + std::to_string(roi.width) + ", " + std::to_string(roi.height) +
                            "]";
  const bool sane = roi.column >= 0 && roi.row >= 0 && roi.width > 0 && roi.height > 0;
  // Differences cannot overflow for hostile sizes, while sums could.
  if (!sane || roi.width > columns - roi.column || roi.height > rows - roi.row)
    found.push_back("roi_px = " + value + ": must lie on the detector of " +
                    std::to_string(columns) + " x " + std::to_string(rows) + " pixels");
  return found;
}

Image2d crop(const Image2d& image, const RegionOfInterest& roi) {
  check(problems(roi, image.width, image.height).empty(), "crop() needs a region within the image");
  Image2d part(roi.width, roi.height);
  for (int row = 0; row < roi.height; ++row)
    for (int column = 0; column < roi.width; ++column)
      part.at(column, row) = image.at(roi.column + column, roi.row + row);
  return part;
}

}  // namespace af
