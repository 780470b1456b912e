// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "ct/attenuation_volume.h"
#include "ct/ct_read_options.h"
#include "ct/ray_caster.h"
#include "geometry/motion_range.h"
#include "precompute/casting/depth_slabs.h"
#include "precompute/casting/unit_planner.h"
#include "precompute/codebook/codebook_training.h"
#include "precompute/codebook/tile_selection.h"
#include "precompute/design/design_presets.h"

namespace af {

/// Default memory limit of a rank, not counting what every node holds once.
inline constexpr std::uint64_t kDefaultMemoryLimitBytes = std::uint64_t{300} << 20;

/// Options of af-precompute: what is cast, how it is compressed, where it goes. Angles are in
/// degrees, as at every interface.
struct PrecomputeOptions {
  // The CT, the camera and the pose about which the CT moves are named one by one ...
  std::string ct;
  CtReadOptions ct_reading;
  std::string rig;
  std::string camera;
  std::vector<double> center_ct_mm;  ///< empty: the CT's centre
  std::string nominal_pose;          ///< file; empty: R0 = identity, at the rig's isocentre
  // ... or by a case of a study.
  std::string study;
  std::string case_name;

  double max_rotation_deg = 10.0;
  double max_translation_mm = 100.0;
  std::string rotation_range_deg;    ///< "rx=-15:15,ry=..."; axes not named: max_rotation_deg
  std::string translation_range_mm;  ///< "tx=..."; axes not named: max_translation_mm
  std::string cover;                 ///< file of poses; the range is taken about each of them
  std::string cover_rig;             ///< further cameras whose rays the field must hold
  std::string orbit;                 ///< "axis=z,from=-90,to=90": an atlas instead of one field
  std::string orbit_cameras;         ///< rig: an atlas with a field for each of its cameras
  /// The design: a preset or a budget, and parts that are stated.
  std::optional<std::string> preset;
  DesignBudget budget;
  std::optional<int> slabs;
  /// "centre", "centroid"; none: the centre for one slab, otherwise the centroid
  std::optional<std::string> st_plane;
  std::optional<int> uv_nodes;
  std::optional<int> st_nodes;
  std::optional<double>
      st_spacing_mm;  ///< instead of st_nodes, which then follow from the planes' sizes
  std::optional<std::string> uv_samples;   ///< "point" or "least-squares"
  std::optional<std::string> tile_filter;  ///< "none" or "neighbours"
  std::optional<std::string> look_up;
  std::optional<std::string> tile_coding;  ///< "plain" or "mean-removed"
  std::optional<int> mean_step;            ///< for mean-removed tiles, levels
  std::string caster = "shear-warp";
  RayCasterOptions ray_caster;  ///< for the trilinear caster
  AttenuationModel attenuation;
  std::string material = "all";  ///< or "bone"

  /// Study of measured X-rays that correct the field. Empty: none.
  std::string projections;
  std::string projections_case;
  double projections_smoothing_px = 0.0;
  std::string projections_common = "keep";  ///< or "remove"

  std::optional<int> codewords;
  std::optional<double> training_fraction;  ///< none: kTrainingTilesPerCodeword decides
  std::uint64_t max_training_tiles = TrainingSelection{}.max_training_tiles;
  std::uint64_t seed = 1;

  std::uint64_t memory_limit_bytes = 0;  ///< per rank besides the CT; 0: kDefaultMemoryLimitBytes
  std::string output;
  std::vector<std::string> mpi_io_hints;  ///< KEY=VALUE
  bool is_dry_run = false;
  bool is_restart = false;
  bool has_checkpoint = true;

  /// The range about one pose. Throws UsageError when its text does not parse.
  [[nodiscard]] MotionRange range() const;
  /// Whether an atlas is made instead of a field.
  [[nodiscard]] bool is_atlas() const { return !orbit.empty() || !orbit_cameras.empty(); }
  /// The parts of the design that are stated.
  [[nodiscard]] DesignParts stated_parts() const;
  /// The requested preset. Without one, the default, or the paper's if parts are stated.
  [[nodiscard]] const DesignPreset& design_preset() const;
  /// Whether a probe of the CT has to choose what is not stated.
  [[nodiscard]] bool needs_probe() const;
  /// The design's budget: the stated one, or the preset's.
  [[nodiscard]] const DesignBudget& limits() const;
  /// The design: that of the preset, with the stated parts replaced.
  [[nodiscard]] FieldDesign design() const { return stated_parts().over(design_preset().design); }
  /// These options with `nodes` instead of the spacing on the (s,t) planes.
  [[nodiscard]] PrecomputeOptions with_st_nodes(int nodes) const;
  /// These options with the design stated.
  [[nodiscard]] PrecomputeOptions with_design(const FieldDesign& design) const;
  [[nodiscard]] TrainingSelection training_selection() const {
    return training_selection(design().codewords);
  }
  [[nodiscard]] TrainingSelection training_selection(int for_codewords) const;
  [[nodiscard]] CodebookOptions codebook_options() const;
  [[nodiscard]] StPlane st_plane_rule() const;
  [[nodiscard]] bool is_of_bone() const { return material == "bone"; }

  void describe(Fields& field);
  /// Fills in the design, unless a probe must choose it, and the rule that places (s,t) planes.
  [[nodiscard]] PrecomputeOptions in_force() const;
};

/// Most nodes along a side of the (u,v) or (s,t) plane.
inline constexpr int kMostPlaneNodes = 4096;

/// Default step of the means of mean-removed tiles, in levels of 65535.
inline constexpr int kDefaultMeanStep = 64;

/// Stages that options can decide.
inline constexpr const char* kCastingStage = "casting";  ///< the samples, with CT, camera and pose
inline constexpr const char* kCodebookStage = "codebook";  ///< what is made of them

/// Training tiles where no share is stated: enough that unseen tiles are coded nearly as well as
/// training tiles (precompute/README.md says what more and fewer give).
inline constexpr std::uint64_t kTrainingTilesPerCodeword = 64;
/// The same for least-squares viewpoints, whose casting takes the time that this saves.
inline constexpr std::uint64_t kFewerTrainingTilesPerCodeword = 32;
/// Upper limit of that default, so that 65536 codewords take at most twice the time of 16384.
inline constexpr std::uint64_t kTrainingTilesUnlessStated = std::uint64_t{1} << 20u;
/// Training ends below this improvement. The paper's single slab keeps the stricter limit, so that
/// its files stay byte-identical. With several slabs, the last iterations gain less than
/// interpolation loses (precompute/README.md).
double min_improvement_of(const FieldDesign& design);

/// Every broken constraint of the values themselves (not of files).
std::vector<std::string> problems(const PrecomputeOptions& options);

}  // namespace af
