// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "register/method/correction.h"
#include "register/optimizer/optimizer.h"
#include "register/similarity/similarity_measure.h"

namespace af::registration {

/// Coarsest level of an image pyramid.
inline constexpr int kCoarsestLevel = 3;

/// One stage of a chain: what is compared, how finely, and how it is searched.
struct StageOptions {
  int level = 0;
  int pixel_step = 1;
  double roi_scale = 1.0;
  double smoothing_sigma_mm = 0.0;
  double silhouette_mm = 0.0;  ///< 0: the whole region counts
  SimilarityOptions similarity;
  std::string optimizer = "best-neighbor";
  OptimizerOptions search;  ///< steps in mm of mean projected motion

  /// Its options are the keys of chain_text().
  void describe(Fields& field);
};

std::vector<std::string> problems(const StageOptions& stage);

/// Stages from coarse to fine. Each starts where the one before ended.
struct ChainOptions {
  std::string name;
  std::vector<StageOptions> stages;
  /// In a portfolio, a last resort: the chain runs only if the judge scores the best end of the
  /// earlier chains below this (mean over views). Infinity: it always runs.
  double only_below = std::numeric_limits<double>::infinity();
  /// In a portfolio: starts from the best end of the earlier chains instead of the registration's
  /// start.
  bool from_best_end = false;

  [[nodiscard]] bool is_last_resort() const {
    return only_below < std::numeric_limits<double>::infinity();
  }
};

/// A chain as one line. Stages are separated by ';', and each is a measure and an optimiser
/// followed by key=value, for example
///
///     ncc gauss-newton level=2 pixels=8 roi=2 step=10 final=0.5; gc gauss-newton level=1 pixels=2
///
/// Keys are the options that StageOptions describes. A last resort begins with the value that calls
/// it: "below 0.2: ncc cma-es ...". Then "again: " may follow, which starts the chain from the best
/// end.
std::string chain_text(const ChainOptions& chain);

/// Parses the line of a chain. Throws InputError for a line of another form; problems() checks the
/// values. \test ChainText.ReadsWhatItWrites
ChainOptions chain_from_text(const std::string& name, const std::string& text);

/// The keys of a chain's line and their meanings, for --help.
std::string chain_keys_help();

/// How a portfolio chooses among the ends of its chains: by the value of rg, the share of the
/// X-rays' gradients that a DRR explains.
struct JudgeOptions {
  StageOptions stage;         ///< its optimiser is not used
  double least_value = 0.0;   ///< mean over views; at or below it the registration has failed
  double enough_value = 1.0;  ///< mean over views; an end at or above it ends the portfolio

  JudgeOptions();
};

/// Silhouettes leave out the edges where a CT is cut.
inline constexpr const char* kSilhouettesNeedTheCt =
    "skip_ct_check = set: must be left out where a stage looks within the CT's silhouette, because "
    "the CT says where it is cut";

/// How to register: one chain, or a portfolio of several.
struct RegistrationOptions {
  std::vector<ChainOptions> chains;
  /// Stages that follow the chain, or that follow a portfolio's best end and those that the judge
  /// can hardly tell from it. May be empty.
  ChainOptions finish;
  JudgeOptions judge;          ///< for a portfolio; not used with one chain
  int max_evaluations = 5000;  ///< pose evaluations per registration, all chains together
  std::uint64_t seed = 1;      ///< for optimisers that draw random numbers
  /// Whether problems should have regions that follow the target (region_at()).
  bool region_follows_target = true;
  CorrectionOptions correction;

  /// Replaces the measure, or the optimiser, of every stage.
  void use_similarity(const std::string& name);
  void use_optimizer(const std::string& name);
  /// Names of the measures, or of the optimisers, in the order of stages, each once: "ncc, gc".
  [[nodiscard]] std::string similarity_list() const;
  [[nodiscard]] std::string optimizer_list() const;
  /// The measure whose values are the similarities of results.
  [[nodiscard]] std::string final_similarity() const;
  /// Margin of the last stage's silhouettes; 0: it compares the whole region.
  [[nodiscard]] double silhouette_mm() const;
  /// Highest level of any stage.
  [[nodiscard]] int coarsest_level() const;
  /// Levels of the stages that a registration can end with, ascending. A correction casts rays
  /// there.
  [[nodiscard]] std::vector<int> last_levels() const;

 private:
  /// Stages of all chains, then of the finish.
  [[nodiscard]] std::vector<const StageOptions*> stages() const;
  [[nodiscard]] std::vector<StageOptions*> stages();
};

std::vector<std::string> problems(const RegistrationOptions& options);

}  // namespace af::registration
