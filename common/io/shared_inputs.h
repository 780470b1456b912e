// SPDX-License-Identifier: Apache-2.0
// Small inputs that rank 0 reads for all: ten thousand ranks do not open one file.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "image/image2d.h"
#include "io/study_file.h"
#include "parallel/communicator.h"

namespace af {

/// Collective. read_study() on rank 0; the others are sent what it read. What it throws, every rank
/// throws. `warnings` are rank 0's.
Study read_study(const std::filesystem::path& path,
                 const Communicator& communicator,
                 std::vector<std::string>* warnings = nullptr);

/// Collective. Rank 0's image, to the last bit, on every rank.
void broadcast(Image2d& image, const Communicator& communicator);

}  // namespace af
