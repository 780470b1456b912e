// SPDX-License-Identifier: Apache-2.0
#include "register/method/presets.h"

#include <array>
#include <string>
#include <utility>

#include "base/named_rows.h"

namespace af::registration {
namespace {

RegistrationOptions one_chain(ChainOptions chain) {
  RegistrationOptions options;
  options.chains = {std::move(chain)};
  return options;
}

/// The two passes of the paper (Sec. III-B2). The paper lost the value of its sigma, and
/// register/README.md says how we chose ours.
RegistrationOptions paper_preset() {
  StageOptions smoothed;
  smoothed.smoothing_sigma_mm = 1.0;
  smoothed.search.initial_step_mm = 5.0;
  smoothed.search.final_step_mm = 0.5;
  StageOptions sharp;
  sharp.search.initial_step_mm = 2.0;
  sharp.search.final_step_mm = 0.1;
  RegistrationOptions options = one_chain({"paper", {smoothed, sharp}});
  options.region_follows_target = false;
  return options;
}

RegistrationOptions fast_preset() {
  return one_chain(chain_from_text("fast",
                                   "ncc gauss-newton level=2 pixels=8 roi=2 step=10;"
                                   "gc gauss-newton level=2 pixels=8 roi=2 final=0.2;"
                                   "gc gauss-newton level=2 pixels=4 final=0.1;"
                                   "gc quasi-newton level=1 pixels=2 step=2 final=0.02"));
}

/// The end of a chain is convincing when it explains this share of the X-rays' gradients. Where
/// X-rays were clean, wrong vertebrae reached 0.51, and right poses 0.69 or more.
constexpr double kConvincingValue = 0.6;

/// Below this a pose does not explain an X-ray well (kWellExplained). When the last resort ran only
/// below 0.2, two starts were lost whose best ends had 0.21 and 0.26. Right poses of 81 patients
/// under every stress at once had 0.298 or more (docs/robust-tuning.md). \test
/// Presets.TheLastResortRunsBelowWhatIsWellExplained
constexpr double kLastResortBelow = 0.3;

/// Every chain ends over the region alone, at level 1. At level 2, steel and scatter have optima of
/// their own there, which the judge cannot undo.
constexpr const char* kOverTheRegion = "rg gauss-newton level=1 pixels=4 final=0.1";

/// Searches widely, by CMA-ES, refines what it found, and ends as every chain of `robust` does.
ChainOptions wide_chain(const std::string& name, const std::string& search) {
  return chain_from_text(name,
                         search +
                             " roi=2 final=1;"
                             "rg gauss-newton level=2 pixels=8 roi=2 final=0.2;" +
                             kOverTheRegion);
}

/// Searches about the best end so far, and ends as every chain of `robust` does.
ChainOptions again_chain(const std::string& name, const std::string& search) {
  return chain_from_text(name, "again: " + search + ";" + kOverTheRegion);
}

/// Three chains search with different measures or at different levels, because each has its deepest
/// optimum in a wrong place for some patients (docs/robust-tuning.md). If no end looks found, a
/// fourth searches more widely, by plain correlation. The others went out of sight from starts far
/// along a long object, or turned far (docs/real-xrays.md, docs/robust-tuning.md). If none
/// convinces, the last two search about the best end, finer than the others, which ended some mm
/// beside it where anatomy moved about the target.
RegistrationOptions robust_preset() {
  ChainOptions far = wide_chain("far", "ncc cma-es level=3 pixels=8 step=20");
  far.only_below = kLastResortBelow;
  RegistrationOptions options;
  options.chains = {
      chain_from_text("edges",
                      std::string("ncc gauss-newton level=2 pixels=8 roi=2 step=10;"
                                  "gc gauss-newton level=2 pixels=8 roi=2 final=0.2;") +
                          kOverTheRegion),
      wide_chain("coarse-edges", "gc cma-es level=3 pixels=8 step=12"),
      wide_chain("wide-edges", "gc cma-es level=2 pixels=16 step=12"),
      far,
      again_chain("again-edges", "gc cma-es level=2 pixels=8 roi=2 step=4 final=1"),
      again_chain("again", "rg nelder-mead level=1 pixels=8 roi=2 step=10 final=1")};
  options.finish = chain_from_text("finish", "rg quasi-newton pixels=2 step=2 final=0.02");
  options.judge.enough_value = kConvincingValue;
  return options;
}

/// The last stage sees every pixel. Where pixels are as large as CT voxels, simulated bones ended
/// 0.3 mm and 1 degree off with pixels=2, and 0.04 mm and 0.1 degrees off with pixels=1
/// (docs/howto/bones.md).
RegistrationOptions bone_preset() {
  return one_chain(
      chain_from_text("bone",
                      "gc gauss-newton level=2 pixels=4 silhouette=6 step=10 final=0.2;"
                      "gc gauss-newton level=1 pixels=2 silhouette=3 final=0.05;"
                      "gc quasi-newton pixels=1 silhouette=3 step=2 final=0.01"));
}

struct Preset {
  const char* name;
  const char* help;
  RegistrationOptions (*make)();
};

constexpr std::array kPresets = {
    Preset{"paper", "mutual information with best neighbour in two passes", paper_preset},
    Preset{"fast", "Gauss-Newton on correlations, coarse to fine", fast_preset},
    Preset{"robust", "several searches, of which a judge takes the best end", robust_preset},
    Preset{"bone", "a CT of one bone, within its silhouette", bone_preset},
};

}  // namespace

std::vector<std::string> preset_names() {
  return names_of(kPresets);
}

std::string preset_help() {
  return help_of(kPresets);
}

RegistrationOptions preset_options(const std::string& name) {
  return required_row(kPresets, "preset", name).make();
}

}  // namespace af::registration
