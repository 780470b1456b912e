// SPDX-License-Identifier: Apache-2.0
#include "images/itk_image_io.h"

#include <clocale>

#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>
#include <itkOutputWindow.h>
#include <itkPNGImageIO.h>
#include <itkTIFFImageIO.h>

#include "base/error.h"

namespace af {

namespace fs = std::filesystem;

namespace {

/// Sets decimal points in this thread, whatever locale the host program has set, because NrrdIO
/// prints numbers as C does.
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

/// Keeps ITK's messages off the terminal. What matters comes as exceptions.
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

/// The writer itself, rather than one found through ITK's global factories.
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
  throw std::logic_error("DICOM is written by dicom_xray_writer");
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

}  // namespace

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
  io->SetComponentType(visit_values(image, [](const auto values) {
    return itk::ImageIOBase::MapPixelType<typename decltype(values)::value_type>::CType;
  }));
  io->SetUseCompression(format == ImageFormat::Png);
  try {
    io->Write(image.values.data());
  } catch (const itk::ExceptionObject& error) {
    throw FileError(file.string(), "cannot be written: " + description(error));
  }
}

}  // namespace af
