// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <string>
#include <string_view>

namespace af {

/// A text in eight bytes, for a few distinct texts that are repeated millions of times. Each
/// distinct text is kept once, until the program ends. Trivially copyable, and empty when all bytes
/// are zero. \test InternedText.KeepsEqualTextsOnce
class InternedText {
 public:
  InternedText() = default;
  /// Safe in any thread.
  explicit InternedText(std::string_view text);
  InternedText& operator=(std::string_view text) { return *this = InternedText(text); }

  [[nodiscard]] const std::string& text() const;
  operator const std::string&() const { return text(); }  // NOLINT(google-explicit-constructor)

  friend bool operator==(InternedText a, InternedText b) { return a.kept_ == b.kept_; }
  friend bool operator==(InternedText a, std::string_view b) { return a.text() == b; }
  friend std::strong_ordering operator<=>(InternedText a, InternedText b) {
    return a.text() <=> b.text();
  }

 private:
  const std::string* kept_ = nullptr;
};

}  // namespace af
