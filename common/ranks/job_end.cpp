// SPDX-License-Identifier: Apache-2.0
#include "ranks/job_end.h"

#include <atomic>
#include <cstdlib>

#include "ranks/rank_group.h"

namespace af {

namespace {

std::atomic<bool> abort_required = false;

}  // namespace

void abort_job(int exit_code) {
  const std::shared_ptr<RankGroup> ranks = ranks_of_job();
  // With one rank there is nobody to notify.
  if (ranks != nullptr && ranks->size() > 1) ranks->abort(exit_code);
  std::_Exit(exit_code);
}

void require_abort() {
  abort_required = true;
}

bool is_abort_required() {
  return abort_required;
}

}  // namespace af
