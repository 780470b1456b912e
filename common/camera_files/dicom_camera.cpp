// SPDX-License-Identifier: Apache-2.0
// The camera of a C-arm by the header of its DICOM image (PS3.3, C.8.7.5: XA positioner). Room: the
// patient's axes (LPS, mm) with the origin at the isocentre, the patient lying on the back, head
// first. The detector is in front of the chest at angles 0 and moves to the patient's left (LAO)
// with a positive primary, to the head with a positive secondary angle, like longitude and
// latitude.
#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>

#include "base/error.h"
#include "base/number_text.h"
#include "camera_files/format_readers.h"
#include "geometry/camera_distance.h"
#include "geometry/rigid_transform.h"
#include "image_files/dicom_elements.h"

namespace af {

namespace {

constexpr DicomTag kModality = {0x0008, 0x0060};
constexpr DicomTag kSourceDetector = {0x0018, 0x1110};
constexpr DicomTag kSourcePatient = {0x0018, 0x1111};
constexpr DicomTag kPositionerMotion = {0x0018, 0x1500};
constexpr DicomTag kPrimaryAngle = {0x0018, 0x1510};
constexpr DicomTag kSecondaryAngle = {0x0018, 0x1511};
constexpr DicomTag kPrimaryIncrement = {0x0018, 0x1520};
constexpr DicomTag kSecondaryIncrement = {0x0018, 0x1521};
constexpr DicomTag kElementSpacing = {0x0018, 0x7022};
constexpr DicomTag kActiveDimensions = {0x0018, 0x7026};
constexpr DicomTag kActiveOrigin = {0x0018, 0x7028};
constexpr DicomTag kFieldOfViewOrigin = {0x0018, 0x7030};
constexpr DicomTag kFieldOfViewRotation = {0x0018, 0x7032};
constexpr DicomTag kFieldOfViewFlip = {0x0018, 0x7034};
constexpr DicomTag kPatientOrientation = {0x0020, 0x0020};
constexpr DicomTag kFrames = {0x0028, 0x0008};
constexpr DicomTag kRows = {0x0028, 0x0010};
constexpr DicomTag kColumns = {0x0028, 0x0011};
// Of enhanced files: functional groups, and what they hold.
constexpr DicomTag kSharedGroups = {0x5200, 0x9229};
constexpr DicomTag kFrameGroups = {0x5200, 0x9230};
constexpr DicomTag kGeometryMacro = {0x0018, 0x9476};
constexpr DicomTag kPositionerMacro = {0x0018, 0x9405};
constexpr DicomTag kIsocenterMacro = {0x0018, 0x9462};
constexpr DicomTag kFieldOfViewMacro = {0x0018, 0x9432};
constexpr DicomTag kPixelsMacro = {0x0028, 0x9443};
constexpr DicomTag kPixelAreaOrigin = {0x0018, 0x9471};
constexpr DicomTag kSourceIsocenter = {0x0018, 0x9402};
constexpr DicomTag kDetectorRotation = {0x0018, 0x9465};

constexpr std::array kModalities = {"XA", "RF", "CR", "DX"};
constexpr int kMostFrames = 100000;

struct PositionerAngles {
  double primary_deg = 0.0;
  double secondary_deg = 0.0;
};

/// A DICOM header as a camera's file; whatever it lacks comes from the options or is asked for.
class DicomCamera {
 public:
  DicomCamera(const CameraFile& file, const CameraFileOptions& options)
      : file_(file.name()), options_(options), elements_(DicomElements::read(file.path)) {}

  StatedRig run() {
    const std::string modality = elements_.text(kModality);
    if (std::ranges::find(kModalities, modality) == kModalities.end())
      throw InputError(
          "Modality (0008,0060)", "'" + modality + "'", "must be XA, RF, CR or DX", file_);
    read_size();
    if (elements_.has(kSharedGroups) || elements_.has(kFrameGroups)) {
      add_enhanced_cameras();
    } else {
      read_detector(1);
      for (const PositionerAngles& angles : all_angles()) add_camera(angles);
    }
    note_unapplied_angles();
    stated_.isocenter_point = Eigen::Vector3d::Zero();
    return stated_;
  }

 private:
  /// The number of a frame's functional groups, or of the top level.
  [[nodiscard]] std::optional<double> found_number(int frame,
                                                   DicomTag macro,
                                                   DicomTag tag,
                                                   const char* name) const {
    if (const DicomValues* const group = functional_group(elements_, frame, macro);
        group != nullptr)
      if (const auto numbers = group->numbers(tag, name, file_); !numbers.empty())
        return numbers.front();
    return elements_.number_or_none(tag, name);
  }

  /// A number of the header, or of the option, which must not contradict it.
  double number(const std::optional<double>& found,
                const char* name,
                const std::optional<double>& given,
                const char* option) const {
    if (found && *found > 0.0) {
      constexpr double kToleranceMm = 1e-3;
      if (given && std::abs(*given - *found) > kToleranceMm)
        throw InputError(option,
                         number_text(*given),
                         "must agree with " + std::string(name) + " = " + number_text(*found),
                         file_);
      return *found;
    }
    if (given) return *given;
    throw InputError(file_ + ": " + name + " is missing: state it with af-inspect --rig-from and " +
                     option);
  }

  void read_size() {
    const auto side = [&](DicomTag tag, const char* name) {
      const std::optional<double> found = elements_.number_or_none(tag, name);
      if (!found) throw InputError(file_ + ": " + name + " is missing");
      return *found;
    };
    camera_.size_px =
        size_of({side(kColumns, "Columns (0028,0011)"), side(kRows, "Rows (0028,0010)")},
                file_ + ": Columns, Rows");
  }

  void read_detector(int frame) {
    frame_ = frame;
    constexpr const char* kDetectorName = "DistanceSourceToDetector (0018,1110)";
    source_detector_mm_ =
        number(found_number(frame, kGeometryMacro, kSourceDetector, kDetectorName),
               kDetectorName,
               options_.source_detector_mm,
               "--rig-source-detector-mm");
    auto to_isocenter =
        found_number(frame, kGeometryMacro, kSourceIsocenter, "DistanceSourceToIsocenter");
    if (!to_isocenter)
      to_isocenter = elements_.number_or_none(kSourcePatient, "DistanceSourceToPatient");
    source_isocenter_mm_ = number(to_isocenter,
                                  "DistanceSourceToPatient (0018,1111)",
                                  options_.source_isocenter_mm,
                                  "--rig-source-isocenter-mm");
    if (const auto spacing = imager_spacing_mm(elements_, frame))
      camera_.pixel_spacing_mm = *spacing;
    else if (!options_.pixel_spacing_mm.empty())
      camera_.pixel_spacing_mm = {options_.pixel_spacing_mm[0], options_.pixel_spacing_mm[1]};
    else
      throw InputError(
          file_ +
          ": ImagerPixelSpacing (0018,1164) is missing: state it with af-inspect --rig-from and "
          "--rig-pixel-spacing-mm COLUMN,ROW; PixelSpacing (0028,0030) is not used, because it may "
          "be "
          "the spacing at the patient");
  }

  /// Of an enhanced file: one camera per frame, or one when no frame moves.
  void add_enhanced_cameras() {
    const std::size_t frames = frame_count();
    for (std::size_t i = 0; i < frames; ++i) {
      const int frame = static_cast<int>(i) + 1;
      read_detector(frame);
      add_camera(angles_of(frame));
    }
    const auto is_as_first = [&](const StatedCamera& other) {
      return camera_distance(other.geometry, stated_.cameras.front().geometry).is_none();
    };
    if (std::ranges::all_of(stated_.cameras, is_as_first)) stated_.cameras.resize(1);
    if (const DicomValues* const pixels = functional_group(elements_, 1, kPixelsMacro);
        pixels != nullptr) {
      constexpr const char* kName = "PixelDataAreaOriginRelativeToFOV (0018,9471)";
      const std::vector<double> origin = pixels->numbers(kPixelAreaOrigin, kName, file_);
      if (std::ranges::any_of(origin, [](double value) { return value != 0.0; }))
        stated_.notes.push_back(file_ + ": " + kName +
                                " is not 0 and is not applied: the images are a part of the field "
                                "of view, of which the middle is taken for theirs");
    }
    const auto rotation =
        found_number(1, kIsocenterMacro, kDetectorRotation, "detector rotation (0018,9465)");
    if (rotation && *rotation != 0.0)
      stated_.notes.push_back(file_ + ": PositionerIsocenterDetectorRotationAngle (0018,9465) = " +
                              number_text(*rotation) +
                              " degrees is not applied: the images may be turned in their plane");
  }

  /// Of the tags that are not read, those that tilt the detector or turn the patient.
  void note_unapplied_angles() {
    constexpr std::array<std::pair<DicomTag, const char*>, 4> kAngles = {
        {{{0x0018, 0x1138}, "TableAngle (0018,1138)"},
         {{0x0018, 0x1450}, "ColumnAngulation (0018,1450)"},
         {{0x0018, 0x1530}, "DetectorPrimaryAngle (0018,1530)"},
         {{0x0018, 0x1531}, "DetectorSecondaryAngle (0018,1531)"}}};
    for (const auto& [tag, name] : kAngles)
      if (const double angle_deg = elements_.number_or_none(tag, name).value_or(0.0);
          angle_deg != 0.0)
        stated_.notes.push_back(file_ + ": " + name + " = " + number_text(angle_deg) +
                                " degrees is not applied");
  }

  [[nodiscard]] std::size_t frame_count() const {
    const double frames =
        elements_.number_or_none(kFrames, "NumberOfFrames (0028,0008)").value_or(1.0);
    if (!(frames >= 1.0 && frames <= kMostFrames) || frames != std::floor(frames))
      throw InputError("NumberOfFrames (0028,0008)",
                       number_text(frames),
                       "must be a whole number between 1 and 100000",
                       file_);
    return static_cast<std::size_t>(frames);
  }

  [[nodiscard]] PositionerAngles angles_of(int frame) const {
    PositionerAngles first;
    const auto primary =
        found_number(frame, kPositionerMacro, kPrimaryAngle, "PositionerPrimaryAngle (0018,1510)");
    const auto secondary = found_number(
        frame, kPositionerMacro, kSecondaryAngle, "PositionerSecondaryAngle (0018,1511)");
    const std::vector<double>& given = options_.positioner_deg;
    constexpr double kToleranceDeg = 1e-3;
    if ((!primary || !secondary) && given.empty())
      throw InputError(
          file_ +
          ": PositionerPrimaryAngle (0018,1510) or PositionerSecondaryAngle "
          "(0018,1511) is missing: state both with af-inspect --rig-from and --rig-positioner-deg "
          "PRIMARY,SECONDARY" +
          (functional_group(elements_, frame, kIsocenterMacro) == nullptr
               ? ""
               : "; the file's PositionerIsocenter angles are of the equipment, not "
                 "of the patient"));
    if (!given.empty() && ((primary && std::abs(*primary - given[0]) > kToleranceDeg) ||
                           (secondary && std::abs(*secondary - given[1]) > kToleranceDeg)))
      throw InputError("--rig-positioner-deg",
                       number_text(given[0]) + "," + number_text(given[1]),
                       "must agree with the file's angles",
                       file_);
    first.primary_deg = primary ? *primary : given[0];
    first.secondary_deg = secondary ? *secondary : given[1];
    if (!(std::abs(first.primary_deg) <= 360.0) || !(std::abs(first.secondary_deg) <= 180.0))
      throw InputError("positioner angles",
                       number_text(first.primary_deg) + ", " + number_text(first.secondary_deg),
                       "the first must be within +-360 degrees, the second within +-180",
                       file_);
    return first;
  }

  /// Of each frame: one, unless the positioner moves.
  [[nodiscard]] std::vector<PositionerAngles> all_angles() const {
    const PositionerAngles first = angles_of(1);
    if (elements_.text(kPositionerMotion) != "DYNAMIC") return {first};
    return moving_angles(first);
  }

  /// PS3.3, C.8.7.5.1.3: one increment per frame, or an offset from the first angles for each.
  [[nodiscard]] std::vector<PositionerAngles> moving_angles(const PositionerAngles& first) const {
    const std::size_t count = frame_count();
    const auto offsets = [&](DicomTag tag, const char* name) {
      std::vector<double> values = elements_.numbers(tag, name);
      if (values.empty()) values = {0.0};
      if (values.size() != 1 && values.size() != count)
        throw InputError(name,
                         std::to_string(values.size()) + " values",
                         "must be one, or one per frame: " + std::to_string(count),
                         file_);
      if (values.size() == count && count > 1) return values;
      const double step = values.front();
      values.resize(count);
      for (std::size_t i = 0; i < count; ++i) values[i] = static_cast<double>(i) * step;
      return values;
    };
    const auto primary = offsets(kPrimaryIncrement, "PositionerPrimaryAngleIncrement (0018,1520)");
    const auto secondary =
        offsets(kSecondaryIncrement, "PositionerSecondaryAngleIncrement (0018,1521)");
    std::vector<PositionerAngles> angles;
    for (std::size_t i = 0; i < count; ++i)
      angles.push_back({first.primary_deg + primary[i], first.secondary_deg + secondary[i]});
    return angles;
  }

  /// Origin, turn and flip of the image on the detector: the frame's own, or the file's.
  [[nodiscard]] const DicomValues& field_of_view() const {
    const DicomValues* const own = functional_group(elements_, frame_, kFieldOfViewMacro);
    return own != nullptr && !own->text(kFieldOfViewOrigin).empty() ? *own : elements_.values();
  }

  /// Where the image's middle lies from the middle of the active detector: (column, row) mm. 0
  /// unless all is stated.
  [[nodiscard]] Eigen::Vector2d field_of_view_offset_mm() const {
    const auto pair_of = [&](const DicomValues& stated,
                             DicomTag tag,
                             const char* name) -> std::optional<Eigen::Vector2d> {
      const std::vector<double> values = stated.numbers(tag, name, file_);
      if (values.size() != 2) return std::nullopt;
      return Eigen::Vector2d(values[1], values[0]);  // rows come first in DICOM
    };
    const auto pair = [&](DicomTag tag, const char* name) {
      return pair_of(elements_.values(), tag, name);
    };
    const auto spacing = pair(kElementSpacing, "DetectorElementSpacing (0018,7022)");
    const auto active = pair(kActiveDimensions, "DetectorActiveDimensions (0018,7026)");
    const auto active_origin = pair(kActiveOrigin, "DetectorActiveOrigin (0018,7028)");
    const auto origin =
        pair_of(field_of_view(), kFieldOfViewOrigin, "FieldOfViewOrigin (0018,7030)");
    if (!spacing || !active || !active_origin || !origin) return Eigen::Vector2d::Zero();
    const Eigen::Vector2d image_mm =
        camera_.size_px.cast<double>().cwiseProduct(camera_.pixel_spacing_mm);
    const Eigen::Vector2d offset_mm =
        (*origin - *active_origin).cwiseProduct(*spacing) + 0.5 * (image_mm - *active);
    return offset_mm.isZero(0.0) ? offset_mm : along_stored_axes(offset_mm);
  }

  /// FieldOfViewOrigin is of the detector's own rows and columns, before the image was turned and
  /// flipped as these tags say.
  [[nodiscard]] Eigen::Vector2d along_stored_axes(Eigen::Vector2d offset_mm) const {
    const std::vector<double> turn =
        field_of_view().numbers(kFieldOfViewRotation, "FieldOfViewRotation (0018,7032)", file_);
    const double turn_deg = turn.empty() ? 0.0 : turn.front();
    if (turn_deg != 0.0 && turn_deg != 180.0)
      throw InputError(file_ + ": FieldOfViewRotation (0018,7032)",
                       number_text(turn_deg),
                       "must be 0 or 180 where FieldOfViewOrigin is not the detector's middle");
    if (turn_deg == 180.0) offset_mm = -offset_mm;
    if (field_of_view().text(kFieldOfViewFlip) == "YES") offset_mm.x() = -offset_mm.x();
    return offset_mm;
  }

  /// The direction of patient letters such as "L" or "PL", by the first.
  static std::optional<Eigen::Vector3d> letter_direction(const std::string& letters) {
    if (letters.empty()) return std::nullopt;
    switch (letters.front()) {
      case 'L':
        return Eigen::Vector3d(1.0, 0.0, 0.0);
      case 'R':
        return Eigen::Vector3d(-1.0, 0.0, 0.0);
      case 'P':
        return Eigen::Vector3d(0.0, 1.0, 0.0);
      case 'A':
        return Eigen::Vector3d(0.0, -1.0, 0.0);
      case 'H':
        return Eigen::Vector3d(0.0, 0.0, 1.0);
      case 'F':
        return Eigen::Vector3d(0.0, 0.0, -1.0);
      default:
        return std::nullopt;
    }
  }

  /// Turns the axes around where PatientOrientation says that the image is stored so.
  void orient(CameraGeometry& camera) {
    const std::string text = elements_.text(kPatientOrientation);
    const std::size_t bar = text.find('\\');
    const auto columns = letter_direction(text.substr(0, bar));
    const auto rows =
        bar == std::string::npos ? std::nullopt : letter_direction(text.substr(bar + 1));
    constexpr double kClear = 0.3;
    if (!columns || !rows || std::abs(columns->dot(camera.column_direction)) < kClear ||
        std::abs(rows->dot(camera.row_direction)) < kClear) {
      if (stated_.cameras.empty())
        stated_.notes.push_back(
            file_ +
            ": PatientOrientation (0020,0020) is missing or does not fit the angles; the images "
            "are "
            "taken as seen from the detector, head on top (L\\F at angles 0); --rig-flip columns "
            "or rows turns them around");
      return;
    }
    if (columns->dot(camera.column_direction) < 0.0) camera.column_direction *= -1.0;
    if (rows->dot(camera.row_direction) < 0.0) camera.row_direction *= -1.0;
  }

  void add_camera(const PositionerAngles& angles) {
    using Eigen::AngleAxisd;
    using Eigen::Vector3d;
    const Eigen::Matrix3d turn = (AngleAxisd(angles.primary_deg * kRadPerDeg, Vector3d::UnitZ()) *
                                  AngleAxisd(-angles.secondary_deg * kRadPerDeg, Vector3d::UnitX()))
                                     .toRotationMatrix();
    const Vector3d to_detector = turn * Vector3d(0.0, -1.0, 0.0);
    StatedCamera stated;
    stated.geometry = camera_;
    CameraGeometry& camera = stated.geometry;
    camera.column_direction = turn * Vector3d(1.0, 0.0, 0.0);
    camera.row_direction = turn * Vector3d(0.0, 0.0, -1.0);
    orient(camera);
    camera.source_point = -source_isocenter_mm_ * to_detector;
    const Eigen::Vector2d first_mm =
        field_of_view_offset_mm() - 0.5 * (camera.size_px.cast<double>() - Eigen::Vector2d::Ones())
                                              .cwiseProduct(camera.pixel_spacing_mm);
    camera.detector_origin_point = camera.source_point + source_detector_mm_ * to_detector +
                                   first_mm.x() * camera.column_direction +
                                   first_mm.y() * camera.row_direction;
    stated_.cameras.push_back(stated);
  }

  std::string file_;
  const CameraFileOptions& options_;
  DicomElements elements_;
  StatedRig stated_;
  CameraGeometry camera_;  ///< what all frames share
  int frame_ = 1;          ///< of which the detector was read last
  double source_detector_mm_ = 0.0;
  double source_isocenter_mm_ = 0.0;
};

}  // namespace

bool is_dicom_xray(const CameraFile& file) {
  if (!file.text.empty() || file.head.empty() || !is_marked_dicom(file.path)) return false;
  try {
    const std::string modality = DicomElements::read(file.path).text(kModality);
    return std::ranges::find(kModalities, modality) != kModalities.end();
  } catch (const Error&) {
    return true;  // DICOM, but broken: reading it says why
  }
}

StatedRig read_dicom_xray(const CameraFile& file, const CameraFileOptions& options) {
  return DicomCamera(file, options).run();
}

}  // namespace af
