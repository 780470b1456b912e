// SPDX-License-Identifier: Apache-2.0
#include "files/sha256.h"

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <openssl/evp.h>
#include <vector>

#include "base/error.h"
#include "files/input_file.h"

namespace af {

struct Sha256::Impl {
  struct Free {
    void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
  };
  std::unique_ptr<EVP_MD_CTX, Free> context{EVP_MD_CTX_new()};
};

Sha256::Sha256() : impl_(std::make_unique<Impl>()) {
  check(impl_->context != nullptr &&
            EVP_DigestInit_ex(impl_->context.get(), EVP_sha256(), nullptr) == 1,
        "libcrypto cannot start SHA-256");
}
Sha256::~Sha256() = default;
Sha256::Sha256(Sha256&&) noexcept = default;
Sha256& Sha256::operator=(Sha256&&) noexcept = default;

void Sha256::update(std::span<const std::byte> bytes) {
  check(impl_ != nullptr, "Sha256 is spent");
  check(EVP_DigestUpdate(impl_->context.get(), bytes.data(), bytes.size()) == 1,
        "libcrypto cannot continue SHA-256");
}

std::string Sha256::hex_digest() {
  check(impl_ != nullptr, "Sha256 is spent");
  std::array<unsigned char, 32> digest{};
  unsigned int length = 0;
  check(EVP_DigestFinal_ex(impl_->context.get(), digest.data(), &length) == 1 &&
            length == digest.size(),
        "libcrypto cannot finish SHA-256");
  impl_.reset();
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  text.reserve(2 * digest.size());
  for (const unsigned char byte : digest) {
    text.push_back(kDigits[byte >> 4]);
    text.push_back(kDigits[byte & 15]);
  }
  return text;
}

std::string sha256_hex(std::span<const std::byte> bytes) {
  Sha256 hash;
  hash.update(bytes);
  return hash.hex_digest();
}

std::string sha256_of_file(const std::string& path) {
  std::ifstream file = open_input_file(path);
  Sha256 hash;
  std::vector<char> buffer(std::size_t{1} << 20);
  while (file) {
    errno = 0;
    file.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    hash.update(std::as_bytes(std::span(buffer).first(static_cast<std::size_t>(file.gcount()))));
  }
  // Reaching the end of the file does not set badbit.
  if (file.bad()) throw FileError(path, std::string("cannot be read: ") + strerror(errno));
  return hash.hex_digest();
}

}  // namespace af
