// SPDX-License-Identifier: Apache-2.0
// What af-register does between its command line and its output folder.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "ranks/communicator.h"
#include "ranks/resumable_items.h"
#include "register/register_options.h"
#include "register/verdict/registration.h"
#include "study/pose_format.h"

namespace af::registration {

/// The starts of a run: those of --starts, the one of --start-pose, or the nominal pose moved by
/// --start-rotation-deg and --start-translation-mm. `context` is the case's, with its frame.
/// `notes` receives what a file's reader left out or assumed. Throws InputError when a frame of
/// --starts before the last pose has no pose, because frames number the rows.
std::vector<RigidTransform> start_poses(const RegisterOptions& options,
                                        const PoseContext& context,
                                        std::vector<std::string>& notes);

/// Collective. Loads the case, registers it from every start and writes the output folder. Throws
/// NotFoundError, after writing the results, when no pose was found, or a doubtful one with
/// --require-found.
void run_registration(const RegisterOptions& typed,
                      const std::string& command_line,
                      const Communicator& world);

/// Collective. Registers from every start. Ranks take starts as they become free. With several
/// starts, finished ones are saved (see ResumableItems), so that a stopped or killed run can
/// resume. Rank 0 returns one record per start, in the order of starts; the others return none.
/// Only the record of the highest similarity (ties: the lowest start index) keeps its trace, so
/// that memory does not grow with the number of starts.
std::vector<RegistrationRecord> register_starts(Registration& registration,
                                                std::span<const RigidTransform> starts,
                                                const UnfinishedWork& unfinished,
                                                const Communicator& communicator);

}  // namespace af::registration
