// SPDX-License-Identifier: Apache-2.0
#include "base/interned_text.h"

#include <mutex>
#include <set>

#include "base/fork_aware_mutex.h"

namespace af {

InternedText::InternedText(std::string_view text) {
  static ForkAwareMutex mutex;
  static std::set<std::string, std::less<>> kept;  // its elements keep their places
  if (text.empty()) return;
  const std::scoped_lock lock(mutex);
  auto found = kept.find(text);
  if (found == kept.end()) found = kept.emplace(text).first;
  kept_ = &*found;
}

const std::string& InternedText::text() const {
  static const std::string empty;
  return kept_ == nullptr ? empty : *kept_;
}

}  // namespace af
