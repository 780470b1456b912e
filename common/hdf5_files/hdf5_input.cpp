// SPDX-License-Identifier: Apache-2.0
#include "hdf5_files/hdf5_input.h"

#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <utility>

#include "base/contained_work.h"
#include "base/error.h"
#include "hdf5_files/hdf5_handles.h"

namespace af {
namespace {

hdf5::Handle file_access() {
  return {H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "H5Pcreate"};
}

hdf5::Handle opened_file(const std::string& name) {
  const hdf5::Handle access = file_access();
  return {H5Fopen(name.c_str(), H5F_ACC_RDONLY, access), H5Fclose, "H5Fopen"};
}

/// Opens these bytes as if they were a file. HDF5 copies them.
hdf5::Handle opened_bytes(std::string bytes) {
  const hdf5::Handle access = file_access();
  hdf5::checked(H5Pset_fapl_core(access, hdf5::kMemoryStep, 0), "H5Pset_fapl_core");
  hdf5::checked(H5Pset_file_image(access, bytes.data(), bytes.size()), "H5Pset_file_image");
  return {H5Fopen(hdf5::memory_name().c_str(), H5F_ACC_RDONLY, access), H5Fclose, "H5Fopen"};
}

/// Of this file itself, uncompressed or deflated in small pieces.
void check_storage(hid_t dataset, const std::string& where) {
  const hdf5::Handle creation(H5Dget_create_plist(dataset), H5Pclose, "H5Dget_create_plist");
  const H5D_layout_t layout = H5Pget_layout(creation);
  if (layout == H5D_VIRTUAL || (layout == H5D_CONTIGUOUS && H5Pget_external_count(creation) != 0))
    throw FileError(where, "holds the contents of another file");
  if (layout != H5D_CHUNKED) return;
  constexpr hsize_t kMostOfAChunk = 4096;
  std::array<hsize_t, H5S_MAX_RANK> chunk{};
  const int rank =
      hdf5::checked(H5Pget_chunk(creation, H5S_MAX_RANK, chunk.data()), "H5Pget_chunk");
  hsize_t elements = 1;
  for (int i = 0; i < rank; ++i) {
    elements = chunk[static_cast<std::size_t>(i)] > kMostOfAChunk
                   ? kMostOfAChunk + 1
                   : elements * chunk[static_cast<std::size_t>(i)];
    if (elements > kMostOfAChunk) throw FileError(where, "is stored in large pieces");
  }
  const int filters = hdf5::checked(H5Pget_nfilters(creation), "H5Pget_nfilters");
  for (int i = 0; i < filters; ++i) {
    unsigned flags = 0;
    std::size_t values = 0;
    if (H5Pget_filter2(
            creation, static_cast<unsigned>(i), &flags, &values, nullptr, 0, nullptr, nullptr) !=
        H5Z_FILTER_DEFLATE)
      throw FileError(where, "is compressed in another way than by deflate");
  }
}

std::vector<std::size_t> extents_of(hid_t dataset, const std::string& where) {
  const hdf5::Handle space(H5Dget_space(dataset), H5Sclose, "H5Dget_space");
  constexpr int kMostExtents = 2;
  if (H5Sget_simple_extent_type(space) == H5S_NULL) throw FileError(where, "holds no values");
  const int rank = hdf5::checked(H5Sget_simple_extent_ndims(space), "H5Sget_simple_extent_ndims");
  if (rank > kMostExtents) throw FileError(where, "has more than two extents");
  std::array<hsize_t, kMostExtents> sizes{};
  hdf5::checked(H5Sget_simple_extent_dims(space, sizes.data(), nullptr),
                "H5Sget_simple_extent_dims");
  return {sizes.begin(), sizes.begin() + rank};
}

std::vector<double> values_of(hid_t dataset, std::size_t count, const std::string& where) {
  std::vector<double> values(count);
  if (count > 0)
    hdf5::checked(H5Dread(dataset, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()),
                  "H5Dread");
  for (const double value : values)
    if (!std::isfinite(value)) throw FileError(where, "holds a number that is not finite");
  return values;
}

constexpr std::size_t kMostTextBytes = 256;

std::uint64_t little_endian(std::string_view bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = bytes.size(); i-- > 0;)
    value = value << 8 | static_cast<unsigned char>(bytes[i]);
  return value;
}

/// The bytes of a file, in memory or on the disk.
class FileBytes {
 public:
  explicit FileBytes(std::string bytes) : bytes_(std::move(bytes)) {}
  explicit FileBytes(const std::filesystem::path& path) : file_(path, std::ios::binary) {}

  /// FileError that begins with `where` when the file ends before.
  [[nodiscard]] std::string part(std::uint64_t offset,
                                 std::size_t count,
                                 const std::string& where) {
    if (!file_.is_open()) {
      if (offset <= bytes_.size() && count <= bytes_.size() - offset)
        return bytes_.substr(static_cast<std::size_t>(offset), count);
    } else if (offset <= std::uint64_t{std::numeric_limits<std::int64_t>::max()}) {
      std::string found(count, '\0');
      file_.clear();
      file_.seekg(static_cast<std::streamoff>(offset));
      if (file_.read(found.data(), static_cast<std::streamsize>(count))) return found;
    }
    throw FileError(where, "damaged HDF5: a text lies behind the end of the file");
  }

  /// A global heap, from its head on. It is kept: the texts of a file share few.
  [[nodiscard]] const std::string& heap(std::uint64_t offset, const std::string& where) {
    if (!heap_.empty() && heap_offset_ == offset) return heap_;
    constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 24;
    heap_.clear();
    const std::string head = part(offset, kHeapHeadBytes, where);
    const std::uint64_t bytes = little_endian(std::string_view(head).substr(8, 8));
    if (!head.starts_with(std::string_view("GCOL\1", 5)) || bytes < kHeapHeadBytes ||
        bytes > kMostBytes)
      throw FileError(where, "damaged HDF5: its text is in no heap");
    heap_ = part(offset, static_cast<std::size_t>(bytes), where);
    heap_offset_ = offset;
    return heap_;
  }

  static constexpr std::size_t kHeapHeadBytes = 16;

 private:
  std::string bytes_;   ///< of a file in memory
  std::ifstream file_;  ///< open: the file is on the disk
  std::string heap_;    ///< the last one
  std::uint64_t heap_offset_ = 0;
};

void check_plain_addresses(hid_t file, const std::string& where) {
  const hdf5::Handle creation(H5Fget_create_plist(file), H5Pclose, "H5Fget_create_plist");
  std::size_t address_bytes = 0;
  std::size_t length_bytes = 0;
  hsize_t user_block = 0;
  hdf5::checked(H5Pget_sizes(creation, &address_bytes, &length_bytes), "H5Pget_sizes");
  hdf5::checked(H5Pget_userblock(creation, &user_block), "H5Pget_userblock");
  if (address_bytes != 8 || length_bytes != 8 || user_block != 0)
    throw FileError(where, "is a text of a file with unusual addresses");
}

/// A text of variable length stands in a heap of the file. HDF5 1.10 copies as many bytes as the
/// heap says to where there is room for as many as the dataset says, so the bytes are taken without
/// it (HDF5's file format, III.E, global heap).
std::string variable_text(hid_t file, hid_t dataset, FileBytes& bytes, const std::string& where) {
  check_plain_addresses(file, where);
  const haddr_t offset = H5Dget_offset(dataset);
  if (offset == HADDR_UNDEF) throw FileError(where, "is a text that is stored in pieces");
  const std::string cell = bytes.part(offset, 16, where);
  const std::uint64_t length = little_endian(std::string_view(cell).substr(0, 4));
  const std::uint64_t index = little_endian(std::string_view(cell).substr(12, 4));
  if (length == 0) return "";
  if (length > kMostTextBytes) throw FileError(where, "is too long");
  const std::string_view heap =
      bytes.heap(little_endian(std::string_view(cell).substr(4, 8)), where);
  constexpr std::size_t kObjectHeadBytes = 16;
  for (std::size_t at = FileBytes::kHeapHeadBytes; at + kObjectHeadBytes <= heap.size();) {
    const std::uint64_t number = little_endian(heap.substr(at, 2));
    const std::uint64_t size = little_endian(heap.substr(at + 8, 8));
    at += kObjectHeadBytes;
    if (number == 0 || size > heap.size() - at) break;  // 0: what is left is free
    if (number == index && size >= length) {
      const std::string_view text = heap.substr(at, static_cast<std::size_t>(length));
      return std::string(text.substr(0, text.find('\0')));
    }
    at += static_cast<std::size_t>((size + 7) / 8 * 8);
  }
  throw FileError(where, "damaged HDF5: its text is not in its heap");
}

}  // namespace

struct Hdf5Input::State {
  State(hdf5::Handle opened, FileBytes read_bytes)
      : file(std::move(opened)), bytes(std::move(read_bytes)) {}
  hdf5::Handle file;
  FileBytes bytes;

  enum class Link { Absent, Elsewhere, Hard };
  /// The last link of a path, or the first one that is not hard, and the path up to it: only hard
  /// links are followed.
  [[nodiscard]] std::pair<Link, std::string> link_at(const std::string& path) const {
    for (std::size_t at = path.find('/', 1);; at = path.find('/', at + 1)) {
      const std::string part = path.substr(0, at);
      if (H5Lexists(file, part.c_str(), H5P_DEFAULT) <= 0) return {Link::Absent, part};
      H5L_info_t link;
      hdf5::checked(H5Lget_info(file, part.c_str(), &link, H5P_DEFAULT), "H5Lget_info");
      if (link.type != H5L_TYPE_HARD) return {Link::Elsewhere, part};
      if (at == std::string::npos) return {Link::Hard, part};
    }
  }

  [[nodiscard]] hdf5::Handle dataset(const std::string& path, const std::string& name) const {
    const auto [link, part] = link_at(path);
    if (link == Link::Absent) throw FileError(name, "has no " + part);
    if (link == Link::Elsewhere) throw FileError(name, part, "a part of this file", "a link");
    return {H5Dopen2(file, path.c_str(), H5P_DEFAULT), H5Dclose, "H5Dopen2"};
  }
};

namespace {

/// Runs `use` without HDF5's own messages; failed calls become an error of the file.
template <typename Use>
auto quietly(const std::string& name, Use&& use) {
  const hdf5::QuietErrors quiet;
  try {
    return use();
  } catch (const hdf5::CallFailed& failure) {
    throw FileError(name, std::string("damaged HDF5: ") + failure.what());
  }
}

}  // namespace

void rehearse_reading(const std::string& name, const std::function<void()>& read) {
  const ContainedWork rehearsal = contained_work(0, [&](std::span<char>) {
    try {
      read();
    } catch (const std::exception&) {
      // Its like is thrown again when the file is read in earnest.
    }
    return true;
  });
  if (!rehearsal.is_done)
    throw FileError(name, "damaged HDF5: a trial of reading it " + rehearsal.trouble);
}

bool is_hdf5_head(std::string_view bytes) {
  return bytes.starts_with("\x89HDF\r\n\x1a\n");
}

Hdf5Input::Hdf5Input(std::unique_ptr<State> state, std::string name)
    : state_(std::move(state)), name_(std::move(name)) {}
Hdf5Input::Hdf5Input(Hdf5Input&&) noexcept = default;
Hdf5Input& Hdf5Input::operator=(Hdf5Input&&) noexcept = default;
Hdf5Input::~Hdf5Input() = default;

Hdf5Input Hdf5Input::of_file(const std::filesystem::path& path) {
  return quietly(path.string(), [&] {
    return Hdf5Input(std::make_unique<State>(opened_file(path.string()), FileBytes(path)),
                     path.string());
  });
}

Hdf5Input Hdf5Input::of_bytes(std::string bytes, std::string name) {
  return quietly(name, [&] {
    hdf5::Handle file = opened_bytes(bytes);
    return Hdf5Input(std::make_unique<State>(std::move(file), FileBytes(std::move(bytes))), name);
  });
}

bool Hdf5Input::holds(const std::string& path) const {
  const hdf5::QuietErrors quiet;
  try {
    const auto [link, part] = state_->link_at(path);
    return link != State::Link::Absent && part.size() == path.size();
  } catch (const hdf5::CallFailed&) {
    return false;
  }
}

std::vector<std::string> Hdf5Input::names_in(const std::string& group) const {
  std::vector<std::string> names;
  const auto add = [](hid_t, const char* name, const H5L_info_t*, void* list) -> herr_t {
    constexpr std::size_t kMost = 1000;
    auto& found = *static_cast<std::vector<std::string>*>(list);
    found.emplace_back(name);
    return found.size() < kMost ? 0 : 1;
  };
  quietly(name_, [&] {
    return hdf5::checked(H5Literate_by_name(state_->file,
                                            group.c_str(),
                                            H5_INDEX_NAME,
                                            H5_ITER_INC,
                                            nullptr,
                                            add,
                                            &names,
                                            H5P_DEFAULT),
                         "H5Literate_by_name");
  });
  return names;
}

Hdf5Numbers Hdf5Input::numbers(const std::string& path, std::size_t most) const {
  return quietly(name_, [&] {
    const std::string where = name_ + ": " + path;
    const hdf5::Handle dataset = state_->dataset(path, name_);
    check_storage(dataset, where);
    const hdf5::Handle type(H5Dget_type(dataset), H5Tclose, "H5Dget_type");
    const H5T_class_t kind = H5Tget_class(type);
    Hdf5Numbers numbers;
    numbers.extents = extents_of(dataset, where);
    std::size_t count = 1;
    for (const std::size_t extent : numbers.extents)
      count = extent > most ? most + 1 : count * extent;
    if ((kind != H5T_FLOAT && kind != H5T_INTEGER) || count > most)
      throw FileError(where, "is no list of at most " + std::to_string(most) + " numbers");
    // HDF5 makes room for a number as large as the file says, up to 4 GB.
    if (H5Tget_size(type) > sizeof(long double))
      throw FileError(where, "has numbers of more than 16 bytes each");
    numbers.values = values_of(dataset, count, where);
    return numbers;
  });
}

std::string Hdf5Input::text(const std::string& path) const {
  return quietly(name_, [&] {
    const std::string where = name_ + ": " + path;
    const hdf5::Handle dataset = state_->dataset(path, name_);
    check_storage(dataset, where);
    const hdf5::Handle type(H5Dget_type(dataset), H5Tclose, "H5Dget_type");
    std::size_t count = 1;
    for (const std::size_t extent : extents_of(dataset, where)) count *= extent;
    if (H5Tget_class(type) != H5T_STRING || count != 1) throw FileError(where, "is no text");
    if (hdf5::checked(H5Tis_variable_str(type), "H5Tis_variable_str") > 0)
      return variable_text(state_->file, dataset, state_->bytes, where);
    // The file's word, up to 4 GB: asked before memory is.
    const std::size_t bytes = H5Tget_size(type);
    if (bytes > kMostTextBytes) throw FileError(where, "is too long");
    std::string text(bytes, '\0');
    hdf5::checked(H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, text.data()), "H5Dread");
    return text.substr(0, text.find('\0'));
  });
}

}  // namespace af
