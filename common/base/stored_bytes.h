// SPDX-License-Identifier: Apache-2.0
// A struct that is kept in a journal of unfinished work, or sent between ranks, lists its members
// once, in the order of its bytes:
//
//     struct TracePoint {
//       int stage = 0;
//       double step_mm = 0.0;
//       auto members() { return std::tie(stage, step_mm); }
//     };
//
// bytes_of() and value_of() follow from that. Numbers keep every bit, including NaN and infinity.
// Bytes have this machine's order: they are for the same program (a journal names its build).
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/error.h"

namespace af {

template <typename T>
concept StoredStruct = requires(T& value) {
  value.members();
};

/// Eigen's matrices and transforms of fixed size.
template <typename T>
concept FixedMatrix = requires {
  requires T::SizeAtCompileTime >
  0;
}
|| requires {
  requires T::Dim >
  0;
};

template <typename T>
concept Optional = requires(T& value) {
  value.has_value();
  value.emplace();
};

template <typename T>
concept Map = requires {
  typename T::mapped_type;
};

/// Numbers or letters one after the other in memory.
template <typename T>
concept PlainList = requires(T& list) {
  requires std::is_arithmetic_v<std::remove_cvref_t<decltype(*list.data())>> ||
      std::is_enum_v<std::remove_cvref_t<decltype(*list.data())>>;
};

/// Appends values to bytes.
class ByteWriter {
 public:
  template <typename T>
  void add(T& value) {
    if constexpr (StoredStruct<T>) {
      std::apply([this](auto&... member) { (add(member), ...); }, value.members());
    } else if constexpr (std::is_arithmetic_v<T> || std::is_enum_v<T>) {
      add_raw(&value, sizeof(value));
    } else if constexpr (FixedMatrix<T>) {
      add_raw(value.data(), sizeof(value));
    } else if constexpr (requires { std::tuple_size<T>::value; }) {
      for (auto& element : value) add(element);
    } else if constexpr (Optional<T>) {
      bool has_value = value.has_value();
      add(has_value);
      if (has_value) add(*value);
    } else if constexpr (std::is_same_v<T, std::filesystem::path>) {
      add(value.native());
    } else if constexpr (Map<T>) {
      std::uint64_t count = value.size();
      add(count);
      for (auto& [key, mapped] : value) {
        add(key);
        add(mapped);
      }
    } else {
      add_list(value);
    }
  }
  std::vector<std::byte> take() { return std::move(bytes_); }

 private:
  void add_raw(const void* first, std::size_t count) {
    const auto* const bytes = static_cast<const std::byte*>(first);
    bytes_.insert(bytes_.end(), bytes, bytes + count);
  }
  template <typename List>
  void add_list(List& list) {
    std::uint64_t count = list.size();
    add(count);
    if constexpr (PlainList<List>)
      add_raw(list.data(), list.size() * sizeof(*list.data()));
    else
      for (auto& element : list) add(element);
  }

  std::vector<std::byte> bytes_;
};

/// Takes values from the front of bytes.
class ByteReader {
 public:
  /// `source` is what errors name.
  ByteReader(std::span<const std::byte> bytes, std::string source)
      : bytes_(bytes), source_(std::move(source)) {}

  template <typename T>
  void take(T& value) {
    if constexpr (StoredStruct<T>) {
      std::apply([this](auto&... member) { (take(member), ...); }, value.members());
    } else if constexpr (std::is_same_v<T, bool>) {
      // In a damaged record, a byte may be neither 0 nor 1, which no bool can hold.
      std::uint8_t byte = 0;
      take(byte);
      value = byte != 0;
    } else if constexpr (std::is_arithmetic_v<T> || std::is_enum_v<T>) {
      take_raw(&value, sizeof(value));
    } else if constexpr (FixedMatrix<T>) {
      take_raw(value.data(), sizeof(value));
    } else if constexpr (requires { std::tuple_size<T>::value; }) {
      for (auto& element : value) take(element);
    } else if constexpr (Optional<T>) {
      bool has_value = false;
      take(has_value);
      if (has_value) take(value.emplace());
    } else if constexpr (std::is_same_v<T, std::filesystem::path>) {
      std::string text;
      take(text);
      value = text;
    } else if constexpr (Map<T>) {
      std::uint64_t count = 0;
      take(count);
      require(count <= bytes_.size());
      for (std::uint64_t i = 0; i < count; ++i) {
        typename T::key_type key{};
        take(key);
        take(value[key]);
      }
    } else {
      take_list(value);
    }
  }
  void require_end() const { require(bytes_.empty()); }

 private:
  void require(bool is_whole) const {
    if (!is_whole)
      throw FileError(source_, "a record does not have the right size: start over with --restart");
  }
  void take_raw(void* first, std::size_t count) {
    require(count <= bytes_.size());
    if (count > 0) std::memcpy(first, bytes_.data(), count);
    bytes_ = bytes_.subspan(count);
  }
  template <typename List>
  void take_list(List& list) {
    std::uint64_t count = 0;
    take(count);
    // Every element takes at least a byte, so a hostile count asks for no more than the record has.
    require(count <= bytes_.size());
    if constexpr (PlainList<List>) {
      list.resize(static_cast<std::size_t>(count));
      take_raw(list.data(), list.size() * sizeof(*list.data()));
    } else {
      // Elements are appended one by one, because one may be far larger in memory than its minimum
      // of one byte in the record.
      for (std::uint64_t i = 0; i < count; ++i) take(list.emplace_back());
    }
  }

  std::span<const std::byte> bytes_;
  std::string source_;
};

template <typename T>
std::vector<std::byte> bytes_of(T value) {
  ByteWriter writer;
  writer.add(value);
  return writer.take();
}

/// Throws FileError naming `source` when the bytes are too few or too many.
template <typename T>
T value_of(std::span<const std::byte> bytes, const std::string& source) {
  T value{};
  ByteReader reader(bytes, source);
  reader.take(value);
  reader.require_end();
  return value;
}

}  // namespace af
