// SPDX-License-Identifier: Apache-2.0
// Types that say where a value exists. Most values are each rank's own. Two kinds are not:
//
//     RootOnly<Study> read = on_root(world, [&] { return read_study(path); });  // on rank 0
//     Shared<Study> study = std::move(read).share();                            // on every rank
//
// A rank that throws alone leaves the others waiting in their next collective call. What rank 0
// does for all may fail there alone. The failure therefore stays in the RootOnly, and only
// collective calls, which throw it on every rank, lead on from there. What each rank does by itself
// goes through all_or_none().
#pragma once

#include <cstddef>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/stored_bytes.h"
#include "ranks/communicator.h"

namespace af {

template <typename T>
class RootOnly;

/// What `make` returns on rank 0, which alone calls it. Not collective.
template <typename Make>
RootOnly<std::remove_cvref_t<std::invoke_result_t<Make>>> on_root(const Communicator& communicator,
                                                                  Make&& make);

/// A value that every rank holds, the same on all. Only RootOnly::share() makes it. It converts to
/// a `const T&`: what is the same everywhere can be used like a rank's own.
template <typename T>
class Shared {
 public:
  const T& operator*() const { return value_; }
  const T* operator->() const { return &value_; }
  operator const T&() const { return value_; }
  /// From here on each rank has its own value, which it may change.
  [[nodiscard]] T take() && { return std::move(value_); }

 private:
  friend class RootOnly<T>;
  explicit Shared(T value) : value_(std::move(value)) {}

  T value_;
};

/// A value that only rank 0 holds, or the reason why it could not be made. The other ranks hold
/// neither.
template <typename T>
class [[nodiscard]] RootOnly {
  static_assert(!std::is_void_v<T>, "do_on_root() is for work that makes no value");

 public:
  /// Calls `make` on rank 0 and keeps its result or what it throws. See on_root().
  template <typename Make>
  RootOnly(const Communicator& communicator, Make&& make) : communicator_(communicator) {
    if (!communicator.is_root()) return;
    try {
      value_.emplace(make());
    } catch (...) {
      failure_ = failure_of(std::current_exception());
    }
  }

  /// Applies `use` to the value, on rank 0 again. A failure is handed on.
  template <typename Use>
  auto then(Use&& use) const {
    return on_root(communicator_, [&] {
      if (!value_) throw_failure(failure_);
      return use(*value_);
    });
  }

  /// Collective. Returns itself once every rank knows that there is a value. Otherwise every rank
  /// throws the failure, as a RemoteError with its exit code.
  RootOnly confirmed() && {
    throw_if_failed();
    return std::move(*this);
  }

  /// Collective. The value on every rank, sent by bytes_of(), so that it keeps every bit. Otherwise
  /// like confirmed(). \test RootOnly.AValueThatIsSharedIsEqualOnEveryRank
  Shared<T> share() && {
    RootOnly<std::vector<std::byte>> sent = then([&](const T& value) {
      return communicator_.size() > 1 ? bytes_of(value) : std::vector<std::byte>();
    });
    sent.throw_if_failed();
    if (communicator_.size() > 1) {
      std::vector<std::byte> bytes;
      if (communicator_.is_root()) bytes = std::move(sent.value());
      communicator_.broadcast(bytes);
      all_or_none(communicator_, [&] {
        if (!communicator_.is_root()) value_ = value_of<T>(bytes, "what rank 0 shares");
      });
    }
    return Shared<T>(std::move(*value_));
  }

  /// The value on rank 0, once it is confirmed. Calling it elsewhere or earlier is a defect
  /// (check()): there rank 0 alone would throw.
  /// \test RootOnly.CanBeReadOnRankZeroAlone
  [[nodiscard]] const T& value() const {
    require_value();
    return *value_;
  }
  [[nodiscard]] T& value() {
    require_value();
    return *value_;
  }

 private:
  template <typename Other>
  friend class RootOnly;

  void require_value() const {
    check(communicator_.is_root(), "a value of rank 0 is read there alone");
    check(value_.has_value(), "a value of rank 0 is read once it is known to be there");
  }
  void throw_if_failed() const {
    const RankFailure failure = first_failure(communicator_, failure_);
    if (failure.exit_code != 0) throw_failure(failure);
  }

  Communicator communicator_;
  std::optional<T> value_;
  RankFailure failure_;
};

template <typename Make>
RootOnly<std::remove_cvref_t<std::invoke_result_t<Make>>> on_root(const Communicator& communicator,
                                                                  Make&& make) {
  return {communicator, std::forward<Make>(make)};
}

/// Collective. Only rank 0 calls `work`, and what it throws, every rank throws.
template <typename Work>
void do_on_root(const Communicator& communicator, Work&& work) {
  all_or_none(communicator, [&] {
    if (communicator.is_root()) work();
  });
}

}  // namespace af
