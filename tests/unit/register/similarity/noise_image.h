// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/hash_random.h"
#include "xray/image2d.h"

namespace af::test {

/// Pixels drawn independently from 0 to 4.
inline Image2d noise_image(int width, int height, std::uint64_t seed) {
  Image2d image(width, height);
  HashRandom random(seed);
  for (float& pixel : image.pixels) pixel = static_cast<float>(random.uniform(0.0, 4.0));
  return image;
}

}  // namespace af::test
