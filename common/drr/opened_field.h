// SPDX-License-Identifier: Apache-2.0
// A file that holds a field or an atlas, for programs that take either.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/thread_pool.h"
#include "drr/atlas_renderers.h"
#include "drr/drr_renderer.h"
#include "drr/field_coverage.h"
#include "drr/field_level.h"
#include "field/field_file.h"
#include "ranks/communicator.h"

namespace af {

/// What is looked up in a field instead of its codewords.
struct FieldSamples {
  std::shared_ptr<const FieldLevel> level_0;  ///< null: codewords are looked up
  FieldLevels pyramid;                        ///< levels 1, ...
};

/// A field with its indices, or an atlas whose members are read when they are needed. Copies share
/// everything.
class OpenedField {
 public:
  enum class Materials { All, Any };

  /// Collective. Throws as read_field() and read_atlas() do. Also refuses a field of bone alone,
  /// unless `materials` is Any.
  OpenedField(const std::filesystem::path& path,
              const Communicator& communicator,
              Materials materials = Materials::All);

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] const FieldFileInfo& info() const { return info_; }
  /// For an atlas: the camera and frame from which its members were derived.
  [[nodiscard]] const FieldIdentity& identity() const {
    return atlas_ ? atlas_->identity : field_->identity;
  }
  /// Null for an atlas.
  [[nodiscard]] const std::shared_ptr<const CompressedAttenuationField>& field() const {
    return field_;
  }
  /// Null for a field.
  [[nodiscard]] const std::shared_ptr<const AttenuationAtlas>& atlas() const { return atlas_; }
  /// The planes of the field, or of every member.
  [[nodiscard]] const FieldCoverage& coverage() const { return coverage_; }
  [[nodiscard]] std::size_t codewords() const;

  /// Collective, for one thread at a time. The field or atlas of the CT's bone beside it, for DRRs
  /// of a tube's spectrum. It is opened once, and need not be cut like this one. Throws FileError
  /// where there is none that belongs to it.
  [[nodiscard]] OpenedField bone(const Communicator& communicator) const;

  /// For a field: the samples that its users have made so far, for one thread at a time.
  [[nodiscard]] FieldSamples& samples() const { return shared_->samples; }

  /// Collective for a communicator of ranks. One member of an atlas.
  [[nodiscard]] std::shared_ptr<const CompressedAttenuationField> member(
      std::size_t member, const Communicator& communicator) const;

  /// The field, or every member, looked up by a name of field_look_up_names(), or the file's own
  /// way where the name is empty. At most kMembersKept members of an atlas are in memory, read by
  /// this process alone.
  [[nodiscard]] std::vector<FieldSetMember> renderers(
      const std::string& look_up, const std::shared_ptr<ThreadPool>& pool = nullptr) const;
  /// One renderer that joins them all.
  [[nodiscard]] std::shared_ptr<const DrrRenderer> renderer(
      const std::string& look_up, const std::shared_ptr<ThreadPool>& pool = nullptr) const;

  static constexpr std::size_t kMembersKept = 4;

 private:
  std::filesystem::path path_;
  FieldFileInfo info_;
  std::shared_ptr<const CompressedAttenuationField> field_;
  std::shared_ptr<const AttenuationAtlas> atlas_;
  FieldCoverage coverage_;
  struct Shared {
    std::unique_ptr<const OpenedField> bone;
    FieldSamples samples;
  };
  std::shared_ptr<Shared> shared_ = std::make_shared<Shared>();
};

}  // namespace af
