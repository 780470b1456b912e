// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/similarity_measure.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "register/similarity/cross_correlation.h"
#include "register/similarity/mutual_information.h"

namespace af::registration {
namespace {

std::string pixel_count_text(const Image2d& image) {
  return std::to_string(image.width) + " x " + std::to_string(image.height);
}

void append_value_problems(const SimilarityReference& reference, std::vector<std::string>& found) {
  std::size_t used = 0;
  bool finite = true;
  float low = 0.0f;
  float high = 0.0f;
  for (std::size_t i = 0; i < reference.xray.pixels.size(); ++i) {
    if (!reference.is_used(i)) continue;
    const float value = reference.xray.pixels[i];
    finite = finite && std::isfinite(value);
    low = used == 0 ? value : std::min(low, value);
    high = used == 0 ? value : std::max(high, value);
    ++used;
  }
  if (used == 0) {
    found.emplace_back(
        "mask = all zero inside the region of interest: at least one pixel must count");
  } else if (!finite) {
    found.emplace_back("X-ray = NaN or infinite inside the region of interest: must be finite");
  } else if (!(high > low)) {
    found.emplace_back("X-ray = constant inside the region of interest: must vary");
  }
}

}  // namespace

std::vector<std::string> problems(const SimilarityReference& reference) {
  std::vector<std::string> found;
  const Image2d& xray = reference.xray;
  const RegionOfInterest whole{0, 0, xray.width, xray.height};
  if (xray.width <= 0 || xray.height <= 0 || xray.pixels.size() != whole.pixel_count()) {
    found.push_back("X-ray region = " + pixel_count_text(xray) + " pixels: must not be empty");
  } else if (!reference.used.empty() && reference.used.size() != xray.pixels.size()) {
    found.push_back("mask = " + std::to_string(reference.used.size()) + " pixels: must have the " +
                    pixel_count_text(xray) + " of the region of interest");
  } else {
    append_value_problems(reference, found);
  }
  const ValueRange& range = reference.drr_range;
  if (!std::isfinite(range.low) || !std::isfinite(range.high) || !(range.high > range.low))
    found.push_back("DRR range = [" + std::to_string(range.low) + ", " +
                    std::to_string(range.high) +
                    "]: must be finite and not empty (does the CT project into the region of "
                    "interest at the nominal pose?)");
  return found;
}

std::vector<std::string> problems(const SimilarityOptions& options) {
  std::vector<std::string> found;
  const std::vector<std::string> names = similarity_names();
  if (std::find(names.begin(), names.end(), options.name) == names.end()) {
    std::string list;
    for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
    found.push_back("similarity = '" + options.name + "': must be one of " + list);
  }
  if (options.bins < 2 || options.bins > kMaxHistogramBins)
    found.push_back("bins = " + std::to_string(options.bins) + ": must be 2 ... " +
                    std::to_string(kMaxHistogramBins));
  return found;
}

std::vector<std::string> similarity_names() {
  return {"mi", "ncc"};
}

std::unique_ptr<SimilarityMeasure> make_similarity(const SimilarityOptions& options,
                                                   const SimilarityReference& reference) {
  throw_if_any(problems(options));
  if (options.name == "ncc") return std::make_unique<CrossCorrelation>(reference);
  return std::make_unique<MutualInformation>(reference, options.bins);
}

}  // namespace af::registration
