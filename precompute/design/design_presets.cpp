// SPDX-License-Identifier: Apache-2.0
#include "precompute/design/design_presets.h"

#include <array>

#include "base/named_rows.h"

namespace af {
namespace {

constexpr std::int64_t kMegabyte = 1000000;

/// Every preset. A new one is added here.
const std::array presets = {
    DesignPreset{
        kPaperPreset, "one slab of 64 x 64 x 256 x 256 nodes", {1, 64, 256, 16384, "linear"}, {}},
    DesignPreset{"compact",
                 "the best within 4 MB by a probe of the CT",
                 {12, 8, 256, 16384, "cubic"},
                 {std::nullopt, 4 * kMegabyte, std::nullopt}},
    // For registration, depth slabs matter more than PSNR. With the one slab that a probe chose at
    // the same PSNR, registrations ended twice as far from ray casting's pose.
    DesignPreset{"standard",
                 "for registration, six slabs of 14 x 14 x 384 x 384 nodes",
                 {6, 14, 384, 4096, "cubic", 96, true, true},
                 {}},
    // One codebook serves every angle. With 4096 codewords the worst DRRs lost 1.7 dB compared with
    // those of an angle's own field (docs/other-cameras.md#what-an-atlas-costs).
    DesignPreset{kAtlasPreset,
                 "eight slabs of 12 x 12 x 384 x 384 nodes",
                 {8, 12, 384, 16384, "cubic", 64},
                 {}},
    DesignPreset{"fine",
                 "the best within 15 MB by a probe of the CT",
                 {12, 10, 512, 65536, "cubic"},
                 {std::nullopt, 15 * kMegabyte, std::nullopt}},
};

}  // namespace

const DesignPreset& design_preset_named(const std::string& name) {
  return required_row(presets, "preset", name);
}

std::vector<std::string> design_preset_names() {
  return names_of(presets);
}

std::string design_preset_help() {
  return help_of(presets);
}

}  // namespace af
