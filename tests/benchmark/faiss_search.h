// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "field/codebook.h"

namespace af::benchmark {

/// faiss::IndexFlatL2 on one thread. Where the build found no Faiss, make() returns null.
class FaissSearch {
 public:
  static std::unique_ptr<FaissSearch> make(const Codebook& codebook);
  virtual ~FaissSearch() = default;

  virtual void search(std::span<const Tile> tiles, std::span<std::uint32_t> nearest) const = 0;
};

/// File and configuration of the BLAS library in the process; empty without Faiss.
std::string blas_description();

}  // namespace af::benchmark
