// SPDX-License-Identifier: Apache-2.0
// Reads images such that their voxels are those that the file holds.
#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "images/image_header.h"

namespace af {

/// Receives pieces of voxels, in order.
using ByteVisitor = std::function<void(std::span<const std::byte>)>;

/// Hands the bytes of the voxels of a MetaImage, NRRD or NIfTI to `visit`, in order, in pieces of 1
/// MiB (the last may be shorter). Checks that all promised bytes are there: by file size, or by
/// decompressing to the end (which also verifies the stream's own checksum). FileError names
/// expected and found bytes; surplus bytes are a warning. Discard what `visit` has seen when this
/// throws.
void read_image_payload(const std::filesystem::path& path,
                        const ImageHeader& header,
                        std::vector<std::string>* warnings,
                        const ByteVisitor& visit);

/// The values of a MetaImage, NRRD or NIfTI, in order and in the type of `header.image`, in pieces
/// of whole values. Byte order and NIfTI's slope and intercept are applied.
/// ITK 5.2 reads neither these files' values nor their headers. Where voxels are missing or their
/// stream is damaged, MetaIO leaves what was in memory, and NIfTI's library gives zeros, as it does
/// for NaN. A NaN in a NIfTI's sform ends the process. NrrdIO takes left-anterior-superior for
/// another space. None of them heeds units, or a header that contradicts itself.
void read_described_values(const std::filesystem::path& path,
                           const ImageHeader& header,
                           std::vector<std::string>* warnings,
                           const ByteVisitor& visit);

/// Reads an image (not DICOM) with its values.
RawImage read_stored_image(const std::filesystem::path& path,
                           const ImageHeader& header,
                           std::vector<std::string>* warnings,
                           const AcceptImage& accept);

/// Writes an image by ITK and reads it back. The format follows the extension: .mha .nii .nii.gz
/// .nrrd .tif .tiff .png. The file appears only when complete. Throws UsageError for another
/// extension.
void write_raw_image(const RawImage& image, const std::filesystem::path& path);

}  // namespace af
