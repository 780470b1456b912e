// SPDX-License-Identifier: Apache-2.0
// Reads fields and atlases from files, and checks what files that belong together must share.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>

#include "field/attenuation_atlas.h"
#include "field/compressed_attenuation_field.h"
#include "field/field_file.h"
#include "ranks/communicator.h"

namespace af {

/// Collective. Rank 0's geometry on every rank: sizing uses libm, whose last bit may differ between
/// processors.
void share_geometry(LightSlab& light_slab, const Communicator& communicator);

/// One rank alone, and quick: a field without its indices (identity, geometry, codebook), verified
/// as read_field() does. FileError.
CompressedAttenuationField read_field_header(const std::filesystem::path& path);

/// Collective. Rank 0 reads and verifies (extents against dataspaces before allocating, checksums,
/// index range), the rest receive it; indices are held once per node. FileError (exit 4) on
/// anything that does not fit: names path, dataset, expected, found. A field of bone's part alone
/// is refused, too.
std::shared_ptr<const CompressedAttenuationField> read_field(const std::filesystem::path& path,
                                                             const Communicator& communicator,
                                                             FieldFileInfo* info = nullptr);

/// FileError unless the field or atlas in the file `path` holds the bone that belongs to `all`: it
/// must be of the same CT and attenuation.
void require_bone_of(const FieldIdentity& all,
                     const FieldIdentity& found,
                     const std::filesystem::path& path);

/// Collective. As read_field(), of either material.
std::shared_ptr<const CompressedAttenuationField> read_field_of_any_material(
    const std::filesystem::path& path,
    const Communicator& communicator,
    FieldFileInfo* info = nullptr);

/// Where programs look for the field of bone's part beside a field: A.bone.af.h5 beside A.af.h5.
std::filesystem::path bone_field_path(const std::filesystem::path& path);

/// One rank alone, and quick: whether a file says that it is an atlas. FileError when it is neither
/// atlas nor field.
bool is_atlas_file(const std::filesystem::path& path);

/// One rank alone, and quick: reads an atlas without its indices; all else is verified as by
/// read_field(). FileError.
AttenuationAtlas read_atlas_header(const std::filesystem::path& path);

/// Collective. The same on every rank; no indices are read.
std::shared_ptr<const AttenuationAtlas> read_atlas(const std::filesystem::path& path,
                                                   const Communicator& communicator,
                                                   FieldFileInfo* info = nullptr);

/// Collective. One member of an atlas, read and verified as a field; indices are held once per
/// node. `payload_sha256` is that of the atlas when it was read before; FileError when the file has
/// changed since. Threads may call this with Communicator::alone().
std::shared_ptr<const CompressedAttenuationField> read_atlas_member(
    const std::filesystem::path& path,
    std::size_t member,
    const std::string& payload_sha256,
    const Communicator& communicator);

}  // namespace af
