// SPDX-License-Identifier: Apache-2.0
#include "tools/scan/scan_reading.h"

#include <algorithm>

#include "base/error.h"
#include "image_files/image_file.h"
#include "scan/image_sampling.h"
#include "scan/line_integrals.h"

namespace af::tools {

namespace {

namespace fs = std::filesystem;

/// Half a count: what a pixel without any stands for under the logarithm.
constexpr double kLeastCount = 0.5;

Image2d sized(const Image2d& image, const fs::path& path, const CircularScan& scan, int bin) {
  if (image.width != scan.size_px.x() || image.height != scan.size_px.y())
    throw InputError("size",
                     std::to_string(image.width) + " x " + std::to_string(image.height) + " px",
                     "must be size_px of the scan: " + std::to_string(scan.size_px.x()) + " x " +
                         std::to_string(scan.size_px.y()),
                     path.string());
  return binned_image(image, bin);
}

Image2d read_sized(const fs::path& path, const CircularScan& scan, int bin) {
  return sized(read_image(path), path, scan, bin);
}

std::vector<Image2d> read_stack(const ScanFile& file, const fs::path& path, int bin) {
  std::vector<Image2d> views;
  for_each_image_of_stack(path, [&](int /*number*/, Image2d&& image) {
    views.push_back(sized(image, path, file.scan, bin));
  });
  if (views.size() != file.scan.angles_rad.size())
    throw InputError("views",
                     std::to_string(file.scan.angles_rad.size()),
                     "must be as many as the stack's " + std::to_string(views.size()) + " images",
                     path.string());
  return views;
}

void refuse_other_count(const ScanFile& file, const fs::path& folder) {
  const int count = static_cast<int>(file.scan.angles_rad.size());
  const fs::path last = folder / file.file_of(count - 1);
  if (!fs::exists(last))
    throw FileError(
        last.string(),
        "no such file, but view_count = " + std::to_string(count) + " wants one for every view");
  const fs::path next = folder / file.file_of(count);
  if (fs::exists(next))
    throw InputError("view_count",
                     std::to_string(count),
                     "must count all views, but " + next.string() + " exists, too");
}

std::vector<Image2d> read_views(const ScanFile& file, const fs::path& folder, int bin) {
  if (file.is_stack()) return read_stack(file, folder / file.files, bin);
  refuse_other_count(file, folder);
  std::vector<Image2d> views;
  for (std::size_t view = 0; view < file.scan.angles_rad.size(); ++view)
    views.push_back(read_sized(folder / file.file_of(static_cast<int>(view)), file.scan, bin));
  return views;
}

/// Counts above the dark level.
class DarkLevel {
 public:
  DarkLevel(const ScanFile& file, const fs::path& folder, int bin) : level_(file.dark_level) {
    if (file.dark) image_ = read_sized(folder / *file.dark, file.scan, bin);
  }
  void subtract_from(Image2d& image) const {
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
      image.pixels[i] -= image_.pixels.empty() ? static_cast<float>(level_) : image_.pixels[i];
  }

 private:
  double level_;
  Image2d image_;
};

AirLevel air_level(const ScanFile& file,
                   const fs::path& folder,
                   const std::vector<Image2d>& counts,
                   const DarkLevel& dark,
                   int bin) {
  // Even views alone: the odd ones are what a calibration is judged by.
  constexpr int kMostViews = 60;
  const int count = static_cast<int>(counts.size());
  const int stride = 2 * std::max(1, count / (2 * kMostViews));
  std::vector<const Image2d*> sample;
  for (int view = 0; view < count; view += stride)
    sample.push_back(&counts[static_cast<std::size_t>(view)]);
  const PixelStatistics statistics = pixel_statistics(sample);
  if (!file.flat && !file.flat_level && is_displaced(view_at_axis(file.scan)))
    throw InputError("flat",
                     "none, and beam_foot_px is far from the detector's middle",
                     "must be given, or flat_level, the counts of the open beam: a detector that "
                     "stands to one side does not see past the object on the other");
  if (!file.flat && !file.flat_level) return estimated_air_level(statistics, file.scan.axis_along);
  Image2d flat(statistics.mean.width, statistics.mean.height);
  if (file.flat)
    flat = read_sized(folder / *file.flat, file.scan, bin);
  else
    std::fill(flat.pixels.begin(), flat.pixels.end(), static_cast<float>(*file.flat_level));
  dark.subtract_from(flat);
  return air_level_of_flat(flat, statistics);
}

}  // namespace

ScanImages read_scan_images(const ScanFile& file,
                            const fs::path& folder,
                            int most_px,
                            ThreadPool& pool) {
  const int bin = std::max(1, (file.scan.size_px.maxCoeff() + most_px - 1) / most_px);
  ScanImages images;
  images.scan = file.scan.binned(bin);
  images.line_integrals = read_views(file, folder, bin);
  const auto count = static_cast<int>(images.line_integrals.size());
  if (file.xray_domain == XrayDomain::Attenuation) {
    images.is_lit.assign(images.line_integrals.front().pixels.size(), 1);
    return images;
  }
  const DarkLevel dark(file, folder, bin);
  for (Image2d& image : images.line_integrals) dark.subtract_from(image);
  const AirLevel level = air_level(file, folder, images.line_integrals, dark, bin);
  images.is_lit = level.is_lit;
  pool.for_each(count, [&](int view, int /*slot*/) {
    Image2d& image = images.line_integrals[static_cast<std::size_t>(view)];
    image = line_integrals_of(image, level, file.scan.axis_along, kLeastCount);
  });
  return images;
}

}  // namespace af::tools
