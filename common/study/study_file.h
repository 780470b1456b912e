// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <type_traits>
#include <vector>

#include "base/error.h"
#include "ct/ct_read_options.h"
#include "geometry/camera_geometry.h"
#include "geometry/ct_box.h"
#include "geometry/rigid_transform.h"
#include "study/xray_reading.h"
#include "xray/image2d.h"

namespace af {

/// Where a study names each of its files: key -> "study.toml:12: case[0].view[1].xray". Empty for
/// studies that were not read from a file.
using StudyPlaces = std::map<std::string, std::string>;

/// One X-ray of a case. Paths are absolute after reading.
struct StudyView {
  std::string camera;
  std::filesystem::path xray;
  XrayDomain xray_domain = XrayDomain::Intensity;
  RegionOfInterest roi;
  bool is_roi_stated = true;  ///< otherwise it is the whole detector
  /// (column, row) in the undistorted X-ray, in the order of StudyCase::fiducials_ct_mm. NaN: not
  /// seen.
  std::vector<Eigen::Vector2d> fiducials_px;
  /// (column, row) in the undistorted X-ray, in the order of StudyCase::landmarks_ct_mm. nullopt:
  /// not visible here. Empty: none is.
  std::vector<std::optional<Eigen::Vector2d>> landmarks_px;
  std::optional<std::filesystem::path> field;
  std::optional<std::filesystem::path> mask;
  XrayReading reading;
  StudyPlaces places;

  auto members() {
    return std::tie(camera,
                    xray,
                    xray_domain,
                    roi,
                    is_roi_stated,
                    fiducials_px,
                    landmarks_px,
                    field,
                    mask,
                    reading,
                    places);
  }
};

/// One patient.
struct StudyCase {
  std::string name;
  std::string note;          ///< free text for people, for example how X-rays were simulated
  std::filesystem::path ct;  ///< image file or DICOM folder
  CtReadOptions ct_reading;  ///< keys ct_values, ct_resample, ...
  RigidTransform nominal_room_from_ct = RigidTransform::Identity();
  /// By a pose or by landmarks. Otherwise it is the pose that puts center_ct_mm at the isocentre.
  bool is_nominal_stated = true;
  Eigen::Vector3d center_ct_mm =
      Eigen::Vector3d::Zero();  ///< ROI centre: origin of the registration's rotations
  CtBox target_box_ct;
  std::vector<Eigen::Vector3d> fiducials_ct_mm;
  std::vector<Eigen::Vector3d> landmarks_ct_mm;  ///< to start from, even if marked roughly
  std::optional<RigidTransform>
      gold_room_from_ct;  ///< instead of the fiducials, or to compare with them
  std::vector<StudyView> views;
  StudyPlaces places;

  auto members() {
    return std::tie(name,
                    note,
                    ct,
                    ct_reading,
                    nominal_room_from_ct,
                    is_nominal_stated,
                    center_ct_mm,
                    target_box_ct,
                    fiducials_ct_mm,
                    landmarks_ct_mm,
                    gold_room_from_ct,
                    views,
                    places);
  }

  /// The frame that --start-* options and fields of this case use: the nominal pose, about
  /// center_ct_mm.
  [[nodiscard]] PoseFrame frame() const {
    return PoseFrame::about(nominal_room_from_ct, center_ct_mm);
  }
};

struct Study {
  std::filesystem::path path;
  CameraRig rig;
  std::string rig_name_or_path;
  std::vector<StudyCase> cases;

  auto members() { return std::tie(path, rig, rig_name_or_path, cases); }
  /// The case of that name; an empty name picks the only case. Throws InputError that lists the
  /// known names.
  [[nodiscard]] const StudyCase& find_case(const std::string& name) const;
  /// The named cases, each once, or all, sorted by name.
  [[nodiscard]] std::vector<const StudyCase*> chosen_cases(
      const std::vector<std::string>& names) const;
};

/// Reads and validates study.toml. Every message names file, line, key, value and constraint, and
/// all problems are reported at once. Throws InputError (3) for unacceptable content (pose not
/// rigid, ROI off the detector, collinear or unequal numbers of fiducials, unknown camera, unknown
/// keys with a typo hint), FileError (4) when it cannot be parsed. `warnings` receives those of the
/// rig.
Study read_study(const std::filesystem::path& path, std::vector<std::string>* warnings = nullptr);

/// Runs `use`, which reads the file that `key` names. What it throws then begins with the study's
/// line. \test StudyFile.ErrorsOfItsFilesNameTheLine
template <typename Use>
std::invoke_result_t<Use> naming_study_line(const StudyPlaces& places,
                                            const std::string& key,
                                            Use&& use) {
  const auto place = places.find(key);
  if (place == places.end()) return use();
  try {
    return use();
  } catch (const InputError& error) {
    throw InputError(place->second + ": " + error.what());
  } catch (const FileError& error) {
    throw FileError(place->second, error.what());
  } catch (const RemoteError& error) {
    throw RemoteError(error.exit_code(), place->second + ": " + error.what());
  }
}

/// The study as text of study.toml. Paths are written relative to `folder` when they lie below it.
std::string study_to_toml(const Study& study, const std::filesystem::path& folder);

}  // namespace af
