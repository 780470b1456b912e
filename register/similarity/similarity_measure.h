// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "base/described_fields.h"
#include "xray/image2d.h"

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

/// Why a reference cannot be compared with anything: it is empty, its mask has another size, no
/// pixel is used, values are constant or not finite, or the DRR range is empty. Empty when it can.
std::vector<std::string> problems(const SimilarityReference& reference);

/// Scratch memory of one thread, made by the measure that uses it.
class SimilarityWorkspace {
 public:
  virtual ~SimilarityWorkspace() = default;
};

/// Values that belong to six pose parameters.
using PoseVector = Eigen::Matrix<double, 6, 1>;
using PoseMatrix = Eigen::Matrix<double, 6, 6>;

/// A similarity near a pose, as Gauss and Newton see it: S(p + h) ~ value + gradient h - h' matrix
/// h / 2. Residuals are taken as linear in h and their weights as constant, so that `matrix` is
/// positive semi-definite. Where larger residuals count less, S curves less, as `matrix` -
/// `reweighting` says, which may bend upwards. Second derivatives of the DRR are left out, and so
/// is a term of the eliminated gain that vanishes with the gradient.
struct NormalEquations {
  double value = 0.0;
  PoseVector gradient = PoseVector::Zero();
  PoseMatrix matrix = PoseMatrix::Zero();
  PoseMatrix reweighting = PoseMatrix::Zero();

  NormalEquations& operator+=(const NormalEquations& other);
};

/// Similarity of one view's DRR to its X-ray; higher is more alike. Holds everything that can be
/// computed from the X-ray beforehand. Calls are const, and re-entrant with one workspace per
/// thread. Their values depend only on their arguments. MultiViewObjective sums several views (eq.
/// (13)).
class SimilarityMeasure {
 public:
  virtual ~SimilarityMeasure() = default;

  /// `drr`: total attenuation, row-major, as many pixels as the reference.
  [[nodiscard]] virtual double evaluate(std::span<const float> drr,
                                        SimilarityWorkspace& workspace) const = 0;

  /// Has no memory, for measures that need none.
  [[nodiscard]] virtual std::unique_ptr<SimilarityWorkspace> make_workspace() const;
};

/// A measure that changes smoothly with every DRR pixel.
class DifferentiableMeasure : public virtual SimilarityMeasure {
 public:
  /// Returns the value, which is evaluate()'s up to rounding. `derivative` (as many pixels)
  /// receives its derivative with respect to every DRR pixel.
  virtual double evaluate_with_derivative(std::span<const float> drr,
                                          std::span<float> derivative,
                                          SimilarityWorkspace& workspace) const = 0;
};

/// A sum of squared residuals. It may lack a derivative with respect to every pixel.
class LeastSquaresMeasure : public virtual SimilarityMeasure {
 public:
  /// `planes`: derivatives of every DRR pixel with respect to six parameters, six planes one after
  /// the other.
  [[nodiscard]] virtual NormalEquations normal_equations(std::span<const float> drr,
                                                         std::span<const float> planes,
                                                         SimilarityWorkspace& workspace) const = 0;
};

struct SimilarityOptions {
  std::string name = "mi";  ///< for the stages of `paper`; those of chains state theirs
  int bins = 64;
  /// For mi and nmi: DRR values are counted through cubic B-spline windows, which makes the measure
  /// differentiable. Optimisers that need derivatives set it.
  bool has_smooth_histogram = false;
  double residual_scale = 1.0;
  int tiles = 4;

  void describe(Fields& field);
};

/// One problem that lists the known names, or none.
std::vector<std::string> similarity_name_problems(const std::string& name);
std::vector<std::string> problems(const SimilarityOptions& options);

/// What is known of a measure before it has a reference. The type of its maker says what it can do.
struct KnownMeasure {
  const char* name;
  const char* help;
  bool is_differentiable;  ///< made as a DifferentiableMeasure
  bool is_least_squares;   ///< made as a LeastSquaresMeasure
  std::unique_ptr<SimilarityMeasure> (*make)(const SimilarityOptions& options,
                                             const SimilarityReference& reference);
};
/// Every measure.
std::span<const KnownMeasure> known_measures();
/// The measure of that name. Throws InputError that lists the known names.
const KnownMeasure& known_measure(const std::string& name);

/// Names that make_similarity() knows, and one line that explains them.
std::vector<std::string> similarity_names();
std::string similarity_help();

/// Throws InputError when the options or the reference have problems.
std::unique_ptr<SimilarityMeasure> make_similarity(const SimilarityOptions& options,
                                                   const SimilarityReference& reference);

}  // namespace af::registration
