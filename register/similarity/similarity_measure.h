// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "image/image2d.h"

namespace af::registration {

/// Closed interval of image values (total attenuation, dimensionless).
struct ValueRange {
  double low = 0.0;
  double high = 1.0;
};

/// What the DRRs of one view are compared with.
struct SimilarityReference {
  Image2d xray;                    ///< the region of interest only; attenuation domain
  std::vector<std::uint8_t> used;  ///< one per pixel, 0: left out; empty: every pixel counts
  ValueRange drr_range;            ///< of this case's DRRs, the same for every pose

  [[nodiscard]] bool is_used(std::size_t pixel) const { return used.empty() || used[pixel] != 0; }
};

/// Why a reference cannot be compared with anything: empty, mask of another size, no pixel used,
/// constant or non-finite values, empty DRR range; empty when it can.
std::vector<std::string> problems(const SimilarityReference& reference);

/// Scratch memory of one thread; made by the measure it is used with.
class SimilarityWorkspace {
 public:
  virtual ~SimilarityWorkspace() = default;
};

/// Similarity of one view's DRR to its X-ray; higher is more alike. Holds all that can be computed
/// from the X-ray beforehand. evaluate() is const and re-entrant with one workspace per thread; its
/// value depends on nothing but its arguments. Several views are summed by MultiViewObjective
/// (eq. (13)).
class SimilarityMeasure {
 public:
  virtual ~SimilarityMeasure() = default;

  /// `drr`: total attenuation, row-major, as many pixels as the reference.
  [[nodiscard]] virtual double evaluate(std::span<const float> drr,
                                        SimilarityWorkspace& workspace) const = 0;
  [[nodiscard]] virtual std::unique_ptr<SimilarityWorkspace> make_workspace() const = 0;
};

struct SimilarityOptions {
  std::string name = "mi";
  int bins = 64;  ///< per axis of the joint histogram (mi)
};

std::vector<std::string> problems(const SimilarityOptions& options);

/// Names that make_similarity() knows.
std::vector<std::string> similarity_names();

/// InputError when the options or the reference have problems.
std::unique_ptr<SimilarityMeasure> make_similarity(const SimilarityOptions& options,
                                                   const SimilarityReference& reference);

}  // namespace af::registration
