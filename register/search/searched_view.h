// SPDX-License-Identifier: Apache-2.0
// One view of a pose search: where translations are seen in its X-ray.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "drr/drr_renderer.h"
#include "geometry/motion_range.h"
#include "register/problem/registration_problem.h"
#include "register/search/edge_image.h"

namespace af::registration {

/// Equal steps from one number to another, at most so wide; where they are equal, that number.
struct Steps {
  double first = 0.0;
  double step = 0.0;
  int count = 1;

  Steps(double low, double high, double widest);
  [[nodiscard]] double at(int i) const { return first + i * step; }
  [[nodiscard]] int nearest(double value) const;
};

/// Translations (room, mm) on a lattice over a range, x fastest.
struct TranslationLattice {
  std::array<Steps, 3> axes;

  /// InputError for more than four million translations.
  TranslationLattice(const MotionRange& range, double step_mm);

  [[nodiscard]] std::size_t size() const;
  [[nodiscard]] Eigen::Vector3d translation(std::size_t index) const;
  [[nodiscard]] Eigen::Vector3d middle() const;
  /// Whether no neighbour along an axis has a larger value.
  [[nodiscard]] bool is_maximum(std::span<const float> values, std::size_t index) const;

 private:
  [[nodiscard]] std::array<int, 3> node(std::size_t index) const;
};

/// Coarse pixels of about so many across the longer side of what is compared, in mm on the
/// isocentre plane: the same in all views, as the widest needs them.
double pixel_mm_of(const RegistrationProblem& problem, int pixels_across);

/// What a search needs of a view, but for rotations.
struct SearchedView {
  /// Where a translation is seen: which DRR's correlations, and where in them.
  struct Place {
    int layer = 0;
    std::uint32_t shift = 0;  ///< the one to the left and above
    float right = 0.0f;       ///< from there, in shifts
    float below = 0.0f;
  };

  View pattern;  ///< coarse: what a DRR shows
  std::shared_ptr<const DrrRenderer> renderer;
  EdgeImage xray;
  Eigen::Vector3d along_beam;  ///< room: unit, from the source to the centre at the middle
  /// Of DRRs, mm along the beam from the lattice's middle: nearer and farther ones are seen larger
  /// and smaller.
  Steps depths;
  ShiftWindow shift_window;   ///< of the pattern in `xray`
  std::vector<Place> places;  ///< of the lattice's translations

  [[nodiscard]] std::size_t shifts() const { return shift_window.size(); }
  /// Adds to every translation's sum the likeness where it is seen, interpolated between shifts.
  /// `likeness`: of all shifts, DRR by DRR.
  void add_likeness(std::span<const float> likeness, std::span<float> sums) const;
};

/// `center`: room, the centre of rotations at no translation. InputError when a translation brings
/// it near the source, or the X-ray shows nothing.
SearchedView searched_view(const RegistrationProblem& problem,
                           const Eigen::Vector3d& center,
                           const RegistrationView& view,
                           const TranslationLattice& lattice,
                           double pixel_mm);

}  // namespace af::registration
