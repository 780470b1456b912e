// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace af {

/// Ends every rank of the job at once.
[[noreturn]] void abort_job(int exit_code);

/// From now on this rank can only end by abort_job(): a library is in a state in which an orderly
/// end would hang or crash.
void require_abort();
[[nodiscard]] bool is_abort_required();

}  // namespace af
