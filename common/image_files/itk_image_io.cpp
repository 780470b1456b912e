// SPDX-License-Identifier: Apache-2.0
#include "image_files/itk_image_io.h"

#include <array>
#include <clocale>
#include <cstdint>
#include <fstream>
#include <string_view>
#include <utility>

#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>
#include <itkOutputWindow.h>
#include <itkPNGImageIO.h>
#include <itkTIFFImageIO.h>

#include "base/error.h"
#include "files/captured_output.h"
#include "files/output_file.h"

namespace af {

namespace fs = std::filesystem;

namespace {

using Component = itk::IOComponentEnum;

constexpr std::array<std::pair<ValueType, Component>, 10> kComponents = {
    {{ValueType::Int8, Component::CHAR},
     {ValueType::UInt8, Component::UCHAR},
     {ValueType::Int16, Component::SHORT},
     {ValueType::UInt16, Component::USHORT},
     {ValueType::Int32, Component::INT},
     {ValueType::UInt32, Component::UINT},
     {ValueType::Int64, Component::LONGLONG},
     {ValueType::UInt64, Component::ULONGLONG},
     {ValueType::Float32, Component::FLOAT},
     {ValueType::Float64, Component::DOUBLE}}};

/// Decimal points in this thread, whatever locale the host program has set: NrrdIO prints and reads
/// numbers as C does.
class PointLocale {
 public:
  PointLocale() : point_(newlocale(LC_ALL_MASK, "C", nullptr)), before_(uselocale(point_)) {}
  ~PointLocale() {
    uselocale(before_);
    freelocale(point_);
  }
  PointLocale(const PointLocale&) = delete;
  PointLocale& operator=(const PointLocale&) = delete;

 private:
  locale_t point_;
  locale_t before_;
};

/// ITK's messages are the program's business, not the terminal's: what matters comes as exceptions.
class SilentWindow : public itk::OutputWindow {
 public:
  using Self = SilentWindow;
  using Pointer = itk::SmartPointer<Self>;
  itkNewMacro(Self) void DisplayText(const char*) override {}
};

void silence_itk() {
  static const bool done = [] {
    itk::OutputWindow::SetInstance(SilentWindow::New());
    return true;
  }();
  (void)done;
}

/// The reader or writer itself, not one found through ITK's global factories: content, not names or
/// plug-ins, decides who parses a file.
itk::ImageIOBase::Pointer make_image_io(ImageFormat format) {
  silence_itk();
  switch (format) {
    case ImageFormat::MetaImage: {
      const auto io = itk::MetaImageIO::New();
      io->SetDoublePrecision(17);
      return io.GetPointer();
    }
    case ImageFormat::Nifti:
      return itk::NiftiImageIO::New().GetPointer();
    case ImageFormat::Nrrd:
      return itk::NrrdImageIO::New().GetPointer();
    case ImageFormat::Png:
      return itk::PNGImageIO::New().GetPointer();
    case ImageFormat::Tiff:
      return itk::TIFFImageIO::New().GetPointer();
    case ImageFormat::Dicom:
      break;
  }
  throw std::logic_error("DICOM is read by dicom_pixels");
}

ValueType value_type_of(const itk::ImageIOBase& io, const fs::path& path) {
  Component component = io.GetComponentType();
  // `long` is 8 bytes on every platform this is built for.
  if (component == Component::LONG) component = Component::LONGLONG;
  if (component == Component::ULONG) component = Component::ULONGLONG;
  for (const auto& [type, known] : kComponents)
    if (known == component) return type;
  throw FileError(path.string(),
                  "voxel type",
                  "a real number type",
                  itk::ImageIOBase::GetComponentTypeAsString(component));
}

Component component_of(ValueType type) {
  for (const auto& [known, component] : kComponents)
    if (known == type) return component;
  return Component::UNKNOWNCOMPONENTTYPE;
}

RawImage header_of(const itk::ImageIOBase& io, const fs::path& path) {
  RawImage image;
  for (unsigned axis = 0; axis < io.GetNumberOfDimensions(); ++axis) {
    image.size.push_back(io.GetDimensions(axis));
    image.spacing_mm.push_back(io.GetSpacing(axis));
    image.origin_mm.push_back(io.GetOrigin(axis));
    image.directions.push_back(io.GetDirection(axis));
  }
  image.channels = static_cast<int>(io.GetNumberOfComponents());
  image.type = value_type_of(io, path);
  return image;
}

/// First lines of an ITK exception, without its source location.
std::string description(const itk::ExceptionObject& error) {
  std::string text = error.GetDescription();
  for (char& c : text)
    if (c == '\n' || c == '\t') c = ' ';
  constexpr std::size_t kMaxLength = 300;
  if (text.size() > kMaxLength) text.resize(kMaxLength);
  return text;
}

/// What `read` returns; FileError for what ITK throws.
template <typename Read>
RawImage with_itk_errors(const fs::path& path, ImageFormat format, const Read& read) {
  try {
    return read();
  } catch (const itk::ExceptionObject& error) {
    throw FileError(path.string(),
                    std::string("not a readable ") + std::string(format_name(format)) +
                        " image: " + description(error));
  }
}

struct WritableFormat {
  std::string_view extension;
  ImageFormat format;
};
constexpr std::array<WritableFormat, 7> kWritable = {{{".nii.gz", ImageFormat::Nifti},
                                                      {".nii", ImageFormat::Nifti},
                                                      {".mha", ImageFormat::MetaImage},
                                                      {".nrrd", ImageFormat::Nrrd},
                                                      {".tif", ImageFormat::Tiff},
                                                      {".tiff", ImageFormat::Tiff},
                                                      {".png", ImageFormat::Png}}};

WritableFormat writable_format(const fs::path& path) {
  const std::string name = path.filename().string();
  for (const WritableFormat& known : kWritable)
    if (name.size() > known.extension.size() && name.ends_with(known.extension)) return known;
  throw UsageError(path.string() +
                   ": unknown image extension; known: .mha .nii.gz .nii .nrrd .tif .tiff .png");
}

/// Whether a .nii.gz ends as it must: with its unpacked size, which is not read on the way.
bool has_gzip_end(const RawImage& image, const fs::path& file) {
  constexpr std::size_t kHeaderBytes = 352;
  const auto expected = static_cast<std::uint32_t>(kHeaderBytes + image.values.size());
  std::array<unsigned char, 4> end{};
  std::ifstream stream(file, std::ios::binary);
  stream.seekg(-static_cast<std::streamoff>(end.size()), std::ios::end);
  stream.read(reinterpret_cast<char*>(end.data()), end.size());
  std::uint32_t found = 0;
  for (std::size_t i = 0; i < end.size(); ++i) found |= std::uint32_t{end[i]} << (8u * i);
  return stream.good() && found == expected;
}

/// ITK does not notice a full disk: it leaves a shorter file and says nothing.
void check_is_whole(const RawImage& image, const fs::path& file, ImageFormat format) {
  bool is_whole = false;
  try {
    const RawImage found = read_raw_image(file, format, [&](const RawImage& header) {
      is_whole = header.voxel_count() == image.voxel_count();
    });
    is_whole = is_whole && found.type == image.type && found.values == image.values &&
               (file.extension() != ".gz" || has_gzip_end(image, file));
  } catch (const FileError&) {
    is_whole = false;
  }
  if (is_whole) return;
  std::error_code error;
  const fs::space_info space =
      fs::space(file.parent_path().empty() ? "." : file.parent_path(), error);
  throw FileError(file.string(),
                  "cannot be written whole: other voxels are read back" +
                      (error ? std::string()
                             : " (" + std::to_string(space.available) +
                                   " bytes are left on its disk; ulimit -f may set a limit, too)"));
}

void write_by_itk(const RawImage& image, const fs::path& file, ImageFormat format) {
  const PointLocale locale;
  const itk::ImageIOBase::Pointer io = make_image_io(format);
  io->SetFileName(file.string());
  const auto dimensions = static_cast<unsigned>(image.size.size());
  io->SetNumberOfDimensions(dimensions);
  itk::ImageIORegion region(dimensions);
  for (unsigned axis = 0; axis < dimensions; ++axis) {
    io->SetDimensions(axis, image.size[axis]);
    io->SetSpacing(axis, image.spacing_mm[axis]);
    io->SetOrigin(axis, image.origin_mm[axis]);
    io->SetDirection(axis, image.directions[axis]);
    region.SetSize(axis, image.size[axis]);
  }
  io->SetIORegion(region);
  io->SetNumberOfComponents(static_cast<unsigned>(image.channels));
  io->SetPixelType(itk::IOPixelEnum::SCALAR);
  io->SetComponentType(component_of(image.type));
  io->SetUseCompression(format == ImageFormat::Png);
  try {
    io->Write(image.values.data());
  } catch (const itk::ExceptionObject& error) {
    throw FileError(file.string(), "cannot be written: " + description(error));
  }
}

}  // namespace

std::size_t RawImage::voxel_count() const {
  std::size_t count = 1;
  for (const std::size_t extent : size) count *= extent;
  return count;
}

std::size_t value_bytes(ValueType type) {
  switch (type) {
    case ValueType::Int8:
    case ValueType::UInt8:
      return 1;
    case ValueType::Int16:
    case ValueType::UInt16:
      return 2;
    case ValueType::Int32:
    case ValueType::UInt32:
    case ValueType::Float32:
      return 4;
    default:
      return 8;
  }
}

RawImage read_raw_image(const fs::path& path, ImageFormat format, const AcceptImage& accept) {
  const PointLocale locale;
  return with_itk_errors(path, format, [&] {
    const itk::ImageIOBase::Pointer io = make_image_io(format);
    io->SetFileName(path.string());
    io->ReadImageInformation();
    RawImage image = header_of(*io, path);
    accept(image);
    itk::ImageIORegion region(io->GetNumberOfDimensions());
    for (unsigned axis = 0; axis < io->GetNumberOfDimensions(); ++axis)
      region.SetSize(axis, image.size[axis]);
    io->SetIORegion(region);
    image.values.resize(image.voxel_count() * static_cast<std::size_t>(image.channels) *
                        value_bytes(image.type));
    if (static_cast<std::size_t>(io->GetImageSizeInBytes()) != image.values.size())
      throw FileError(path.string(),
                      "voxel bytes",
                      std::to_string(image.values.size()),
                      std::to_string(io->GetImageSizeInBytes()));
    io->Read(image.values.data());
    return image;
  });
}

void write_raw_image(const RawImage& image, const fs::path& path) {
  const WritableFormat target = writable_format(path);
  if (target.format == ImageFormat::Png) {
    // ITK crashes when a PNG file cannot be written.
    write_text_file(path, captured_output(path.string(), [&](int descriptor) {
                      write_by_itk(
                          image, "/proc/self/fd/" + std::to_string(descriptor), target.format);
                    }));
    return;
  }
  write_atomically(path, [&](const fs::path& partial) {
    write_by_itk(image, partial, target.format);
    check_is_whole(image, partial, target.format);
  });
}

}  // namespace af
