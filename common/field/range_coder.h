// SPDX-License-Identifier: Apache-2.0
// A binary adaptive range coder (Martin 1979; the carry is handled as LZMA does it). No library
// that we build with has one.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace af {

/// How likely a bit is one, learned from those before it: quickly from the first, slowly later.
class AdaptiveBit {
 public:
  /// Of 4096, within 1 ... 4095.
  [[nodiscard]] std::uint32_t one() const { return std::uint32_t{one_} >> 4u; }

  /// `least` of 65536 is the smallest probability that either value can get.
  template <std::uint32_t least>
  void learn(bool bit) {
    static_assert(least >= 16 && least < 1u << 15u);
    const std::uint32_t rate = kRates[seen_];
    if (seen_ + 1u < kRates.size()) ++seen_;
    const std::uint32_t one = one_;
    one_ = static_cast<std::uint16_t>(bit ? std::min(one + ((65536u - one) >> rate), 65536u - least)
                                          : std::max(one - (one >> rate), least));
  }

 private:
  static constexpr std::array<std::uint8_t, 25> kRates = {2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 4, 4, 4,
                                                          4, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 6};
  std::uint16_t one_ = 1u << 15u;
  std::uint16_t seen_ = 0;
};

/// Below it a range is renewed by a byte.
inline constexpr std::uint32_t kLeastRange = 1u << 24u;

class RangeEncoder {
 public:
  template <std::uint32_t least>
  bool code(AdaptiveBit& model, bool bit) {
    const std::uint32_t bound = (range_ >> 12u) * model.one();
    if (bit) {
      range_ = bound;
    } else {
      low_ += bound;
      range_ -= bound;
    }
    model.learn<least>(bit);
    while (range_ < kLeastRange) {
      range_ <<= 8u;
      shift_low();
    }
    return bit;
  }

  std::vector<std::uint8_t> finish() {
    for (int i = 0; i < 5; ++i) shift_low();
    return std::move(bytes_);
  }

 private:
  void shift_low() {
    if (low_ < 0xFF000000u || low_ > 0xFFFFFFFFu) {
      const auto carry = static_cast<std::uint8_t>(low_ >> 32u);
      for (; pending_ > 0; --pending_) {
        bytes_.push_back(static_cast<std::uint8_t>(cache_ + carry));
        cache_ = 0xFF;
      }
      cache_ = static_cast<std::uint8_t>(low_ >> 24u);
    }
    ++pending_;
    low_ = (low_ & 0x00FFFFFFu) << 8u;
  }

  std::vector<std::uint8_t> bytes_;
  std::uint64_t low_ = 0;
  std::uint32_t range_ = 0xFFFFFFFFu;
  std::uint64_t pending_ = 1;  ///< bytes that a carry may still change: cache_, then 0xFF each
  std::uint8_t cache_ = 0;
};

/// Any bytes decode to something. Beyond the last byte it reads zeros; is_exhausted() tells whether
/// exactly the bytes that an encoder writes were read.
class RangeDecoder {
 public:
  explicit RangeDecoder(std::span<const std::uint8_t> bytes) : bytes_(bytes) {
    for (int i = 0; i < 5; ++i) code_ = code_ << 8u | next_byte();
  }

  /// The second argument is an encoder's; it does not count here.
  template <std::uint32_t least>
  bool code(AdaptiveBit& model, bool /*bit*/) {
    const std::uint32_t bound = (range_ >> 12u) * model.one();
    const bool bit = code_ < bound;
    if (bit) {
      range_ = bound;
    } else {
      code_ -= bound;
      range_ -= bound;
    }
    model.learn<least>(bit);
    while (range_ < kLeastRange) {
      range_ <<= 8u;
      code_ = code_ << 8u | next_byte();
    }
    return bit;
  }

  [[nodiscard]] bool is_exhausted() const { return next_ == bytes_.size(); }

 private:
  std::uint32_t next_byte() {
    const std::size_t at = next_++;
    return at < bytes_.size() ? bytes_[at] : 0u;
  }

  std::span<const std::uint8_t> bytes_;
  std::size_t next_ = 0;
  std::uint32_t range_ = 0xFFFFFFFFu;
  std::uint32_t code_ = 0;
};

}  // namespace af
