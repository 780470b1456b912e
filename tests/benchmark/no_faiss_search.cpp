// SPDX-License-Identifier: Apache-2.0
// In place of faiss_search.cpp where the build found no Faiss.
#include "benchmark/faiss_search.h"

namespace af::benchmark {

std::unique_ptr<FaissSearch> FaissSearch::make(const Codebook&) {
  return nullptr;
}

std::string blas_description() {
  return {};
}

}  // namespace af::benchmark
