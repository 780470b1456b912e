// SPDX-License-Identifier: Apache-2.0
// One view of a pose search: where translations are seen in its X-ray.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "drr/drr_renderer.h"
#include "register/problem/registration_problem.h"
#include "register/search/edge_image.h"
#include "register/search/translation_lattice.h"

namespace af::registration {

/// Coarse pixels of about so many across the longer side of what is compared, in mm on the
/// isocentre plane: the same in all views, as the widest needs them.
/// `silhouette_mm`: as in searched_view().
double pixel_mm_of(const RegistrationProblem& problem, int pixels_across, double silhouette_mm);

/// What a search needs of a view, but for rotations.
struct SearchedView {
  /// Where a translation is seen: at which depth, and where among the shifts of the pattern.
  struct Place {
    int depth = 0;
    int column = 0;      ///< of the shift to the left and above
    int row = 0;         ///< likewise
    float right = 0.0f;  ///< from there, in shifts
    float below = 0.0f;
  };
  /// Which depths and shifts show some translations.
  struct Part {
    ShiftWindow window;
    int first_depth = 0;
    int depths = 0;

    [[nodiscard]] std::size_t size() const {
      return window.size() * static_cast<std::size_t>(depths);
    }
  };

  View pattern;  ///< coarse: what a DRR shows
  std::shared_ptr<const DrrRenderer> renderer;
  EdgeImage xray;
  /// Room: unit, from the source to the centre at the lattice's middle.
  Eigen::Vector3d along_beam = Eigen::Vector3d::UnitZ();
  double distance_mm = 0.0;  ///< that far
  /// Mm along the beam from the lattice's middle, where a DRR is seen larger or smaller.
  Steps depths{0.0, 0.0, 1.0};
  std::vector<Place> places;  ///< of the lattice's nodes; shifts are pixels of `xray`
  /// How near to the CT's silhouette, in coarse pixels, an edge counts; 0: all count.
  double silhouette_px = 0.0;
  std::vector<std::int16_t> xray_squares;  ///< quarter_squares(), where silhouettes are compared

  /// `nodes`: of the lattice, at least one.
  [[nodiscard]] Part part(std::span<const std::size_t> nodes) const;
  /// How alike a DRR and the X-ray are at every shift and depth of a part, depth by depth. `drr`:
  /// of the pattern, with the centre at the lattice's middle. `cuts_px`: where the CT ends in it
  /// and the body goes on. A DRR from farther away is the same, but smaller: parallax within the CT
  /// changes too little to be seen by coarse pixels.
  void compare(const Part& part,
               const Image2d& drr,
               std::span<const Eigen::Vector2d> cuts_px,
               std::span<float> likeness) const;
  /// Adds to the sum of every node the likeness where it is seen, interpolated between shifts.
  /// `likeness`: by compare() of the same part.
  void add_likeness(const Part& part,
                    std::span<const std::size_t> nodes,
                    std::span<const float> likeness,
                    std::span<float> sums) const;
};

/// `center`: room, the centre of rotations at no translation. `silhouette_mm`: how near to the CT's
/// silhouette an edge counts, for a CT of one bone among others; 0: all count. InputError when a
/// translation brings the centre near the source, or the X-ray shows nothing.
SearchedView searched_view(const RegistrationProblem& problem,
                           const Eigen::Vector3d& center,
                           const RegistrationView& view,
                           const TranslationLattice& lattice,
                           double pixel_mm,
                           double silhouette_mm);

}  // namespace af::registration
