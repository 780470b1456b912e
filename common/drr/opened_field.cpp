// SPDX-License-Identifier: Apache-2.0
#include "drr/opened_field.h"

#include <utility>

#include "base/error.h"
#include "drr/field_renderer.h"
#include "field/field_reading.h"
#include "ranks/root_only.h"

namespace af {

OpenedField::OpenedField(const std::filesystem::path& path,
                         const Communicator& communicator,
                         Materials materials)
    : path_(path) {
  if (*on_root(communicator, [&] { return is_atlas_file(path); }).share()) {
    atlas_ = read_atlas(path, communicator, &info_);
    all_or_none(communicator, [&] {
      if (materials == Materials::All && atlas_->identity.material != FieldMaterial::All)
        throw FileError(
            path.string(), "/material", "an atlas of all of the CT", "one of its bone alone");
    });
    coverage_ = FieldCoverage(atlas_);
  } else {
    field_ = materials == Materials::Any ? read_field_of_any_material(path, communicator, &info_)
                                         : read_field(path, communicator, &info_);
    coverage_ = FieldCoverage(field_);
  }
}

std::size_t OpenedField::codewords() const {
  return atlas_ ? atlas_->codebook.size() : field_->codebook.size();
}

OpenedField OpenedField::bone(const Communicator& communicator) const {
  if (shared_->bone) return *shared_->bone;
  const std::filesystem::path path = bone_field_path(path_);
  all_or_none(communicator, [&] {
    if (!std::filesystem::exists(path))
      throw FileError(path.string(),
                      "does not exist: a tube voltage needs a field of the CT's bone; make it with "
                      "af-precompute --material bone and otherwise the same options as the field "
                      "beside it");
  });
  OpenedField opened(path, communicator, Materials::Any);
  all_or_none(communicator, [&] { require_bone_of(identity(), opened.identity(), path); });
  shared_->bone = std::make_unique<const OpenedField>(std::move(opened));
  return *shared_->bone;
}

std::shared_ptr<const CompressedAttenuationField> OpenedField::member(
    std::size_t member, const Communicator& communicator) const {
  check(atlas_ != nullptr, "a member of an atlas");
  return read_atlas_member(path_, member, info_.payload_sha256, communicator);
}

std::vector<FieldSetMember> OpenedField::renderers(const std::string& look_up,
                                                   const std::shared_ptr<ThreadPool>& pool) const {
  const std::string way = look_up.empty() ? info_.look_up : look_up;
  if (field_) return {{coverage_.planes.front(), make_field_renderer(field_, way, pool)}};
  const auto open = [opened = *this, way, pool](std::size_t member) {
    return std::make_shared<const MemberLevels>(
        MemberLevels{make_field_renderer(opened.member(member, Communicator::alone()), way, pool)});
  };
  return atlas_level(coverage_.planes, std::make_shared<MembersInUse>(open, kMembersKept), 0);
}

std::shared_ptr<const DrrRenderer> OpenedField::renderer(
    const std::string& look_up, const std::shared_ptr<ThreadPool>& pool) const {
  std::vector<FieldSetMember> all = renderers(look_up, pool);
  if (field_) return all.front().renderer;
  return std::make_shared<const FieldSetDrr>(std::move(all));
}

}  // namespace af
