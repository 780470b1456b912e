// SPDX-License-Identifier: Apache-2.0
// Images read so that their voxels are those that the file holds.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "image_files/file_bytes.h"
#include "image_files/image_header.h"
#include "image_files/itk_image_io.h"

namespace af {

/// Hands the bytes of the voxels of a MetaImage, NRRD or NIfTI to `visit`, in order, in pieces of
/// 1 MiB (the last may be shorter), and checks that all are there which the header promises: by
/// file size, or by decompressing to the end (which also verifies the stream's own checksum).
/// FileError names expected and found bytes; surplus bytes are a warning. What `visit` has seen
/// counts for nothing when this throws.
void read_image_payload(const std::filesystem::path& path,
                        const ImageHeader& header,
                        std::vector<std::string>* warnings,
                        const ByteVisitor& visit);

/// A MetaImage, NRRD or NIfTI without values.
RawImage image_description(const ImageHeader& header);

/// The values of a described MetaImage, NRRD or NIfTI, in order and in the description's type, in
/// pieces of whole values; byte order and NIfTI's slope and intercept are applied. ITK reads
/// neither these files' values nor their headers: its libraries return zeros for missing voxels and
/// for NaN, take `LAS` for another space, and numbers by the locale of the host program.
void read_described_values(const std::filesystem::path& path,
                           const ImageHeader& header,
                           const RawImage& description,
                           std::vector<std::string>* warnings,
                           const ByteVisitor& visit);

/// An image (not DICOM) with its values.
RawImage read_stored_image(const std::filesystem::path& path,
                           const ImageHeader& header,
                           std::vector<std::string>* warnings,
                           const AcceptImage& accept);

}  // namespace af
