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

/// Collective. Gives rank 0's geometry to every rank. Sizing uses libm, whose last bit may differ
/// between processors.
void share_geometry(LightSlab& light_slab, const Communicator& communicator);

/// For one rank alone, and quick. Reads a field without its indices (identity, geometry, codebook),
/// verified as by read_field(). Throws FileError.
CompressedAttenuationField read_field_header(const std::filesystem::path& path);

/// Collective. Rank 0 reads and verifies (extents against dataspaces before allocating, checksums,
/// index range), and the others receive. Indices are held once per node. Throws FileError (exit 4)
/// on anything that does not fit, naming path, dataset, expected and found. Also refuses a field of
/// bone alone.
std::shared_ptr<const CompressedAttenuationField> read_field(const std::filesystem::path& path,
                                                             const Communicator& communicator,
                                                             FieldFileInfo* info = nullptr);

/// Throws FileError unless the field or atlas at `path` holds the bone that belongs to `all`: it
/// must come from the same CT and attenuation.
void require_bone_of(const FieldIdentity& all,
                     const FieldIdentity& found,
                     const std::filesystem::path& path);

/// Collective. Like read_field(), for either material.
std::shared_ptr<const CompressedAttenuationField> read_field_of_any_material(
    const std::filesystem::path& path,
    const Communicator& communicator,
    FieldFileInfo* info = nullptr);

/// Where programs look for the bone field that accompanies a field: A.bone.af.h5 beside A.af.h5.
std::filesystem::path bone_field_path(const std::filesystem::path& path);

/// For one rank alone, and quick. Whether a file says that it is an atlas. Throws FileError when it
/// is neither atlas nor field.
bool is_atlas_file(const std::filesystem::path& path);

/// For one rank alone, and quick. Reads an atlas without its indices; all else is verified as by
/// read_field(). Throws FileError.
AttenuationAtlas read_atlas_header(const std::filesystem::path& path);

/// Collective. The same atlas on every rank; no indices are read.
std::shared_ptr<const AttenuationAtlas> read_atlas(const std::filesystem::path& path,
                                                   const Communicator& communicator,
                                                   FieldFileInfo* info = nullptr);

/// Collective. Reads one member of an atlas and verifies it as a field. Indices are held once per
/// node. `payload_sha256` is that of the atlas when it was read before: FileError when the file has
/// changed since. Threads may call this with Communicator::alone().
std::shared_ptr<const CompressedAttenuationField> read_atlas_member(
    const std::filesystem::path& path,
    std::size_t member,
    const std::string& payload_sha256,
    const Communicator& communicator);

}  // namespace af
