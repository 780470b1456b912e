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

/// Checks that all voxels which the header promises are there: by file size, or by decompressing to
/// the end (which also verifies the stream's own checksum). The libraries behind ITK fill missing
/// voxels with zeros, and that of PNG aborts the process on a damaged header, which is walked
/// here first. FileError names expected and found bytes; surplus bytes are a warning.
void check_image_payload(const std::filesystem::path& path,
                         const ImageHeader& header,
                         std::vector<std::string>* warnings);

/// The same, and hands the bytes of the voxels to `visit` on the way, in order, in pieces of 1 MiB
/// (the last may be shorter). What `visit` has seen counts for nothing when this throws.
void read_image_payload(const std::filesystem::path& path,
                        const ImageHeader& header,
                        std::vector<std::string>* warnings,
                        const ByteVisitor& visit);

/// Throws when the reader does not want the image; sees it without values.
using AcceptImage = std::function<void(const RawImage&)>;

/// An image (not DICOM) without values. FileError when it is damaged or its header reads
/// differently to us and to ITK.
RawImage read_image_description(const std::filesystem::path& path,
                                const ImageHeader& header,
                                const AcceptImage& accept);

/// The values of a described MetaImage, NRRD or NIfTI, in order and in the description's type, in
/// pieces of whole values; byte order and NIfTI's slope and intercept are applied. ITK does not
/// read them, because its libraries return zeros for missing voxels and for NaN.
void read_described_values(const std::filesystem::path& path,
                           const ImageHeader& header,
                           const RawImage& description,
                           std::vector<std::string>* warnings,
                           const ByteVisitor& visit);

/// An image (not DICOM) with its values; those of PNG and TIFF are read by ITK after
/// check_image_payload().
RawImage read_stored_image(const std::filesystem::path& path,
                           const ImageHeader& header,
                           std::vector<std::string>* warnings,
                           const AcceptImage& accept);

}  // namespace af
