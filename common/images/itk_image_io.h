// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "images/image_header.h"

namespace af {

/// Writes an image by ITK, which does not notice a full disk. Throws FileError for what it does
/// notice.
void write_by_itk(const RawImage& image, const std::filesystem::path& file, ImageFormat format);

}  // namespace af
