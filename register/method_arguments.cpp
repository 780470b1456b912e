// SPDX-License-Identifier: Apache-2.0
#include "register/method_arguments.h"

#include <CLI/CLI.hpp>

#include "register/method/presets.h"

namespace af::registration {

void bind_method(CLI::App& app, MethodOptions& options) {
  const char* const group = "Method";
  app.add_option("--preset",
                 options.preset,
                 "Method as a whole; the options below replace parts of it. " + preset_help() +
                     ". Default: robust; paper with --similarity or --optimizer")
      ->check(CLI::IsMember(preset_names()))
      ->group(group);
  app.add_option("--similarity", options.similarity, "Similarity measure of every stage")
      ->check(CLI::IsMember(similarity_names()))
      ->group(group);
  app.add_option("--optimizer", options.optimizer, "Optimiser of every stage")
      ->check(CLI::IsMember(optimizer_names()))
      ->group(group);
  app.add_option("--chain",
                 options.chains,
                 "Stages in place of the preset's, separated by ';': measure, optimiser, then any "
                 "of level=, pixels=, roi=, sigma=, step=, final=, bins=, scale=, tiles=, "
                 "population=. Given several times, the chains are a portfolio: a judge chooses "
                 "among their ends")
      ->take_all()
      ->group(group);
  app.add_option("--finish",
                 options.finish,
                 "Stages, written as for --chain, that follow the chain, or a portfolio's best one "
                 "(default: the preset's; none with --chain)")
      ->group(group);
  app.add_option("--judge",
                 options.judge,
                 "Of a portfolio: what ends are compared by, one stage written as for --chain; its "
                 "measure is rg, its optimiser does not count (default: the preset's)")
      ->group(group);
  app.add_option("--bins", options.bins, "Histogram bins per axis, 2 to 256 (default: 64)")
      ->group(group);
  app.add_option("--smoothing-sigma-mm",
                 options.smoothing_sigma_mm,
                 "First stage: Gaussian on the X-rays, mm on the isocentre plane (paper: 1)")
      ->group(group);
  app.add_option("--coarse-roi-scale",
                 options.coarse_roi_scale,
                 "Coarse stages look at this many times the region's sides (fast, robust: 2), "
                 "cut at the detector's edges. A field holds every ray of its camera's whole "
                 "detector, so none is made for it")
      ->group(group);
  app.add_option("--max-evaluations",
                 options.max_evaluations,
                 "Most poses tried per registration (default: 5000)")
      ->group(group);
  app.add_option("--fiducial-mask-mm",
                 options.fiducial_mask_mm,
                 "Radius of the discs about the study's fiducials that registration does not see, "
                 "mm on the isocentre plane: the markers of the gold standard must neither help "
                 "nor hinder what it judges. 0: it sees them")
      ->capture_default_str()
      ->group(group);
  app.add_option("--threads",
                 options.threads,
                 "Threads that one registration spreads over, on every rank; 0: as many as there "
                 "are processors for the rank. Many starts are better shared by ranks")
      ->capture_default_str()
      ->group(group);
}

}  // namespace af::registration
