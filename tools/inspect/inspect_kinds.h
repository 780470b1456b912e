// SPDX-License-Identifier: Apache-2.0
// One function per kind of file. Each adds kind, facts and warnings to an inspection, or throws
// af::Error.
#pragma once

#include <Eigen/Core>

#include "tools/inspect/inspection.h"

namespace af {

void inspect_ct(const std::filesystem::path& path,
                const CtReadOptions& options,
                Inspection& inspection);
/// A 2-D image, or a stack of DRRs. A 3-D image of HU is passed to inspect_ct().
void inspect_image(const std::filesystem::path& path,
                   const CtReadOptions& options,
                   Inspection& inspection);
/// Collective.
void inspect_field(const std::filesystem::path& path,
                   const Communicator& communicator,
                   Inspection& inspection);
void inspect_rig(const std::string& name_or_path, Inspection& inspection);
void inspect_study(const std::filesystem::path& path, Inspection& inspection);
void inspect_pose(const std::filesystem::path& path, Inspection& inspection);
void inspect_csv(const std::filesystem::path& path, Inspection& inspection);
void inspect_json(const std::filesystem::path& path, Inspection& inspection);

nlohmann::ordered_json vector_json(const Eigen::Ref<const Eigen::VectorXd>& vector);

}  // namespace af
