// SPDX-License-Identifier: Apache-2.0
#include "base/hash_random.h"

#include <cmath>
#include <numbers>

namespace af {

std::uint64_t hash_name(std::string_view name) {
  std::uint64_t h = 0xCBF29CE484222325ull;
  for (const char character : name)
    h = (h ^ static_cast<unsigned char>(character)) * 0x100000001B3ull;
  return hash_mix(h);
}

double HashRandom::uniform() {
  return static_cast<double>(next_bits() >> 11) * 0x1.0p-53;
}

double HashRandom::normal() {
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));  // 1 - u is in (0, 1]
  return radius * std::cos(2.0 * std::numbers::pi * uniform());
}

}  // namespace af
