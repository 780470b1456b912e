// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/similarity_measure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <type_traits>

#include "base/named_rows.h"
#include "base/number_text.h"
#include "register/similarity/cross_correlation.h"
#include "register/similarity/difference_entropy.h"
#include "register/similarity/gradient_correlation.h"
#include "register/similarity/gradient_difference.h"
#include "register/similarity/gradient_orientation.h"
#include "register/similarity/mutual_information.h"
#include "register/similarity/pattern_intensity.h"
#include "register/similarity/robust_gradient.h"
#include "register/similarity/sum_of_squared_differences.h"
#include "register/similarity/tiled_correlation.h"

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

template <typename Measure>
std::unique_ptr<Measure> plain(const SimilarityOptions& /*options*/,
                               const SimilarityReference& reference) {
  return std::make_unique<Measure>(reference);
}
template <typename Measure>
std::unique_ptr<Measure> histogram(const SimilarityOptions& options,
                                   const SimilarityReference& reference) {
  return std::make_unique<Measure>(reference, options.bins, options.has_smooth_histogram);
}
std::unique_ptr<DifferenceEntropy> entropy(const SimilarityOptions& options,
                                           const SimilarityReference& reference) {
  return std::make_unique<DifferenceEntropy>(reference, options.bins);
}
std::unique_ptr<TiledCorrelation> tiled(const SimilarityOptions& options,
                                        const SimilarityReference& reference) {
  return std::make_unique<TiledCorrelation>(reference, options.tiles);
}
std::unique_ptr<RobustGradient> robust(const SimilarityOptions& options,
                                       const SimilarityReference& reference) {
  return std::make_unique<RobustGradient>(reference, options.residual_scale);
}

/// The row of a maker. Its return type says what the measure can do.
template <auto make>
constexpr KnownMeasure row(const char* name, const char* help) {
  using Measure = typename std::invoke_result_t<decltype(make),
                                                const SimilarityOptions&,
                                                const SimilarityReference&>::element_type;
  return {name,
          help,
          std::derived_from<Measure, DifferentiableMeasure>,
          std::derived_from<Measure, LeastSquaresMeasure>,
          [](const SimilarityOptions& options, const SimilarityReference& reference)
              -> std::unique_ptr<SimilarityMeasure> { return make(options, reference); }};
}

/// Every measure. A new one is added here.
constexpr std::array kMeasures = {
    row<histogram<MutualInformation>>("mi", "mutual information"),
    row<histogram<NormalizedMutualInformation>>("nmi", "normalised mutual information"),
    row<plain<CrossCorrelation>>("ncc", "cross-correlation"),
    row<tiled>("tncc", "cross-correlation of tiles"),
    row<plain<GradientCorrelation>>("gc", "correlation of gradients"),
    row<plain<GradientDifference>>("gd", "gradient difference"),
    row<robust>("rg", "robust residuals of gradients"),
    row<plain<PatternIntensity>>("pi", "pattern intensity"),
    row<entropy>("entropy", "entropy of the difference"),
    row<plain<SumOfSquaredDifferences>>("ssd", "sum of squared differences"),
    row<plain<GradientOrientation>>("go", "gradient orientation"),
};

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
    found.push_back("the region of interest of the DRR at the nominal pose is empty (" +
                    number_text(range.low) + " to " + number_text(range.high) +
                    "): the CT must project into it");
  return found;
}

NormalEquations& NormalEquations::operator+=(const NormalEquations& other) {
  value += other.value;
  gradient += other.gradient;
  matrix += other.matrix;
  reweighting += other.reweighting;
  return *this;
}

std::unique_ptr<SimilarityWorkspace> SimilarityMeasure::make_workspace() const {
  return std::make_unique<SimilarityWorkspace>();
}

void SimilarityOptions::describe(Fields& field) {
  field.leave_out(name, "stands before the keys of a stage");
  field("bins", bins, "of the histogram (mi, nmi, entropy)")
      // Smooth windows are four bins wide.
      .within(has_smooth_histogram ? 4 : 2, kMaxHistogramBins);
  field.leave_out(has_smooth_histogram, "follows from the optimiser");
  field("residual_scale", residual_scale, "rg: residuals of this many typical gradients count half")
      .as("scale")
      .above(0.0)
      .finite();
  field("tiles", tiles, "tncc: per axis").within(1, 64);
}

std::vector<std::string> similarity_name_problems(const std::string& name) {
  if (find_row(kMeasures, name) != nullptr) return {};
  return {unknown_name_text(kMeasures, "similarity", name)};
}

std::vector<std::string> problems(const SimilarityOptions& options) {
  std::vector<std::string> found = similarity_name_problems(options.name);
  for (const std::string& text : field_problems(options)) found.push_back(text);
  return found;
}

std::span<const KnownMeasure> known_measures() {
  return kMeasures;
}

const KnownMeasure& known_measure(const std::string& name) {
  return required_row(kMeasures, "similarity", name);
}

std::vector<std::string> similarity_names() {
  return names_of(kMeasures);
}

std::string similarity_help() {
  return help_of(kMeasures);
}

std::unique_ptr<SimilarityMeasure> make_similarity(const SimilarityOptions& options,
                                                   const SimilarityReference& reference) {
  throw_if_any(problems(options));
  return known_measure(options.name).make(options, reference);
}

}  // namespace af::registration
