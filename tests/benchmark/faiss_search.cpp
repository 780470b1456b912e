// SPDX-License-Identifier: Apache-2.0
#include "benchmark/faiss_search.h"

#include <algorithm>
#include <cstdlib>
#include <dlfcn.h>
#include <faiss/IndexFlat.h>
#include <omp.h>

#include "base/error.h"

extern "C" void sgemm_();  // NOLINT(readability-identifier-naming): the name of BLAS

namespace af::benchmark {

namespace {

std::vector<float> floats_of(std::span<const Tile> tiles) {
  std::vector<float> values;
  values.reserve(tiles.size() * kTileElements);
  for (const Tile& tile : tiles)
    for (const std::uint16_t level : tile) values.push_back(level);
  return values;
}

class FlatSearch final : public FaissSearch {
 public:
  explicit FlatSearch(const Codebook& codebook) : index_(static_cast<std::int64_t>(kTileElements)) {
    const std::vector<float> values = floats_of(codebook.codewords);
    index_.add(static_cast<std::int64_t>(codebook.size()), values.data());
  }

  void search(std::span<const Tile> tiles, std::span<std::uint32_t> nearest) const override {
    check(nearest.size() == tiles.size(), "one answer per tile");
    omp_set_num_threads(1);
    const std::vector<float> queries = floats_of(tiles);
    std::vector<float> distances(tiles.size());
    std::vector<faiss::Index::idx_t> labels(tiles.size());
    index_.search(static_cast<std::int64_t>(tiles.size()),
                  queries.data(),
                  1,
                  distances.data(),
                  labels.data());
    std::transform(labels.begin(), labels.end(), nearest.begin(), [](faiss::Index::idx_t label) {
      return static_cast<std::uint32_t>(label);
    });
  }

 private:
  faiss::IndexFlatL2 index_;
};

}  // namespace

std::unique_ptr<FaissSearch> FaissSearch::make(const Codebook& codebook) {
  return std::make_unique<FlatSearch>(codebook);
}

std::string blas_description() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&sgemm_), &info) == 0) return "unknown";
  std::string description = info.dli_fname;
  if (char* resolved = realpath(info.dli_fname, nullptr)) {
    description = resolved;
    std::free(resolved);
  }
  using Text = const char* (*)();
  for (const char* function : {"openblas_get_config", "openblas_get_corename"})
    if (void* symbol = dlsym(RTLD_DEFAULT, function))
      description += std::string(": ") + reinterpret_cast<Text>(symbol)();
  return description;
}

}  // namespace af::benchmark
