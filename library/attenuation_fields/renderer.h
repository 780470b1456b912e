// SPDX-License-Identifier: Apache-2.0
// DRRs, looked up in a field or cast through a CT, with their derivatives by the pose.
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

/// What happens when rays miss the planes of a field, because the pose is beyond the motion range
/// that it was made for. No value is ever extrapolated.
enum class Outside {
  Throw,  ///< InputError
  Zero,   ///< their pixels are 0, and their number is returned
};

/// What makes DRRs of one CT for one camera: a Field or a RayCaster. Copies share everything. All
/// functions may be called from several threads at once; with one thread of its own (the default)
/// calls run side by side, with more they take turns, each using all of them. Values depend neither
/// on threads nor on the processor, and are those of af-drr to the bit.
class ATTENUATION_FIELDS_API Renderer {
 public:
  [[nodiscard]] const Camera& camera() const;
  /// What pose parameters are relative to.
  [[nodiscard]] const PoseFrame& frame() const;
  [[nodiscard]] int width() const { return camera().size_px[0]; }
  [[nodiscard]] int height() const { return camera().size_px[1]; }
  [[nodiscard]] std::size_t pixel_count() const;
  /// Threads that share a large DRR, or the DRRs of a batch.
  [[nodiscard]] int threads() const;

  // NOLINTBEGIN(modernize-use-nodiscard): callers who know no ray is outside may ignore the count.
  /// Total attenuation of every pixel's ray (dimensionless), row by row, into pixel_count() values.
  /// Returns the number of rays outside.
  std::int64_t drr(const Pose& pose, std::span<float> total_attenuation) const;

  /// The same with six planes of pixel_count() values: its derivatives by small motions after
  /// `pose`, x_room -> p + t + Rz Ry Rx (x_room - p), at zero: by rx, ry, rz per rad, then by tx,
  /// ty, tz per mm. These are what the programs optimise with.
  /// InputError for a pivot beyond 1 km.
  std::int64_t drr_and_motion_gradient(const Pose& pose,
                                       const Vector3& pivot_room_mm,
                                       std::span<float> total_attenuation,
                                       std::span<float> planes) const;

  /// The DRR at frame().pose(rotation_deg, translation_mm) and its derivatives by these six
  /// numbers: per degree, then per mm.
  std::int64_t drr_and_gradient(const Vector3& rotation_deg,
                                const Vector3& translation_mm,
                                std::span<float> total_attenuation,
                                std::span<float> planes) const;

  /// The DRRs of many poses, one after the other in `total_attenuation`, made side by side by the
  /// renderer's threads. Returns the number of rays outside, of all poses.
  std::int64_t drrs(std::span<const Pose> poses, std::span<float> total_attenuation) const;

  /// drr_and_gradient() of many poses, each six numbers rx, ry, rz (degrees), tx, ty, tz (mm).
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
  std::optional<Camera> camera = {};  ///< another than the one that the field was made for
  int threads = 1;                    ///< 0: every processor
  Outside outside = Outside::Throw;
};

/// A precomputed attenuation field of one CT for one camera, or an atlas of several, such as those
/// of a C-arm's orbit. Of an atlas the fields that poses need are read when they are needed, so
/// DRRs may throw FileError; camera() is the one that its members were derived from.
class ATTENUATION_FIELDS_API Field : public Renderer {
 public:
  /// Reads and verifies a file of a field or of an atlas (.af.h5). FileError, InputError.
  static Field open(const std::filesystem::path& path, const FieldOptions& options = {});
  /// The same for DRRs of a beam. With a tube voltage the field of the CT's bone, A.bone.af.h5
  /// beside A.af.h5, is read, too: FileError without it.
  static Field open(const std::filesystem::path& path,
                    const FieldOptions& options,
                    const Beam& beam);

  /// Fields of an atlas; 1 for a field.
  [[nodiscard]] int members() const;

  /// How DRRs are looked up.
  [[nodiscard]] const std::string& look_up() const;
  /// The motion box, of an atlas at each of its angles: every angle and every translation may be
  /// this large.
  [[nodiscard]] double max_rotation_deg() const;
  [[nodiscard]] double max_translation_mm() const;
  /// Whether it was made from this CT: the same voxels at the same places, to 1e-3 mm.
  [[nodiscard]] bool is_of(const Ct& ct) const;
  /// Ct::content_sha256() of the CT that it was made from.
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
  /// What pose parameters are relative to; none: the CT's centre at `isocenter_point`.
  std::optional<PoseFrame> frame = {};
  Vector3 isocenter_point = {0.0, 0.0, 0.0};  ///< of the rig
  int threads = 1;                            ///< 0: every processor
};

/// Casts rays through a CT. No ray is ever outside.
class ATTENUATION_FIELDS_API RayCaster : public Renderer {
 public:
  /// InputError.
  RayCaster(const Ct& ct, const Camera& camera, const RayCasterOptions& options = {});
  /// The same for DRRs of a beam. InputError.
  RayCaster(const Ct& ct, const Camera& camera, const RayCasterOptions& options, const Beam& beam);
};

}  // namespace attenuation_fields
