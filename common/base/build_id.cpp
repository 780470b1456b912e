// SPDX-License-Identifier: Apache-2.0
#include "base/build_id.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <link.h>
#include <span>

namespace af {

namespace {

bool holds_this_code(const dl_phdr_info& object) {
  const auto here = reinterpret_cast<std::uintptr_t>(&build_id);
  for (const ElfW(Phdr) & part : std::span(object.dlpi_phdr, object.dlpi_phnum)) {
    const std::uintptr_t begin = object.dlpi_addr + part.p_vaddr;
    if (part.p_type == PT_LOAD && here >= begin && here < begin + part.p_memsz) return true;
  }
  return false;
}

/// The build id among the notes of a segment; "" when it is not there.
std::string build_id_among(std::span<const char> notes) {
  const auto padded = [](std::size_t bytes) { return (bytes + 3) / 4 * 4; };
  constexpr std::array<char, 4> kOwner = {'G', 'N', 'U', '\0'};
  ElfW(Nhdr) head{};
  while (notes.size() >= sizeof(head)) {
    std::memcpy(&head, notes.data(), sizeof(head));
    const std::size_t value_at = sizeof(head) + padded(head.n_namesz);
    if (value_at + head.n_descsz > notes.size()) break;
    if (head.n_type == NT_GNU_BUILD_ID && head.n_namesz == kOwner.size() &&
        std::memcmp(notes.data() + sizeof(head), kOwner.data(), kOwner.size()) == 0) {
      std::string digits;
      for (const char byte : notes.subspan(value_at, head.n_descsz)) {
        const auto value = static_cast<unsigned char>(byte);
        digits += "0123456789abcdef"[value / 16];
        digits += "0123456789abcdef"[value % 16];
      }
      return digits;
    }
    notes = notes.subspan(std::min(notes.size(), value_at + padded(head.n_descsz)));
  }
  return {};
}

int find_build_id(dl_phdr_info* object, std::size_t /*size*/, void* result) {
  if (!holds_this_code(*object)) return 0;
  for (const ElfW(Phdr) & part : std::span(object->dlpi_phdr, object->dlpi_phnum)) {
    if (part.p_type != PT_NOTE) continue;
    const auto* const notes = reinterpret_cast<const char*>(object->dlpi_addr + part.p_vaddr);
    const std::string id = build_id_among({notes, part.p_memsz});
    if (!id.empty()) *static_cast<std::string*>(result) = id;
  }
  return 1;
}

}  // namespace

std::string build_id() {
  std::string id;
  dl_iterate_phdr(find_build_id, &id);
  return id;
}

}  // namespace af
