// SPDX-License-Identifier: Apache-2.0
#include "register/similarity/similarity_measure.h"

#include <algorithm>
#include <array>
#include <cmath>

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

using MeasurePointer = std::unique_ptr<SimilarityMeasure>;

struct KnownMeasure {
  const char* name;
  const char* help;
  bool has_derivative;
  bool has_normal_equations;
  MeasurePointer (*make)(const SimilarityOptions& options, const SimilarityReference& reference);
};

template <typename Measure>
MeasurePointer make_plain(const SimilarityOptions& /*options*/,
                          const SimilarityReference& reference) {
  return std::make_unique<Measure>(reference);
}
template <typename Measure>
MeasurePointer make_histogram(const SimilarityOptions& options,
                              const SimilarityReference& reference) {
  return std::make_unique<Measure>(reference, options.bins, options.has_smooth_histogram);
}
MeasurePointer make_entropy(const SimilarityOptions& options,
                            const SimilarityReference& reference) {
  return std::make_unique<DifferenceEntropy>(reference, options.bins);
}
MeasurePointer make_tiled(const SimilarityOptions& options, const SimilarityReference& reference) {
  return std::make_unique<TiledCorrelation>(reference, options.tiles);
}
MeasurePointer make_robust(const SimilarityOptions& options, const SimilarityReference& reference) {
  return std::make_unique<RobustGradient>(reference, options.residual_scale);
}

/// Every measure there is; a new one joins here.
constexpr std::array kMeasures = {
    KnownMeasure{"mi", "mutual information", true, false, make_histogram<MutualInformation>},
    KnownMeasure{"nmi",
                 "normalised mutual information",
                 true,
                 false,
                 make_histogram<NormalizedMutualInformation>},
    KnownMeasure{"ncc", "cross-correlation", true, true, make_plain<CrossCorrelation>},
    KnownMeasure{"tncc", "cross-correlation of tiles", false, true, make_tiled},
    KnownMeasure{"gc", "correlation of gradients", true, true, make_plain<GradientCorrelation>},
    KnownMeasure{"gd", "gradient difference", false, false, make_plain<GradientDifference>},
    KnownMeasure{"rg", "robust residuals of gradients", true, true, make_robust},
    KnownMeasure{"pi", "pattern intensity", false, false, make_plain<PatternIntensity>},
    KnownMeasure{"entropy", "entropy of the difference", false, false, make_entropy},
    KnownMeasure{
        "ssd", "sum of squared differences", true, true, make_plain<SumOfSquaredDifferences>},
    KnownMeasure{"go", "gradient orientation", false, false, make_plain<GradientOrientation>},
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

double SimilarityMeasure::evaluate_with_derivative(std::span<const float> /*drr*/,
                                                   std::span<float> /*derivative*/,
                                                   SimilarityWorkspace& /*workspace*/) const {
  check(false, "this similarity measure has no derivative");
  return 0.0;
}

NormalEquations SimilarityMeasure::normal_equations(std::span<const float> /*drr*/,
                                                    std::span<const float> /*planes*/,
                                                    SimilarityWorkspace& /*workspace*/) const {
  check(false, "this similarity measure has no normal equations");
  return {};
}

std::unique_ptr<SimilarityWorkspace> SimilarityMeasure::make_workspace() const {
  return std::make_unique<SimilarityWorkspace>();
}

void SimilarityOptions::describe(Fields& field) {
  field.leave_out(name, "stands before the keys of a stage");
  field("bins", bins, "per axis of the joint histogram (mi, nmi), of the difference (entropy)")
      // Smooth windows are four bins wide.
      .within(has_smooth_histogram ? 4 : 2, kMaxHistogramBins);
  field.leave_out(has_smooth_histogram, "follows from the optimiser");
  field("residual_scale",
        residual_scale,
        "rg: residuals of this many times the typical X-ray gradient count half")
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

std::vector<std::string> similarity_names() {
  return names_of(kMeasures);
}

std::string similarity_help() {
  return help_of(kMeasures);
}

std::string similarity_list() {
  std::string text;
  for (const KnownMeasure& row : kMeasures)
    text += std::string(row.name) + "\t" + (row.has_derivative ? "gradient" : "-") + "\t" +
            (row.has_normal_equations ? "normal-equations" : "-") + "\t" + row.help + "\n";
  return text;
}

bool similarity_has_derivative(const std::string& name) {
  const KnownMeasure* const measure = find_row(kMeasures, name);
  return measure != nullptr && measure->has_derivative;
}

bool similarity_has_normal_equations(const std::string& name) {
  const KnownMeasure* const measure = find_row(kMeasures, name);
  return measure != nullptr && measure->has_normal_equations;
}

std::unique_ptr<SimilarityMeasure> make_similarity(const SimilarityOptions& options,
                                                   const SimilarityReference& reference) {
  throw_if_any(problems(options));
  return find_row(kMeasures, options.name)->make(options, reference);
}

}  // namespace af::registration
