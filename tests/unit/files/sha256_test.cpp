// SPDX-License-Identifier: Apache-2.0
#include "files/sha256.h"

#include <fstream>
#include <string_view>

#include <gtest/gtest.h>

#include "base/error.h"
#include "support/test_paths.h"

namespace af {
namespace {

// FIPS 180-4 examples.
constexpr std::string_view kOfNothing =
    "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";
constexpr std::string_view kOfAbc =
    "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
constexpr std::string_view kOfAMillionTimesA =
    "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0";

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

TEST(Sha256, ReproducesThePublishedDigests) {
  EXPECT_EQ(sha256_hex({}), kOfNothing);
  EXPECT_EQ(sha256_hex(bytes_of("abc")), kOfAbc);
  EXPECT_EQ(sha256_hex(bytes_of(std::string(1'000'000, 'a'))), kOfAMillionTimesA);
}

TEST(Sha256, DoesNotDependOnHowTheBytesAreCut) {
  Sha256 hash;
  for (const char character : std::string_view("abc")) hash.update(bytes_of({&character, 1}));
  hash.update({});
  EXPECT_EQ(hash.hex_digest(), kOfAbc);
}

TEST(Sha256, RefusesUseAfterItsDigest) {
  Sha256 hash;
  EXPECT_EQ(hash.hex_digest(), kOfNothing);
  EXPECT_THROW(hash.update(bytes_of("abc")), std::logic_error);
  EXPECT_THROW(static_cast<void>(hash.hex_digest()), std::logic_error);
}

TEST(Sha256OfFile, HashesWhatIsInTheFileAcrossBufferEnds) {
  const test::ScratchFolder folder;
  const std::string content((std::size_t{1} << 20) + 17, 'x');
  std::ofstream(folder / "data") << content;
  EXPECT_EQ(sha256_of_file(folder / "data"), sha256_hex(bytes_of(content)));
  std::ofstream(folder / "empty").close();
  EXPECT_EQ(sha256_of_file(folder / "empty"), kOfNothing);
}

TEST(Sha256OfFile, RefusesAMissingFileAndAFolder) {
  const test::ScratchFolder folder;
  EXPECT_THROW(sha256_of_file(folder / "missing"), FileError);
  EXPECT_THROW(sha256_of_file(folder.path().string()), FileError);
}

}  // namespace
}  // namespace af
