// SPDX-License-Identifier: Apache-2.0
#include "base/hash_random.h"

#include <cmath>
#include <numbers>

namespace af {

namespace {

std::uint64_t mix(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15ull;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ull;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBull;
  return x ^ (x >> 31);
}

}  // namespace

std::uint64_t hash64(std::uint64_t a, std::uint64_t b, std::uint64_t c, std::uint64_t d) {
  return mix(mix(mix(mix(a) ^ b) ^ c) ^ d);
}

std::uint64_t hash_name(std::string_view name) {
  std::uint64_t h = 0xCBF29CE484222325ull;
  for (const char character : name)
    h = (h ^ static_cast<unsigned char>(character)) * 0x100000001B3ull;
  return mix(h);
}

double HashRandom::uniform() {
  return static_cast<double>(next_bits() >> 11) * 0x1.0p-53;
}

double HashRandom::normal() {
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));  // 1 - u is in (0, 1]
  return radius * std::cos(2.0 * std::numbers::pi * uniform());
}

}  // namespace af
