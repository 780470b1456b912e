// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "drr/tissue_model.h"
#include "evaluate/simulate/phantom_parts.h"
#include "evaluate/simulate/ray_integrator.h"
#include "evaluate/simulate/smooth_motion.h"

namespace af {

/// Line integrals through bodies themselves, without voxels, so that X-rays share no voxel grid
/// with the CT that registers them. The surfaces that a ray crosses are found in closed form (those
/// of a waist by bisection to 1e-6 mm). Between them is the body that was painted last. Textures
/// are sampled at the midpoints of steps of at most 1.5 mm. With a motion, the ray is followed
/// through the anatomy as a polyline, one piece every 8 mm. It ends at the faces of the phantom's
/// volume. Which bodies are where is found for many neighbouring rays at once.
/// \test SolidProjector.EqualsClosedFormsOfSingleBodies
class SolidProjector : public RayIntegrator {
 public:
  /// `tissue` must outlive the projector.
  SolidProjector(const Phantom& phantom,
                 const TissueModel& tissue,
                 std::optional<SmoothMotion> motion = {});

  [[nodiscard]] PathIntegrals integrate(const Eigen::Vector3d& source_point,
                                        const Eigen::Vector3d& through_point) const override;
  void integrate_row(const Eigen::Vector3d& source_point,
                     std::span<const Eigen::Vector3d> through_points,
                     std::span<PathIntegrals> sums) const override;

 private:
  struct Ball {  ///< around a body
    Eigen::Vector3d center_mm;
    double radius_mm;
  };
  /// Where a piece crosses a body's surface.
  struct Crossing {
    double at_mm;
    int solid;
    bool is_entry;
  };
  class OpenBodies;
  /// A straight piece of the way through the anatomy.
  struct Piece {
    Eigen::Vector3d origin;
    Eigen::Vector3d direction;  ///< unit
    double length_mm;           ///< in the anatomy
    double stretch;             ///< mm of the X-ray's ray per mm of the anatomy
  };
  using Way = std::vector<Piece>;
  /// All points within a distance of a segment. It surrounds the pieces of neighbouring rays.
  struct Tube {
    Eigen::Vector3d from;
    Eigen::Vector3d to;
    double radius_mm;

    [[nodiscard]] Eigen::Vector3d middle() const { return 0.5 * (from + to); }
  };
  /// Bodies of a tube, ascending: those that hold all of it, and those that may reach into it.
  struct Bodies {
    std::vector<int> around;
    std::vector<int> near;
  };

  void find_way(const Eigen::Vector3d& source_point,
                const Eigen::Vector3d& direction,
                Way& way) const;
  /// Bodies that rays within an angle of this sine about `direction` may cross.
  [[nodiscard]] std::vector<int> candidates(const Eigen::Vector3d& source_point,
                                            const Eigen::Vector3d& direction,
                                            double sine) const;
  /// Tubes around the first, second ... pieces of all ways.
  [[nodiscard]] static std::vector<Tube> tubes(std::span<const Way> ways);
  /// Finds the bodies of each tube. Only bodies among `candidates` reach into one.
  void sort_into(const std::vector<Tube>& tubes,
                 const std::vector<int>& candidates,
                 std::vector<Bodies>& bodies) const;
  /// Crossings with surfaces of these bodies along the piece, in order.
  void find_crossings(const Piece& piece,
                      const std::vector<int>& near,
                      std::vector<Crossing>& crossings) const;
  /// `open` holds the bodies around the piece, and afterwards those at its end.
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
