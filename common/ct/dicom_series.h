// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "ct/ct_read_options.h"
#include "ct/ct_volume.h"
#include "ct/hu_values.h"

namespace af {

/// What a DICOM folder's CT says besides its voxels.
struct DicomCt {
  CtGrid grid;
  HuValues values;  ///< rescaled, i fastest, slices ascending along the slice normal
};

/// The regular files directly in a folder, by name. Throws FileError when it cannot be listed.
std::vector<std::filesystem::path> files_of(const std::filesystem::path& folder);

/// True when a folder holds at least one DICOM file.
bool holds_dicom(const std::filesystem::path& folder);

/// Reads the CT series of a DICOM folder (GDCM). Slices are ordered by position along the slice
/// normal, never by name or number. What leans or is uneven is resampled if `options` say so, with
/// a warning that tells by how much. Errors are those of read_ct(). Files that are no images of a
/// series are skipped with a warning.
DicomCt read_dicom_series(const std::filesystem::path& folder,
                          const CtReadOptions& options,
                          std::vector<std::string>* warnings);

/// Frame of Reference UID of the series that read_dicom_series() reads, from headers alone; empty
/// when it states none. Throws as read_dicom_series() does when it chooses the series.
std::string dicom_frame_of_reference(const std::filesystem::path& folder,
                                     const std::string& series_uid);

/// What a single DICOM image says of itself, for messages.
std::string describe_dicom_file(const std::filesystem::path& path);

}  // namespace af
