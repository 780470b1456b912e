// SPDX-License-Identifier: Apache-2.0
// For kernels only: a binary adaptive range coder (Martin 1979; the carry is handled as LZMA does
// it). None of our libraries has one. No branch depends on a bit, because bits are hard to predict;
// otherwise they would not be stored.
#pragma once

#include <stdint.h>
#include <string.h>

#include "base/kernel_inline.h"
#include "field/index_coding_kernel.h"

namespace af::AF_KERNEL_NAMESPACE {

/// Below it a range is renewed by a byte.
inline constexpr uint32_t kLeastRange = 1u << 24u;

/// How quickly a model learns: quickly from the first bits, slowly later.
inline constexpr uint8_t kRates[] = {2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 4, 4, 4,
                                     4, 5, 5, 5, 5, 5, 5, 5, 5, 5, 5, 6};
inline constexpr uint32_t kMostSeen = sizeof(kRates) - 1;

/// How likely a one is, of 4096, within 1 ... 4095.
AF_KERNEL_INLINE uint32_t likelihood_of_one(const AdaptiveBit& model) {
  return uint32_t{model.one} >> 4u;
}

/// All ones where a bit is one.
AF_KERNEL_INLINE uint32_t mask_of(bool bit) {
  return 0u - static_cast<uint32_t>(bit);
}

/// a where the mask is ones, else b.
AF_KERNEL_INLINE uint32_t selected(uint32_t mask, uint32_t a, uint32_t b) {
  return b ^ ((a ^ b) & mask);
}

/// `least` of 65536 is the smallest probability that either value can get.
template <uint32_t least>
AF_KERNEL_INLINE void learn(AdaptiveBit& model, uint32_t mask) {
  static_assert(least >= 16 && least < 1u << 15u);
  constexpr uint32_t kAll = 1u << 16u;
  const uint32_t rate = kRates[model.seen];
  model.seen = static_cast<uint16_t>(model.seen + (model.seen < kMostSeen ? 1u : 0u));
  // How likely the other bit is, which shrinks.
  const uint32_t other = selected(mask, kAll - model.one, model.one);
  const uint32_t above_least = other - (other >> rate) - least;
  const uint32_t is_below = static_cast<uint32_t>(static_cast<int32_t>(above_least) >> 31);
  const uint32_t shrunk = least + (above_least & ~is_below);
  model.one = static_cast<uint16_t>(selected(mask, kAll - shrunk, shrunk));
}

class RangeEncoder {
 public:
  RangeEncoder() = default;
  /// `bytes` has room for all that will be coded: 2 bytes a bit at most, and 5.
  AF_KERNEL_MEMBER explicit RangeEncoder(uint8_t* bytes) : begin_(bytes), bytes_(bytes) {}

  template <uint32_t least>
  AF_KERNEL_MEMBER bool code(AdaptiveBit& model, bool bit) {
    const uint32_t bound = (range_ >> 12u) * likelihood_of_one(model);
    const uint32_t mask = mask_of(bit);
    low_ += bound & ~mask;
    range_ = selected(mask, bound, range_ - bound);
    learn<least>(model, mask);
    while (range_ < kLeastRange) {
      range_ <<= 8u;
      shift_low();
    }
    return bit;
  }

  /// Writes the last bytes; returns how many there are in all.
  AF_KERNEL_MEMBER int64_t finish() {
    for (int i = 0; i < 5; ++i) shift_low();
    return bytes_ - begin_;
  }

 private:
  AF_KERNEL_MEMBER void shift_low() {
    if (low_ < 0xFF000000u || low_ > 0xFFFFFFFFu) {
      const uint8_t carry = static_cast<uint8_t>(low_ >> 32u);
      for (; pending_ > 0; --pending_) {
        *bytes_++ = static_cast<uint8_t>(cache_ + carry);
        cache_ = 0xFF;
      }
      cache_ = static_cast<uint8_t>(low_ >> 24u);
    }
    ++pending_;
    low_ = (low_ & 0x00FFFFFFu) << 8u;
  }

  uint8_t* begin_ = nullptr;
  uint8_t* bytes_ = nullptr;
  uint64_t low_ = 0;
  uint64_t pending_ = 1;  ///< bytes that a carry may still change: cache_, then 0xFF each
  uint32_t range_ = 0xFFFFFFFFu;
  uint8_t cache_ = 0;
};

/// Any bytes decode to something. Beyond the last byte it reads zeros; is_exhausted() tells whether
/// exactly the bytes that an encoder writes were read.
class RangeDecoder {
 public:
  RangeDecoder() = default;
  AF_KERNEL_MEMBER RangeDecoder(const uint8_t* bytes, int64_t count)
      : bytes_(bytes), count_(count) {
    next_ = 1;  // an encoder's first byte is 0
    code_ = next_word();
    next_ = 5;
  }

  /// The second argument matters to the encoder only.
  template <uint32_t least>
  AF_KERNEL_MEMBER bool code(AdaptiveBit& model, bool /*bit*/) {
    const uint32_t bound = (range_ >> 12u) * likelihood_of_one(model);
    const bool bit = code_ < bound;
    const uint32_t mask = mask_of(bit);
    code_ -= bound & ~mask;
    range_ = selected(mask, bound, range_ - bound);
    learn<least>(model, mask);
    // Two bytes at most: the range was 2^24 or more, and no likelihood is below one of 4096.
    const uint32_t bits = static_cast<uint32_t>(__builtin_clz(range_)) & 24u;
    range_ <<= bits;
    code_ = static_cast<uint32_t>(((uint64_t{code_} << 32u | next_word()) << bits) >> 32u);
    next_ += bits / 8u;
    return bit;
  }

  [[nodiscard]] AF_KERNEL_MEMBER bool is_exhausted() const { return next_ == count_; }

 private:
  [[nodiscard]] AF_KERNEL_MEMBER uint32_t next_word() const {
    if (next_ + 4 <= count_) [[likely]] {
      uint32_t word = 0;
      memcpy(&word, bytes_ + next_, sizeof(word));
      return __builtin_bswap32(word);
    }
    uint32_t word = 0;
    for (int64_t i = next_; i < next_ + 4; ++i) word = word << 8u | (i < count_ ? bytes_[i] : 0u);
    return word;
  }

  const uint8_t* bytes_ = nullptr;
  int64_t count_ = 0;
  int64_t next_ = 0;
  uint32_t range_ = 0xFFFFFFFFu;
  uint32_t code_ = 0;
};

}  // namespace af::AF_KERNEL_NAMESPACE
