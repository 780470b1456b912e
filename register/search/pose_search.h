// SPDX-License-Identifier: Apache-2.0
// Where a registration starts when nobody knows where the patient lies.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/described_fields.h"
#include "base/thread_pool.h"
#include "geometry/motion_range.h"
#include "geometry/rigid_transform.h"
#include "register/problem/registration_problem.h"

namespace af::registration {

struct PoseSearchOptions {
  int modes = 5;
  std::string orientations = "field";  ///< or "flips" or "any"
  /// Farthest from nominal about and along each axis; none: as far as the fields reach.
  std::optional<std::array<double, 3>> rotation_deg;
  std::optional<std::array<double, 3>> translation_mm;

  void describe(Fields& field);
};

std::vector<std::string> problems(const PoseSearchOptions& options);
/// Options that were given to a program that does not search; `wanted_by`: what makes it search.
std::vector<std::string> problems_without_search(const PoseSearchOptions& options,
                                                 const std::string& wanted_by);

/// Of the image pyramids: the level that the search needs, whatever stages need.
int coarsest_level(const PoseSearchOptions& options);

/// How far apart two poses put the target, mean over its points, mm. With one view, which hardly
/// shows depth, only across the beam.
double seen_distance_mm(const RegistrationProblem& problem,
                        const RigidTransform& a,
                        const RigidTransform& b);

/// Whether two poses are not one place: so far apart, or turned by 30 degrees or more, which moves
/// a small target little. \test PoseSearch.ModesOfASmallTargetDifferByTheirRotation
bool are_apart(const RegistrationProblem& problem,
               const RigidTransform& a,
               const RigidTransform& b,
               double distance_mm);

/// A pose at which DRRs are like the X-rays, and how much: the mean over views of a correlation,
/// at most 1.
struct PoseMode {
  RigidTransform room_from_ct = RigidTransform::Identity();
  double likeness = 0.0;
};

/// Looks for poses everywhere in a range at once. For every rotation of a set, one coarse DRR of
/// each view is correlated with its X-ray at all shifts; the correlations of all views are added on
/// one lattice of translations, so that the views triangulate without a choice among their peaks.
/// Depths along the beam at which a DRR would be seen a pixel larger are compared apart. The
/// steps of rotations and translations follow from the coarse pixels. Registrations reach several
/// steps far, so the search need not be exact. Depends on the problem and the options alone, not on
/// threads or vector width. \test PoseSearch.FindsAPoseAnywhereInItsRange
class PoseSearch {
 public:
  /// `silhouette_mm`: RegistrationOptions::silhouette_mm() of the method that registers; above 0
  /// only what is near to the CT's silhouette is compared. The problem must outlive the search.
  /// InputError where the problem has problems, the options ask for
  /// poses that a view's field does not hold, or an X-ray shows nothing.
  PoseSearch(const RegistrationProblem& problem,
             const PoseSearchOptions& options,
             double silhouette_mm = 0.0,
             std::shared_ptr<ThreadPool> threads = nullptr);
  ~PoseSearch();
  PoseSearch(PoseSearch&&) noexcept;
  PoseSearch& operator=(PoseSearch&&) noexcept;

  /// At most PoseSearchOptions::modes, the likeliest first, each apart from every likelier one.
  /// InputError when nothing is like the X-rays anywhere.
  [[nodiscard]] std::vector<PoseMode> modes() const;

  /// What was asked for, relative to the fields' nominal pose or, without fields, to the study's.
  [[nodiscard]] const MotionRange& range() const;
  [[nodiscard]] std::size_t rotation_count() const;

  /// Along which parameters a mode lies at an end of the range, so that a likelier pose may lie
  /// beyond. Not where the grid has no place between the ends, nor along the beam of a single view,
  /// which hardly shows depth. \test PoseSearch.KnowsWhereItsRangeEnds
  [[nodiscard]] ParameterSet ends_at(const RigidTransform& room_from_ct) const;
  /// The options that search twice as far along these. Empty where the fields do not reach so far.
  [[nodiscard]] std::string options_beyond(const ParameterSet& ends) const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace af::registration
