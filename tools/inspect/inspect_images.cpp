// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include <Eigen/LU>

#include "ct/ct_reader.h"
#include "files/sha256.h"
#include "images/image_header.h"
#include "images/stored_image.h"
#include "ranks/input_identity.h"
#include "study/target_place.h"
#include "tools/inspect/inspect_kinds.h"
#include "xray/dicom_xray.h"
#include "xray/image_file.h"

namespace af {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

namespace {

constexpr int kAirBelowHu = -900;
constexpr int kNoAirFromHu = -200;
constexpr int kTissueFromHu = -300;
constexpr int kBoneFromHu = 300;
/// Slices this much thicker than pixels are wide make lateral DRRs coarse.
constexpr double kAnisotropyLimit = 3.0;
constexpr std::size_t kMaxPixels = std::size_t{1} << 28;
/// Tissue on more than this share of a side face means that the body continues outside the image.
constexpr double kCutBodyShare = 0.05;

struct HuStatistics {
  std::vector<std::uint64_t> counts = std::vector<std::uint64_t>(65536);
  std::uint64_t total = 0;

  explicit HuStatistics(std::span<const std::int16_t> hu) : total(hu.size()) {
    for (const std::int16_t value : hu) ++counts[bin(value)];
  }
  static std::size_t bin(int hu) { return static_cast<std::size_t>(std::ptrdiff_t{hu} + 32768); }
  /// Smallest value that at least `share` of the voxels do not exceed.
  [[nodiscard]] int quantile(double share) const {
    const auto rank =
        static_cast<std::uint64_t>(std::max(1.0, std::ceil(share * static_cast<double>(total))));
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i < counts.size(); ++i) {
      seen += counts[i];
      if (seen >= rank) return static_cast<int>(i) - 32768;
    }
    return 32767;
  }
  /// Share of voxels in [low, high).
  [[nodiscard]] double share(int low, int high) const {
    std::uint64_t inside = 0;
    for (int value = low; value < high; ++value) inside += counts[bin(value)];
    return static_cast<double>(inside) / static_cast<double>(total);
  }
};

/// Where an axis points in the patient: "L" and the like, with two letters when oblique.
std::string patient_letters(const Eigen::Vector3d& direction) {
  constexpr std::array<std::array<char, 2>, 3> kLetters = {{{'L', 'R'}, {'P', 'A'}, {'S', 'I'}}};
  constexpr double kVisibleShare = 0.05;  // about 3 degrees
  std::array<Eigen::Index, 3> order = {0, 1, 2};
  std::sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) {
    return std::abs(direction[a]) > std::abs(direction[b]);
  });
  std::string letters;
  for (const Eigen::Index axis : order)
    if (std::abs(direction[axis]) > kVisibleShare)
      letters += kLetters[static_cast<std::size_t>(axis)][direction[axis] > 0.0 ? 0 : 1];
  return letters;
}

ordered_json grid_json(const CtGrid& grid) {
  const auto [low, high] = bounding_box(grid);
  ordered_json json = to_json(grid);
  json["axes_point_to"] = {patient_letters(grid.direction.col(0)),
                           patient_letters(grid.direction.col(1)),
                           patient_letters(grid.direction.col(2))};
  json["center_mm"] = vector_json(grid.center_mm());
  json["right_to_left_mm"] = {low.x(), high.x()};
  json["anterior_to_posterior_mm"] = {low.y(), high.y()};
  json["inferior_to_superior_mm"] = {low.z(), high.z()};
  return json;
}

/// Share of tissue on a face of the volume, which is the first or last index of an axis.
double tissue_share_on_face(const CtVolume& ct, std::size_t axis, bool at_end) {
  const auto& size = ct.grid.size;
  std::array<int, 3> low = {0, 0, 0};
  std::array<int, 3> high = {size[0], size[1], size[2]};
  (at_end ? low : high)[axis] = at_end ? size[axis] - 1 : 1;
  std::size_t tissue = 0;
  std::size_t total = 0;
  for (int k = low[2]; k < high[2]; ++k)
    for (int j = low[1]; j < high[1]; ++j)
      for (int i = low[0]; i < high[0]; ++i, ++total) {
        const std::ptrdiff_t at = i + std::ptrdiff_t{size[0]} * (j + std::ptrdiff_t{size[1]} * k);
        if (ct.hu[static_cast<std::size_t>(at)] >= kTissueFromHu) ++tissue;
      }
  return static_cast<double>(tissue) / static_cast<double>(total);
}

void warn_of_cut_body(const CtVolume& ct, Inspection& inspection) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d direction = ct.grid.direction.col(static_cast<Eigen::Index>(axis));
    // The head and foot ends of every CT are cut.
    if (std::abs(direction.z()) > 0.7) continue;
    for (const bool at_end : {false, true}) {
      const double share = tissue_share_on_face(ct, axis, at_end);
      if (share <= kCutBodyShare) continue;
      const auto percent = static_cast<int>(std::lround(100.0 * share));
      inspection.warnings.push_back(
          "truncated field of view: " + std::to_string(percent) + " % of the " +
          patient_letters(at_end ? direction : Eigen::Vector3d(-direction)) +
          " face is tissue (or table) that continues outside the CT; rays through it miss "
          "attenuation (--body-only makes air of a table)");
    }
  }
}

void warn_of_ct(const CtVolume& ct, const HuStatistics& hu, Inspection& inspection) {
  const Eigen::Vector3d& spacing = ct.grid.spacing_mm;
  if (spacing.maxCoeff() > kAnisotropyLimit * spacing.minCoeff())
    inspection.warnings.push_back("anisotropic: voxels of " + std::to_string(spacing.maxCoeff()) +
                                  " mm by " + std::to_string(spacing.minCoeff()) +
                                  " mm; DRRs across the thick slices are coarse");
  if (ct.grid.direction.determinant() < 0.0)
    inspection.warnings.push_back(
        "left-handed voxel order: read correctly, but check left and right in a DRR");
  // Values without any air are not HU, as read_ct() says, and every face would count as tissue.
  if (hu.quantile(0.0) >= kNoAirFromHu) return;
  if (hu.share(kAirBelowHu, 32768) > 0.999)
    inspection.warnings.push_back("almost no air: cropped to the body?");
  warn_of_cut_body(ct, inspection);
}

/// Smallest value that at least `share` of the values do not exceed. Changes the order of `values`.
double quantile_of(std::vector<float>& values, double share) {
  const auto rank = static_cast<std::size_t>(
      std::max(1.0, std::ceil(share * static_cast<double>(values.size()))));
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(rank - 1);
  std::nth_element(values.begin(), at, values.end());
  return static_cast<double>(*at);
}

void add_value_facts(std::vector<float> values, Inspection& inspection) {
  const auto not_finite = static_cast<std::size_t>(std::count_if(
      values.begin(), values.end(), [](float value) { return !std::isfinite(value); }));
  if (not_finite > 0)
    throw InputError(std::to_string(not_finite) + " of " + std::to_string(values.size()) +
                     " pixels are NaN or infinite");
  const bool integers = std::all_of(
      values.begin(), values.end(), [](float value) { return value == std::nearbyint(value); });
  ordered_json& json = inspection.facts["values"];
  json["min"] = quantile_of(values, 0.0);
  json["median"] = quantile_of(values, 0.5);
  json["percentile_99.9"] = quantile_of(values, 0.999);
  json["max"] = quantile_of(values, 1.0);
  json["integers_only"] = integers;
  if (json["min"] == json["max"]) inspection.warnings.emplace_back("constant image: shows nothing");
}

/// A stack of DRRs holds line integrals: floats of 0 to a few tens. A CT in HU never does.
bool holds_line_integrals(const RawImage& image) {
  if (image.type != ValueType::Float32) return false;
  return visit_values(image, [](const auto values) {
    return std::all_of(
        values.begin(), values.end(), [](const auto v) { return v >= 0 && v < 100; });
  });
}

void inspect_stack(const RawImage& image, Inspection& inspection) {
  inspection.kind = "image stack";
  inspection.facts["columns_rows_images"] = image.size;
  inspection.facts["pixel_spacing_mm"] = {image.spacing_mm[0], image.spacing_mm[1]};
  std::vector<float> values;
  values.reserve(image.voxel_count());
  visit_values(image, [&](const auto all) {
    for (const auto value : all) values.push_back(static_cast<float>(value));
  });
  add_value_facts(std::move(values), inspection);
}

void inspect_picture(const Image2d& image, Inspection& inspection) {
  inspection.kind = "X-ray or DRR image";
  inspection.facts["columns_rows"] = {image.width, image.height};
  add_value_facts(image.pixels, inspection);
}

/// The values described are those that are not padding.
void inspect_dicom(const fs::path& path, Inspection& inspection) {
  DicomXray xray = read_dicom_xray(path, std::nullopt);
  if (!xray.padding.empty()) {
    const auto& data = xray.data.pixels;
    const auto padded = std::count(data.begin(), data.end(), 0.0f);
    inspection.facts["padding"] = std::to_string(padded) + " pixels (" + xray.padding + ")";
    for (std::size_t i = 0; i < data.size(); ++i)
      if (data[i] == 0.0f) xray.image.pixels[i] = std::numeric_limits<float>::quiet_NaN();
    std::erase_if(xray.image.pixels, [](float value) { return std::isnan(value); });
  }
  inspect_picture(xray.image, inspection);
}

}  // namespace

void inspect_ct(const fs::path& path, const CtReadOptions& options, Inspection& inspection) {
  inspection.kind = "CT";
  const CtVolume ct = read_ct(path, options, &inspection.warnings);
  const HuStatistics hu(ct.hu.view());
  inspection.facts["geometry"] = grid_json(ct.grid);
  if (const std::string uid = ct_frame_of_reference(path, options); !uid.empty())
    inspection.facts["frame_of_reference_uid"] = uid;
  ordered_json& values = inspection.facts["values"];
  values["min_hu"] = hu.quantile(0.0);
  values["median_hu"] = hu.quantile(0.5);
  values["percentile_99.9_hu"] = hu.quantile(0.999);
  values["max_hu"] = hu.quantile(1.0);
  values["share_air_below_-900_hu"] = hu.share(-32768, kAirBelowHu);
  values["share_bone_from_300_hu"] = hu.share(kBoneFromHu, 32768);
  inspection.facts["ct_content_sha256"] = identity_of(ct).content_sha256;
  warn_of_ct(ct, hu, inspection);
}

void inspect_image(const fs::path& path, const CtReadOptions& options, Inspection& inspection) {
  const std::optional<ImageFormat> format = sniff_image_format(path);
  check(format.has_value(), "inspect_image() is for image files");
  inspection.facts["format"] = format_name(*format);
  inspection.facts["file_sha256"] = sha256_of_file(path.string());
  if (*format == ImageFormat::Dicom) return inspect_dicom(path, inspection);
  inspection.kind = "image";
  const ImageHeader header = read_image_header(path, *format);
  // Volumes whose values cannot be floats are read only once, as CTs.
  const auto long_axes = std::count_if(header.image.size.begin(),
                                       header.image.size.end(),
                                       [](std::size_t extent) { return extent > 1; });
  if (long_axes > 2 && header.voxel_bytes() != sizeof(float))
    return inspect_ct(path, options, inspection);
  bool is_volume = false;
  const RawImage image = read_stored_image(path, header, nullptr, [&](const RawImage& seen) {
    is_volume = seen.used_axes(2) > 2;
    if (seen.voxel_count() > kMaxPixels * (is_volume ? 16 : 1))
      throw InputError("size", std::to_string(seen.voxel_count()) + " voxels", "is too large");
  });
  if (!is_volume) {
    inspect_picture(read_image(path), inspection);
    if (header.has_spacing && !header.image.size.empty())
      inspection.facts["pixel_spacing_mm"] = {image.spacing_mm[0], image.spacing_mm[1]};
  } else if (image.channels == 1 && image.used_axes(2) == 3 &&
             (*format == ImageFormat::Tiff || holds_line_integrals(image))) {
    inspect_stack(image, inspection);
  } else {
    inspect_ct(path, options, inspection);
  }
}

}  // namespace af
