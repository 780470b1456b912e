// SPDX-License-Identifier: Apache-2.0
// Registration of one case of a study, as af-register does it.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "attenuation_fields/beam.h"
#include "attenuation_fields/export.h"
#include "attenuation_fields/geometry.h"
#include "attenuation_fields/renderer.h"

namespace attenuation_fields {

/// The names of the presets, and a line that explains them.
[[nodiscard]] ATTENUATION_FIELDS_API std::vector<std::string> preset_names();
[[nodiscard]] ATTENUATION_FIELDS_API std::string preset_help();

/// The options of af-register with the same names.
struct RegistrationOptions {
  std::string preset = {};                                   ///< empty: robust
  std::string renderer = "field";                            ///< "field" or "raycast"
  std::map<std::string, std::filesystem::path> fields = {};  ///< camera -> field; not the study's
  /// camera -> field that is open already; replaces `fields`. Cases share what registration needs
  /// of it. It is neither read nor decoded again, whatever becomes of its file, and keeps what was
  /// decoded. An atlas's members are read again, but only from the file that was opened. Its
  /// look-up, camera, threads and beam apply only to its own DRRs.
  std::map<std::string, Field> opened_fields = {};
  std::vector<std::string> chains = {};        ///< replaces the preset's chains
  std::optional<std::string> similarity = {};  ///< for every stage
  std::optional<std::string> optimizer = {};   ///< for every stage
  std::optional<int> max_evaluations = {};
  std::optional<std::string> region = {};  ///< "target" or "study"
  bool correct = false;                    ///< corrects the end by ray casting
  bool skip_ct_check = false;              ///< with fields: the CT is not read
  double water_mu_per_mm = 0.0200;         ///< for ray casting
  int air_below_hu = -900;
  double step_mm = 1.0;
  std::uint64_t seed = 1;
  bool no_uncertainty = false;  ///< no covariance and no TREs; the confidence is then a lower bound
  double calibration_error_px = 0.0;  ///< in every view's shift; covariances include it
  int threads = 1;                    ///< for one registration; 0: every processor
};

/// The options --search-... of af-register.
struct SearchOptions {
  int modes = 5;                               ///< how many poses are wanted, at most 100
  std::string orientations = "field";          ///< "field", "flips" or "any"
  std::optional<Vector3> rotation_deg = {};    ///< farthest from nominal about each axis
  std::optional<Vector3> translation_mm = {};  ///< likewise along each axis
};

/// A pose at which DRRs are like the X-rays.
struct PoseMode {
  Pose pose;
  double likeness = 0.0;  ///< the mean over views of a correlation, at most 1
};

/// Shares of an X-ray's gradients that the DRR at a pose explains, 0 to 1. NaN: not judged.
struct ViewAgreement {
  std::string camera;
  double coarse = 0.0;
  double fine = 0.0;
};

/// An X-ray of a case: the whole detector, row by row. The spans live as long as their `owner`.
struct CaseView {
  Camera camera;
  std::array<int, 4> roi_px{};  ///< region of interest: column, row, width, height
  std::span<const float> xray;  ///< in the attenuation domain: bright is attenuated
  std::span<const float> mask;  ///< non-zero is used; empty: every pixel
  std::shared_ptr<const void> owner;
};

/// What a registration says about its own error. NaN where it cannot be said.
struct Uncertainty {
  /// For (rx, ry, rz, tx, ty, tz), deg and mm. The true pose is a motion after the pose that was
  /// found, about the centre of the region of interest, along the room's axes.
  std::array<std::array<double, 6>, 6> covariance{};
  /// Expected over the target box. TREs are calibrated separately: from the covariance, which must
  /// hold the truth in all six directions, they would be larger.
  double tre_rms_mm = 0.0;
  double tre_95_mm = 0.0;   ///< the TRE stays below this with a probability of 0.95
  double confidence = 0.0;  ///< probability of a TRE below 2.5 mm; a lower bound without TREs
};

struct Registration {
  std::int64_t start_index = 0;
  Pose start;
  Pose pose;                                 ///< the end
  std::array<double, 6> start_parameters{};  ///< deg, mm; relative to RegistrationCase::frame()
  std::array<double, 6> parameters{};        ///< likewise, at the end
  std::string verdict;                       ///< "found", "doubtful" or "not found"
  std::string reason;                        ///< of the verdict
  double similarity = 0.0;                   ///< NaN when there is none
  std::string chain;
  std::string stop_reason;
  std::int64_t evaluations = 0;
  std::int64_t inadmissible = 0;
  std::int64_t drr_count = 0;
  std::vector<ViewAgreement> views;
  Uncertainty uncertainty;
  std::optional<double> initial_tre_mm;  ///< when the case's gold pose is known
  std::optional<double> tre_mm;
  double seconds = 0.0;
};

/// A case of a study, with everything that its registrations need: X-rays, fields or CT. Only one
/// call runs at a time; calls from other threads wait. Copies are the same case.
class ATTENUATION_FIELDS_API RegistrationCase {
 public:
  /// An empty `case_name` picks the only case. Throws InputError and FileError.
  static RegistrationCase load(const std::filesystem::path& study,
                               const std::string& case_name = "",
                               const RegistrationOptions& options = {});
  /// The same with DRRs of a beam: Field::open() and RayCaster say what it needs.
  static RegistrationCase load(const std::filesystem::path& study,
                               const std::string& case_name,
                               const RegistrationOptions& options,
                               const Beam& beam);

  /// Registers other X-rays from now on, of one camera or of several. Fields and CT stay as they
  /// are. An X-ray holds the values of the whole detector, row by row, in the domain that the
  /// study's `xray_domain` says. They are checked and prepared as if the study's file had held them
  /// (without a header such as DICOM's): the study's air level, flat and dark fields, distortion,
  /// mask and fiducials apply. Registrations have the same bits as a case that was loaded with
  /// them. Start and gold standard remain the study's.
  /// Returns what is odd about them. When it throws InputError, the case is as it was before.
  std::vector<std::string> set_xray(const std::string& camera, std::span<const float> xray);
  std::vector<std::string> set_xrays(const std::map<std::string, std::span<const float>>& xrays);

  [[nodiscard]] const std::string& name() const;
  /// The views with their current X-rays.
  [[nodiscard]] std::vector<CaseView> views() const;
  /// Nominal pose, about the centre of the region of interest.
  [[nodiscard]] const PoseFrame& frame() const;
  /// What is odd about the study.
  [[nodiscard]] const std::vector<std::string>& warnings() const;
  /// The pose from which errors are measured, when the study knows one.
  [[nodiscard]] std::optional<Pose> gold() const;
  /// Mean distance (mm) over the target box between where a pose and the gold pose put its points.
  [[nodiscard]] std::optional<double> tre_mm(const Pose& pose) const;

  /// The pose from the landmarks that the study states in CT and X-rays. nullopt when it states
  /// none. Throws InputError when no pose fits them.
  [[nodiscard]] std::optional<Pose> landmark_start() const;
  /// Where af-register starts when it is given no start: at landmark_start(), or else at the
  /// nominal pose. Throws InputError as landmark_start() does.
  [[nodiscard]] Pose usual_start() const;

  /// Poses from which to register when nobody knows a start: those from which `af-register --start
  /// search` registers, to the bit. The likeliest comes first. Throws InputError for options that a
  /// field does not hold, and when nothing is like the X-rays.
  [[nodiscard]] std::vector<PoseMode> search(const SearchOptions& options = {}) const;

  /// Registers from a start. `start_index` is a key of random numbers. The result is what
  /// af-register writes into result.json, to the bit (except its seconds).
  [[nodiscard]] Registration run(const Pose& start, std::int64_t start_index = 0) const;
  /// Registers from many starts. The start_index of each is its position. Verdicts are as in
  /// registrations.csv: the X-rays are not examined, which may turn a verdict from found to
  /// doubtful. af-register examines those of the best result, and run() those of its own.
  [[nodiscard]] std::vector<Registration> run_all(std::span<const Pose> starts) const;
  /// The similarity by which results are compared, at a pose. nullopt where the pose is
  /// inadmissible.
  [[nodiscard]] std::optional<double> similarity(const Pose& pose) const;

 private:
  struct Impl;
  explicit RegistrationCase(std::shared_ptr<Impl> impl);
  std::shared_ptr<Impl> impl_;
};

}  // namespace attenuation_fields
