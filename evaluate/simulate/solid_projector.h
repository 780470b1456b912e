// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "drr/tissue_model.h"
#include "evaluate/simulate/phantom_parts.h"
#include "evaluate/simulate/ray_integrator.h"
#include "evaluate/simulate/smooth_motion.h"

namespace af {

/// Line integrals through bodies themselves, without voxels: the surfaces that a ray crosses in
/// closed form (those of a waist by bisection to 1e-6 mm), between them the body that was painted
/// last, textures by the midpoints of steps of at most 1.5 mm. So X-rays share no voxel grid with
/// the CT that registers them. With a motion the ray is followed through the anatomy as a polyline,
/// one piece every 8 mm. Ends at the faces of the phantom's volume.
/// \test SolidProjector.EqualsClosedFormsOfSingleBodies
class SolidProjector : public RayIntegrator {
 public:
  /// `tissue` must outlive the projector.
  SolidProjector(const Phantom& phantom,
                 const TissueModel& tissue,
                 std::optional<SmoothMotion> motion = {});

  [[nodiscard]] PathIntegrals integrate(const Eigen::Vector3d& source_point,
                                        const Eigen::Vector3d& through_point) const override;

 private:
  struct Ball {  ///< around a body
    Eigen::Vector3d center_mm;
    double radius_mm;
  };
  /// A surface of a body on a piece.
  struct Crossing {
    double at_mm;
    int solid;
    bool is_entry;
  };
  class OpenBodies;
  /// A body that the X-ray's ray may cross, and where on it.
  struct Candidate {
    int solid;
    double ray_first_mm;
    double ray_last_mm;
  };
  /// A straight piece of the way through the anatomy.
  struct Piece {
    double ray_first_mm;  ///< on the X-ray's ray
    double ray_last_mm;
    Eigen::Vector3d origin;
    Eigen::Vector3d direction;  ///< unit
    double length_mm;           ///< in the anatomy
    double stretch;             ///< mm of the X-ray's ray per mm of it
  };

  [[nodiscard]] std::vector<Piece> pieces(const Eigen::Vector3d& source_point,
                                          const Eigen::Vector3d& direction) const;
  [[nodiscard]] std::vector<Candidate> candidates(const Eigen::Vector3d& source_point,
                                                  const Eigen::Vector3d& direction) const;
  /// Crossings with surfaces along the piece, in order.
  void find_crossings(const Piece& piece,
                      const std::vector<Candidate>& candidates,
                      std::vector<Crossing>& crossings) const;
  /// `open` is empty before and after.
  void add_piece(const Piece& piece,
                 const std::vector<Crossing>& crossings,
                 OpenBodies& open,
                 PathIntegrals& sum) const;
  void add_span(const Piece& piece,
                const Solid& solid,
                double first_mm,
                double last_mm,
                PathIntegrals& sum) const;
  void add_length(int hu, double length_mm, PathIntegrals& sum) const;

  std::vector<Solid> solids_;
  std::vector<Ball> balls_;
  Eigen::Vector3d half_sizes_mm_;
  const TissueModel& tissue_;
  std::optional<SmoothMotion> motion_;
};

}  // namespace af
