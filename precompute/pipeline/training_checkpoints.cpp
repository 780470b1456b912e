// SPDX-License-Identifier: Apache-2.0
#include "precompute/pipeline/training_checkpoints.h"

#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <utility>

#include "base/error.h"

namespace af {

namespace {

/// Stands before the iterations and the codewords.
struct TrainingHeader {
  std::uint64_t training_tiles = 0;
  std::uint64_t held_out_tiles = 0;
  std::uint64_t iterations = 0;
  std::uint64_t codewords = 0;
};
static_assert(std::is_trivially_copyable_v<TrainingIteration>);

std::uint64_t content_bytes(const TrainingHeader& header) {
  return header.iterations * sizeof(TrainingIteration) + header.codewords * sizeof(Tile);
}

template <typename T>
void put_bytes(std::span<std::byte>& bytes, std::span<const T> values) {
  if (!values.empty()) std::memcpy(bytes.data(), values.data(), values.size_bytes());
  bytes = bytes.subspan(values.size_bytes());
}

template <typename T>
void take_bytes(std::span<const std::byte>& bytes, std::span<T> values) {
  if (!values.empty()) std::memcpy(values.data(), bytes.data(), values.size_bytes());
  bytes = bytes.subspan(values.size_bytes());
}

UnfinishedWork giving_way(UnfinishedWork work) {
  work.gives_way = true;
  return work;
}

}  // namespace

std::vector<std::byte> packed_training(const TrainedCodebook& training) {
  const TrainingHeader header{training.training_tiles,
                              training.held_out_tiles,
                              training.iterations.size(),
                              training.codebook.size()};
  std::vector<std::byte> bytes(sizeof(header) + content_bytes(header));
  std::span<std::byte> rest = bytes;
  put_bytes(rest, std::span(&header, 1));
  put_bytes(rest, std::span<const TrainingIteration>(training.iterations));
  put_bytes(rest, std::span<const Tile>(training.codebook.codewords));
  return bytes;
}

std::optional<TrainedCodebook> unpacked_training(std::span<const std::byte> bytes) {
  TrainingHeader header;
  if (bytes.size() < sizeof(header)) return std::nullopt;
  take_bytes(bytes, std::span(&header, 1));
  constexpr std::uint64_t kMostIterations = 1u << 20;  // sizes are multiplied below
  if (header.iterations > kMostIterations || header.codewords > kMaxCodewords ||
      bytes.size() != content_bytes(header))
    return std::nullopt;
  TrainedCodebook training;
  training.training_tiles = header.training_tiles;
  training.held_out_tiles = header.held_out_tiles;
  training.iterations.resize(header.iterations);
  training.codebook.codewords.resize(header.codewords);
  take_bytes(bytes, std::span(training.iterations));
  take_bytes(bytes, std::span(training.codebook.codewords));
  if (!problems(training.codebook).empty()) return std::nullopt;
  return training;
}

TrainingJournal::TrainingJournal(UnfinishedWork work,
                                 std::size_t codewords,
                                 const Communicator& communicator)
    : communicator_(communicator), store_(giving_way(std::move(work)), communicator) {
  std::vector<std::byte> last;
  all_or_none(communicator_, [&] {
    if (!communicator_.is_root()) return;
    store_.visit([&](std::int64_t, std::span<const std::byte> training) {
      last.assign(training.begin(), training.end());
    });
  });
  communicator_.broadcast(last);
  begun_ = unpacked_training(last);
  if (begun_ && begun_->codebook.size() != codewords) begun_.reset();
}

void TrainingJournal::append(const TrainedCodebook& so_far) {
  all_or_none(communicator_, [&] {
    if (!communicator_.is_root()) return;
    store_.shard().append(static_cast<std::int64_t>(so_far.iterations.size()),
                          {packed_training(so_far)});
    store_.shard().sync();
  });
}

}  // namespace af
