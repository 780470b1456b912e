// SPDX-License-Identifier: Apache-2.0
// DRRs, looked up in a field or cast through a CT, with their derivatives with respect to the pose.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "attenuation_fields/beam.h"
#include "attenuation_fields/ct.h"
#include "attenuation_fields/export.h"
#include "attenuation_fields/geometry.h"

namespace attenuation_fields {

/// What happens when rays miss the planes of a field because the pose lies beyond its motion range.
/// No value is ever extrapolated.
enum class Outside {
  Throw,  ///< throws InputError
  Zero,   ///< their pixels are 0, and their number is returned
};

/// Makes DRRs of one CT for one camera: a Field or a RayCaster. Copies share everything. All
/// functions may be called from several threads at once. With one thread of its own (the default)
/// calls run concurrently. With more they take turns, and each uses all of them. Values depend
/// neither on threads nor on the processor, and are those of af-drr to the bit.
class ATTENUATION_FIELDS_API Renderer {
 public:
  [[nodiscard]] const Camera& camera() const;
  /// The origin of pose parameters.
  [[nodiscard]] const PoseFrame& frame() const;
  [[nodiscard]] int width() const { return camera().size_px[0]; }
  [[nodiscard]] int height() const { return camera().size_px[1]; }
  [[nodiscard]] std::size_t pixel_count() const;
  /// How many threads share a large DRR, or the DRRs of a batch.
  [[nodiscard]] int threads() const;

  // NOLINTBEGIN(modernize-use-nodiscard): callers who know no ray is outside may ignore the count.
  /// Writes the total attenuation of every pixel's ray (dimensionless), row by row, into
  /// pixel_count() values. Returns the number of rays outside.
  std::int64_t drr(const Pose& pose, std::span<float> total_attenuation) const;

  /// The same with six planes of pixel_count() values: its derivatives with respect to small
  /// motions after `pose`, x_room -> p + t + Rz Ry Rx (x_room - p), at zero. They are by rx, ry, rz
  /// per rad, then by tx, ty, tz per mm. The programs optimise with these. Throws InputError for a
  /// pivot beyond 1 km.
  std::int64_t drr_and_motion_gradient(const Pose& pose,
                                       const Vector3& pivot_room_mm,
                                       std::span<float> total_attenuation,
                                       std::span<float> planes) const;

  /// The DRR at frame().pose(rotation_deg, translation_mm), and its derivatives with respect to
  /// these six numbers: per degree, then per mm.
  std::int64_t drr_and_gradient(const Vector3& rotation_deg,
                                const Vector3& translation_mm,
                                std::span<float> total_attenuation,
                                std::span<float> planes) const;

  /// The DRRs of many poses, one after the other in `total_attenuation`. The renderer's threads
  /// make them concurrently. Returns the number of rays outside, over all poses.
  std::int64_t drrs(std::span<const Pose> poses, std::span<float> total_attenuation) const;

  /// drr_and_gradient() for many poses, each as six numbers rx, ry, rz (degrees), tx, ty, tz (mm).
  std::int64_t drrs_and_gradients(std::span<const std::array<double, 6>> parameters,
                                  std::span<float> total_attenuation,
                                  std::span<float> planes) const;
  // NOLINTEND(modernize-use-nodiscard)

 protected:
  struct Impl;
  explicit Renderer(std::shared_ptr<const Impl> impl);
  [[nodiscard]] const Impl& impl() const { return *impl_; }

 private:
  std::shared_ptr<const Impl> impl_;
};

struct FieldOptions {
  std::string look_up = {};           ///< "nearest", "linear", "cubic", ...; empty: the field's own
  std::optional<Camera> camera = {};  ///< another camera than the one for which the field was made
  int threads = 1;                    ///< 0: every processor
  Outside outside = Outside::Throw;
};

/// A precomputed attenuation field of one CT for one camera, or an atlas of several, such as those
/// of a C-arm's orbit. The fields of an atlas are read when poses need them, so DRRs may throw
/// FileError. Its camera() is the one from which its members were derived.
class ATTENUATION_FIELDS_API Field : public Renderer {
 public:
  /// Reads and verifies a file of a field or of an atlas (.af.h5). Throws FileError and InputError.
  static Field open(const std::filesystem::path& path, const FieldOptions& options = {});
  /// The same for DRRs of a beam. With a tube voltage it also reads the field of the CT's bone,
  /// A.bone.af.h5 beside A.af.h5, and throws FileError without it.
  static Field open(const std::filesystem::path& path,
                    const FieldOptions& options,
                    const Beam& beam);

  /// How many fields an atlas has; 1 for a field.
  [[nodiscard]] int members() const;

  /// How DRRs are looked up.
  [[nodiscard]] const std::string& look_up() const;
  /// The motion box, which an atlas has at each of its angles. Every angle and every translation
  /// may be this large.
  [[nodiscard]] double max_rotation_deg() const;
  [[nodiscard]] double max_translation_mm() const;
  /// Whether it was made from this CT: the same voxels at the same places, to 1e-3 mm.
  [[nodiscard]] bool is_of(const Ct& ct) const;
  /// Ct::content_sha256() of the CT from which it was made.
  [[nodiscard]] const std::string& ct_content_sha256() const;
  [[nodiscard]] const std::string& payload_sha256() const;
  [[nodiscard]] double water_mu_per_mm() const;

 private:
  friend class RegistrationCase;
  struct Facts;
  Field(std::shared_ptr<const Impl> impl, std::shared_ptr<const Facts> facts);
  std::shared_ptr<const Facts> facts_;
};

struct RayCasterOptions {
  double water_mu_per_mm = 0.0200;
  int air_below_hu = -900;  ///< lower values attenuate nothing
  double step_mm = 1.0;     ///< largest distance between samples along a ray
  /// The origin of pose parameters. None: the CT's centre at `isocenter_point`.
  std::optional<PoseFrame> frame = {};
  Vector3 isocenter_point = {0.0, 0.0, 0.0};  ///< the rig's
  int threads = 1;                            ///< 0: every processor
};

/// Casts rays through a CT. No ray is ever outside.
class ATTENUATION_FIELDS_API RayCaster : public Renderer {
 public:
  /// Throws InputError.
  RayCaster(const Ct& ct, const Camera& camera, const RayCasterOptions& options = {});
  /// The same for DRRs of a beam. Throws InputError.
  RayCaster(const Ct& ct, const Camera& camera, const RayCasterOptions& options, const Beam& beam);
};

}  // namespace attenuation_fields
