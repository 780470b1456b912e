// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

namespace af {

/// A step of splitmix64: its increment and finaliser (Steele, Lea, Flood, OOPSLA 2014).
inline std::uint64_t hash_mix(std::uint64_t x) {
  x += 0x9E3779B97F4A7C15ull;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ull;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBull;
  return x ^ (x >> 31);
}

/// Counter-based random numbers: a value depends only on its keys (seed, stream, index, ...), never
/// on how many were drawn before or on which rank draws it. The mixer is applied once per key.
inline std::uint64_t hash64(std::uint64_t a,
                            std::uint64_t b = 0,
                            std::uint64_t c = 0,
                            std::uint64_t d = 0) {
  return hash_mix(hash_mix(hash_mix(hash_mix(a) ^ b) ^ c) ^ d);
}

/// Hash of a name (for example a case name), to be used as a key. FNV-1a followed by the mixer.
std::uint64_t hash_name(std::string_view name);

/// A sequence of draws for one keyed object, e.g. HashRandom(seed, hash_name(case), start_index).
class HashRandom {
 public:
  explicit HashRandom(std::uint64_t seed, std::uint64_t key_1 = 0, std::uint64_t key_2 = 0)
      : key_(hash64(seed, key_1, key_2)) {}

  std::uint64_t next_bits() { return hash64(key_, counter_++); }
  /// Uniform in [0, 1), 53 bits.
  double uniform();
  /// Uniform in [low, high).
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Standard normal, by Box and Muller; every call uses two draws.
  double normal();
  /// Uniform integer in [0, bound); bound > 0. The bias (bound / 2^64) is far below any use here.
  std::uint64_t below(std::uint64_t bound) { return next_bits() % bound; }

 private:
  std::uint64_t key_;
  std::uint64_t counter_ = 0;
};

}  // namespace af
