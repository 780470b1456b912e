// SPDX-License-Identifier: Apache-2.0
#include "ranks/mpi_environment.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace af {
namespace {

TEST(MpiEnvironment, WithoutSupportOfThreadsIsAnError) {
  constexpr int kSingle = 0;
  constexpr int kFunneled = 1;
  EXPECT_THROW(require_threads(kSingle), RemoteError);
  EXPECT_NO_THROW(require_threads(kFunneled));
}

}  // namespace
}  // namespace af
