// SPDX-License-Identifier: Apache-2.0
// The readers and writers in kCameraFormats (camera_formats.cpp). docs/cameras.md and the comment
// above each reader describe its convention. Readers throw FileError for files that cannot be
// parsed and InputError for values that cannot be a camera's; they mark in the StatedCamera what a
// file leaves open. Writers return the bytes of a file that the reader reads back.
#pragma once

#include <string>

#include "camera_files/camera_file.h"
#include "camera_files/rig_toml.h"
#include "camera_files/stated_rig.h"

namespace af {

bool is_rig_toml(const CameraFile& file);
StatedRig read_rig_toml(const CameraFile& file, const CameraFileOptions& options);

bool is_mayacam1(const CameraFile& file);
StatedRig read_mayacam1(const CameraFile& file, const CameraFileOptions& options);
std::string write_mayacam1(const CameraRig& rig);

bool is_mayacam2(const CameraFile& file);
StatedRig read_mayacam2(const CameraFile& file, const CameraFileOptions& options);
std::string write_mayacam2(const CameraRig& rig);

bool is_opencv_yaml(const CameraFile& file);
StatedRig read_opencv_yaml(const CameraFile& file, const CameraFileOptions& options);
std::string write_opencv_yaml(const CameraRig& rig);

bool is_matrix_text(const CameraFile& file);
StatedRig read_matrix_text(const CameraFile& file, const CameraFileOptions& options);
std::string write_matrix_text(const CameraRig& rig);

bool is_rtk_geometry(const CameraFile& file);
StatedRig read_rtk_geometry(const CameraFile& file, const CameraFileOptions& options);
std::string write_rtk_geometry(const CameraRig& rig);

bool is_plastimatch(const CameraFile& file);
StatedRig read_plastimatch(const CameraFile& file, const CameraFileOptions& options);
std::string write_plastimatch(const CameraRig& rig);

bool is_plastimatch_command(const CameraFile& file);
StatedRig read_plastimatch_command(const CameraFile& file, const CameraFileOptions& options);

bool is_elastix(const CameraFile& file);
StatedRig read_elastix(const CameraFile& file, const CameraFileOptions& options);
std::string write_elastix(const CameraRig& rig);

bool is_xreg_hdf5(const CameraFile& file);
StatedRig read_xreg_hdf5(const CameraFile& file, const CameraFileOptions& options);
std::string write_xreg_hdf5(const CameraRig& rig);

bool is_rad_header(const CameraFile& file);
StatedRig read_rad_header(const CameraFile& file, const CameraFileOptions& options);
std::string write_rad_header(const CameraRig& rig);

bool is_diffdrr_camera(const CameraFile& file);
StatedRig read_diffdrr_camera(const CameraFile& file, const CameraFileOptions& options);
std::string write_diffdrr_camera(const CameraRig& rig);

bool is_dicom_xray(const CameraFile& file);
StatedRig read_dicom_xray(const CameraFile& file, const CameraFileOptions& options);

}  // namespace af
