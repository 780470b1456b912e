// SPDX-License-Identifier: Apache-2.0
// Images read so that their voxels are those that the file holds.
#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "images/image_header.h"

namespace af {

/// Pieces of voxels, in order.
using ByteVisitor = std::function<void(std::span<const std::byte>)>;

/// Hands the bytes of the voxels of a MetaImage, NRRD or NIfTI to `visit`, in order, in pieces of
/// 1 MiB (the last may be shorter), and checks that all are there which the header promises: by
/// file size, or by decompressing to the end (which also verifies the stream's own checksum).
/// FileError names expected and found bytes; surplus bytes are a warning. What `visit` has seen
/// counts for nothing when this throws.
void read_image_payload(const std::filesystem::path& path,
                        const ImageHeader& header,
                        std::vector<std::string>* warnings,
                        const ByteVisitor& visit);

/// The values of a MetaImage, NRRD or NIfTI, in order and in the type of `header.image`, in pieces
/// of whole values; byte order and NIfTI's slope and intercept are applied. ITK 5.2 reads neither
/// these files' values nor their headers. Where voxels are missing, or their stream is damaged,
/// MetaIO leaves what was in memory and NIfTI's library gives zeros, as it does for NaN; a NaN in a
/// NIfTI's sform ends the process. NrrdIO takes left-anterior-superior for another space. None of
/// them heeds units, or a header that contradicts itself.
void read_described_values(const std::filesystem::path& path,
                           const ImageHeader& header,
                           std::vector<std::string>* warnings,
                           const ByteVisitor& visit);

/// An image (not DICOM) with its values.
RawImage read_stored_image(const std::filesystem::path& path,
                           const ImageHeader& header,
                           std::vector<std::string>* warnings,
                           const AcceptImage& accept);

/// Writes an image by ITK and reads it back; the format follows the extension: .mha .nii .nii.gz
/// .nrrd .tif .tiff .png. Appears under its name only when complete. UsageError for another
/// extension.
void write_raw_image(const RawImage& image, const std::filesystem::path& path);

}  // namespace af
