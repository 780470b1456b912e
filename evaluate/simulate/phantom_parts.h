// SPDX-License-Identifier: Apache-2.0
// What phantoms are built from, besides single bodies.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/described_fields.h"
#include "evaluate/simulate/anatomy.h"
#include "evaluate/simulate/automatic_target.h"
#include "evaluate/simulate/solid.h"

namespace af {

/// How a phantom is sampled.
struct PhantomOptions {
  double voxel_mm = 1.4;
  int samples_per_axis = 2;  ///< points per voxel and axis
  int threads = 0;           ///< 0: as many as the hardware has; voxels do not depend on it
  bool has_metal = false;    ///< implants: screws and rods, a hip prosthesis, fillings
  std::optional<std::int64_t> anatomy_seed = {};  ///< which patient; none: the typical adult

  void describe(Fields& field);
};

std::vector<std::string> problems(const PhantomOptions& options);

/// A bone that can be moved alone.
struct PhantomBone {
  std::string_view name;      ///< as in its bodies
  RegistrationTarget target;  ///< the bone, or where most of it is visible
};

/// A synthetic patient in DICOM LPS (left +x, back +y, head +z).
struct Phantom {
  std::vector<Solid> solids;      ///< in painting order
  Eigen::Vector3d half_sizes_mm;  ///< of the volume around the origin
  RegistrationTarget target;
  std::vector<std::string> findings;  ///< what differs from the typical adult, in words
  std::vector<PhantomBone> bones = {};

  [[nodiscard]] bool has_metal() const;  ///< denser than a scanner's range
};

/// The patient into which a phantom of the typical adult is turned. `habitus` shapes bodies, volume
/// and target; `anatomy` varies densities and textures. \test ShapedPhantom.KeepsCapsulesJoined
Phantom shaped(Phantom phantom, const Anatomy& anatomy, const Habitus& habitus);

/// Voxels of a phantom, with metal at its full HU.
CtVolume sample_phantom(const Phantom& phantom, const PhantomOptions& options);

/// Clips values above 3071 HU (metal) to 3071, as a 12-bit scanner does.
CtVolume with_scanner_range(const CtVolume& ct);

/// HU of tissues, typical at 120 kV, and of titanium at the effective energy of the HU scale.
inline constexpr int kFatHu = -100;
inline constexpr int kMuscleHu = 50;
inline constexpr int kGasHu = -1000;
inline constexpr int kCorticalHu = 1000;
inline constexpr int kCancellousHu = 230;
inline constexpr int kTitaniumHu = 9000;

Solid ellipsoid(const Eigen::Vector3d& center,
                const Eigen::Vector3d& half_sizes,
                int hu,
                int texture_hu = 0);

/// A cylinder with its axis along z.
Solid elliptic_cylinder(const Eigen::Vector3d& center, const Eigen::Vector3d& half_sizes, int hu);

/// The mirrored half of a body: x changes sign.
Eigen::Vector3d mirrored(const Eigen::Vector3d& point, double side);

/// Appends a bone as cortical shell and textured cancellous core. The shells of all parts of a bone
/// come first, so that no shell cuts through the core of a part that it joins. Cores are appended
/// when the painter is destroyed.
class BonePainter {
 public:
  explicit BonePainter(std::vector<Solid>& solids, double shell_mm = 1.6)
      : solids_(solids), shell_mm_(shell_mm) {}
  ~BonePainter() { solids_.insert(solids_.end(), cores_.begin(), cores_.end()); }
  BonePainter(const BonePainter&) = delete;
  BonePainter& operator=(const BonePainter&) = delete;

  void add(Solid part);
  void add_capsule(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius_mm);
  /// Capsules from one point to the next.
  void add_chain(const std::vector<Eigen::Vector3d>& points, double radius_mm);

 private:
  std::vector<Solid>& solids_;
  double shell_mm_;
  std::vector<Solid> cores_;
};

/// Makes bodies from number `first` on move with `bone`.
void give_to_bone(std::string_view bone, std::vector<Solid>& solids, std::size_t first);

/// Bubbles of bowel gas within a box. The typical adult gets none, because it has its own.
void add_gas(const Anatomy& anatomy, const CtBox& box, std::vector<Solid>& solids);

/// A vertebra: body with waist, pedicles, laminae, articular, transverse and spinous processes.
struct Vertebra {
  int level;  ///< 0 is T12, positive towards the head
  Eigen::Vector3d center;
  double half_width_mm;  ///< of the body
  double half_depth_mm;
  double half_height_mm;
  double shell_mm = 1.6;
  double processes = 1.0;   ///< length of transverse and spinous processes, relative to the typical
  double facets = 1.0;      ///< radius of articular processes, relative to the typical
  double tilt_mm = 0.0;     ///< sideways shift of the spinous process's tip
  double arthrosis = 0.0;   ///< 0 to 1: beaks at the rims, dense end plates
  std::uint64_t beaks = 0;  ///< key of the beaks' places

  [[nodiscard]] bool has_ribs() const { return level >= 0; }
};

void add_vertebra(const Vertebra& v, std::vector<Solid>& solids);

/// The vertebra as `anatomy` varies it: width, depth, height, processes, wear. `index` keys its
/// draws.
Vertebra varied(Vertebra v, const Anatomy& anatomy, int index);

}  // namespace af
