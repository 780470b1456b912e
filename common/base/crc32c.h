// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace af {

/// CRC-32C (Castagnoli) of bytes, as in iSCSI (RFC 3720): "123456789" gives 0xE3069283. `previous`
/// is the CRC of the bytes before these.
std::uint32_t crc32c(std::span<const std::byte> bytes, std::uint32_t previous = 0);

}  // namespace af
