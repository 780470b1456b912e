// SPDX-License-Identifier: Apache-2.0
// Reads a few numbers and texts (poses, cameras) from an HDF5 file that somebody else wrote. Links
// other than hard ones are refused, and so are datasets whose values lie in another file: HDF5
// opens only the file it is given. (Fields, which are large, are read by field_file.)
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace af {

/// Whether bytes begin as an HDF5 file does.
bool is_hdf5_head(std::string_view bytes);

/// Numbers of a dataset, the last extent fastest; no extents: a scalar.
struct Hdf5Numbers {
  std::vector<double> values;
  std::vector<std::size_t> extents;
};

/// An HDF5 file, open for reading. Everything throws FileError that begins with the file's name:
/// for damaged files, for what is absent and for values of another kind than asked for.
class Hdf5Input {
 public:
  /// A file on the disk; its datasets may be of any size, what is read of them is small.
  static Hdf5Input of_file(const std::filesystem::path& path);
  /// A file that is in memory.
  static Hdf5Input of_bytes(std::string bytes, std::string name);
  Hdf5Input(Hdf5Input&&) noexcept;
  Hdf5Input& operator=(Hdf5Input&&) noexcept;
  Hdf5Input(const Hdf5Input&) = delete;
  Hdf5Input& operator=(const Hdf5Input&) = delete;
  ~Hdf5Input();

  [[nodiscard]] const std::string& name() const { return name_; }
  /// Whether there is a link of that path ("/group/dataset"), whatever it leads to.
  [[nodiscard]] bool holds(const std::string& path) const;
  /// The names of what a group that has been read from holds, at most 1000.
  [[nodiscard]] std::vector<std::string> names_in(const std::string& group) const;
  /// At most `most` finite numbers of at most two extents, whole ones or not.
  [[nodiscard]] Hdf5Numbers numbers(const std::string& path, std::size_t most) const;
  /// One text of at most 256 bytes, of variable length or of a fixed one.
  [[nodiscard]] std::string text(const std::string& path) const;

 private:
  struct State;
  Hdf5Input(std::unique_ptr<State> state, std::string name);
  std::unique_ptr<State> state_;
  std::string name_;
};

/// Runs `read` in a copy of the process and discards what it found. FileError, which begins with
/// the file's name, when HDF5 ends the copy.
void rehearse_reading(const std::string& name, const std::function<void()>& read);

/// read(open()), rehearsed first: HDF5 1.10 ends the process (signal 11) on some damaged files.
/// \test Hdf5Input.AFileThatEndsHdf5IsAFileError
template <typename Open, typename Read>
auto read_distrusted(const std::string& name, const Open& open, const Read& read) {
  rehearse_reading(name, [&] {
    const Hdf5Input file = open();
    (void)read(file);
  });
  const Hdf5Input file = open();
  return read(file);
}

}  // namespace af
