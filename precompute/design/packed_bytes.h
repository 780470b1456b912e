// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace af {

/// Bytes that a field file takes for one chunk of tiles: codewords, and differences of means along
/// t, shuffled and deflated. `values`: rows of `row_tiles` codewords along t, each followed by the
/// row of their means where `has_means`, as Codebook says.
std::size_t packed_bytes(std::span<const std::uint16_t> values,
                         std::size_t row_tiles,
                         bool has_means);

}  // namespace af
