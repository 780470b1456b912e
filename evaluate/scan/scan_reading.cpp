// SPDX-License-Identifier: Apache-2.0
#include "evaluate/scan/scan_reading.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/number_text.h"
#include "evaluate/scan/image_sampling.h"
#include "evaluate/scan/line_integrals.h"
#include "files/csv_table.h"
#include "xray/image_file.h"

namespace af::tools {

namespace {

namespace fs = std::filesystem;

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
  if (!file.listed_files.empty()) return;
  const fs::path next = folder / file.file_of(count);
  if (fs::exists(next))
    throw InputError("views",
                     std::to_string(count),
                     "must be all that there are, but " + next.string() +
                         " exists, too (to leave views out, name the others in files_file)");
}

std::vector<Image2d> read_views(const ScanFile& file, const fs::path& folder, int bin) {
  if (file.is_stack()) return read_stack(file, folder / file.files, bin);
  refuse_other_count(file, folder);
  std::vector<Image2d> views;
  for (std::size_t view = 0; view < file.scan.angles_rad.size(); ++view)
    views.push_back(read_sized(folder / file.file_of(static_cast<int>(view)), file.scan, bin));
  return views;
}

/// Subtracts the dark level from counts.
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
  // Only even views count, because a calibration is judged by the odd ones.
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

double share_of(const std::vector<unsigned char>& flags) {
  const auto set = std::count_if(flags.begin(), flags.end(), [](auto flag) { return flag != 0; });
  return static_cast<double>(set) / static_cast<double>(std::max<std::size_t>(1, flags.size()));
}

/// Reports what the open beam was taken to be, and whether each view was exposed like the others.
/// One that was not tells nothing about the object.
void report_beam(const ScanFile& file,
                 const AirLevel& level,
                 const std::vector<Image2d>& counts,
                 const ReportLine& report) {
  std::vector<double> beams;
  for (const Image2d& image : counts) beams.push_back(beam_of(image, level));
  std::vector<double> sorted = beams;
  std::sort(sorted.begin(), sorted.end());
  const double middle = sorted[sorted.size() / 2];
  const double air_share = share_of(level.is_air);
  const bool has_flat = file.flat || file.flat_level;
  constexpr double kSameExposure = 0.1;
  if (air_share == 0.0) {
    report(
        "Open beam: no pixel is seen to see past the object in all views; the flat's exposure "
        "is taken");
    if (std::abs(level.brightest_share - 1.0) > kSameExposure)
      report("Warning: the brightest pixels have " + fixed_text(level.brightest_share, 2) +
             " of the flat. If they see air, the flat is of another exposure, and all line "
             "integrals are off: scale it, or state flat_level");
    return;
  }
  report("Open beam: " +
         (has_flat ? fixed_text(middle, 3) + " times the flat (median of the views), by "
                   : std::string("fitted to ")) +
         fixed_text(100.0 * air_share, 1) + " % of the pixels, which see air in all views");
  if (has_flat && std::abs(middle - 1.0) > kSameExposure)
    report("Warning: the flat is of another exposure than the views");
  constexpr double kLeastShare = 0.2;
  for (std::size_t view = 0; view < beams.size(); ++view)
    if (beams[view] < kLeastShare * middle || beams[view] * kLeastShare > middle)
      throw InputError("view " + std::to_string(view),
                       fixed_text(beams[view] / middle, 3) + " times the others' open beam",
                       "must be exposed like the others; to leave views out, name the others in "
                       "files_file and their angles in angles_file",
                       file.file_of(static_cast<int>(view)));
}

void report_starved(const AirLevel& level,
                    const std::vector<Image2d>& counts,
                    double least_count,
                    const ReportLine& report) {
  std::size_t starved = 0;
  std::size_t lit = 0;
  for (const Image2d& image : counts)
    for (std::size_t i = 0; i < level.is_lit.size(); ++i) {
      if (level.is_lit[i] == 0) continue;
      ++lit;
      if (static_cast<double>(image.pixels[i]) < least_count) ++starved;
    }
  const double share = static_cast<double>(starved) / static_cast<double>(lit);
  constexpr double kMany = 1e-3;
  if (share > kMany)
    report("Warning: " + fixed_text(100.0 * share, 2) +
           " % of the pixels count nothing above the dark level: dark_level is too high, or the "
           "object lets nothing through");
}

/// Turns stored numbers into line integrals.
void scale_attenuation(const ScanFile& file, std::vector<Image2d>& images) {
  // No detector counts exp(-30) of a beam, but a few pixels may be broken.
  constexpr float kLargest = 30.0F;
  constexpr double kFew = 1e-3;
  float largest = 0.0F;
  std::size_t beyond = 0;
  std::size_t all = 0;
  for (Image2d& image : images)
    for (float& value : image.pixels) {
      value *= static_cast<float>(file.attenuation_scale);
      largest = std::max(largest, value);
      if (value > kLargest) ++beyond;
      ++all;
    }
  if (static_cast<double>(beyond) > kFew * static_cast<double>(all))
    throw InputError("xray_domain",
                     "\"attenuation\" with numbers up to " + number_text(largest),
                     "must hold line integrals -ln(I / I0), at most 30; where they are stored "
                     "multiplied, state attenuation_scale, e.g. 1e-4");
}

}  // namespace

ScanImages read_scan_images(const ScanFile& file,
                            const fs::path& folder,
                            int most_px,
                            ThreadPool& pool,
                            const ReportLine& report) {
  const int bin = std::max(1, (file.scan.size_px.maxCoeff() + most_px - 1) / most_px);
  ScanImages images;
  images.scan = file.scan.binned(bin);
  images.line_integrals = read_views(file, folder, bin);
  const auto count = static_cast<int>(images.line_integrals.size());
  if (file.xray_domain == XrayDomain::Attenuation) {
    images.is_lit.assign(images.line_integrals.front().pixels.size(), 1);
    scale_attenuation(file, images.line_integrals);
    return images;
  }
  const DarkLevel dark(file, folder, bin);
  for (Image2d& image : images.line_integrals) dark.subtract_from(image);
  const AirLevel level = air_level(file, folder, images.line_integrals, dark, bin);
  images.is_lit = level.is_lit;
  const double least_count = least_count_of(level);
  report_beam(file, level, images.line_integrals, report);
  report_starved(level, images.line_integrals, least_count, report);
  pool.for_each(count, [&](int view, int /*slot*/) {
    Image2d& image = images.line_integrals[static_cast<std::size_t>(view)];
    image = line_integrals_of(image, level, file.scan.axis_along, least_count);
  });
  return images;
}

}  // namespace af::tools
