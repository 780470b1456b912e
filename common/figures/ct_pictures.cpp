// SPDX-License-Identifier: Apache-2.0
#include "figures/ct_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include "figures/patient_directions.h"
#include "files/csv_table.h"
#include "study/target_place.h"
#include "xray/bilinear.h"

namespace af {
namespace {

using Eigen::Vector3d;

constexpr std::int16_t kAirHu = -1000;
/// Room for the coordinates beside an image, px.
constexpr int kLeftPx = 46;
constexpr int kRightPx = 18;
constexpr int kBelowPx = 20;

/// How a picture's axes lie in the patient: one of the ct axes goes right, another up or down. The
/// viewer looks along right x down, so that nothing is mirrored.
struct CtPlane {
  const char* name;
  const char* seen_from;
  int right;  ///< axis, growing to the right
  int down;   ///< axis, growing downwards when `down_sign` is 1
  int down_sign;
  int depth;  ///< the third axis
};

constexpr std::array kPlanes = {CtPlane{"Axial", "the feet", 0, 1, 1, 2},
                                CtPlane{"Coronal", "the front", 0, 2, -1, 1},
                                CtPlane{"Sagittal", "the patient's left", 1, 2, -1, 0}};
constexpr std::array kAxisNames = {'x', 'y', 'z'};

/// Trilinear HU between the voxels; air outside.
double hu_at(const CtVolume& ct, const Vector3d& index) {
  std::array<int, 3> low{};
  std::array<double, 3> share{};
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    const int last = ct.grid.size[a] - 1;
    if (!(index[axis] >= -0.5) || !(index[axis] <= last + 0.5)) return kAirHu;
    const double within = std::clamp(index[axis], 0.0, static_cast<double>(last));
    low[a] = std::min(static_cast<int>(within), std::max(last - 1, 0));
    share[a] = within - low[a];
  }
  const auto value = [&](int i, int j, int k) {
    const std::ptrdiff_t at =
        i + std::ptrdiff_t{ct.grid.size[0]} * (j + std::ptrdiff_t{ct.grid.size[1]} * k);
    return static_cast<double>(ct.hu[static_cast<std::size_t>(at)]);
  };
  const auto between = [](double a, double b, double of_b) { return a + of_b * (b - a); };
  const auto row = [&](int j, int k) {
    return between(value(low[0], j, k), value(low[0] + 1, j, k), share[0]);
  };
  const auto slice = [&](int k) { return between(row(low[1], k), row(low[1] + 1, k), share[1]); };
  return between(slice(low[2]), slice(low[2] + 1), share[2]);
}

/// A part of the CT as pixels: which point of the ct frame a pixel shows, and the reverse.
struct CtSheet {
  const CtPlane& plane;
  CtBox shown;
  double px_per_mm;

  [[nodiscard]] int width() const { return side_px(plane.right); }
  [[nodiscard]] int height() const { return side_px(plane.down); }
  [[nodiscard]] double top_mm() const {
    return (plane.down_sign > 0 ? shown.low_mm : shown.high_mm)[plane.down];
  }
  [[nodiscard]] Vector3d point(int column, int row, double depth_mm) const {
    Vector3d point;
    point[plane.right] = shown.low_mm[plane.right] + (column + 0.5) / px_per_mm;
    point[plane.down] = top_mm() + plane.down_sign * (row + 0.5) / px_per_mm;
    point[plane.depth] = depth_mm;
    return point;
  }
  [[nodiscard]] double column_of(double right_mm) const {
    return (right_mm - shown.low_mm[plane.right]) * px_per_mm - 0.5;
  }
  [[nodiscard]] double row_of(double down_mm) const {
    return plane.down_sign * (down_mm - top_mm()) * px_per_mm - 0.5;
  }
  /// Place in the panel, whose image has room for the coordinates on its left.
  [[nodiscard]] std::array<double, 2> place(const Vector3d& point) const {
    return {kLeftPx + column_of(point[plane.right]), row_of(point[plane.down])};
  }

 private:
  [[nodiscard]] int side_px(int axis) const {
    return std::max(
        1, static_cast<int>(std::lround((shown.high_mm[axis] - shown.low_mm[axis]) * px_per_mm)));
  }
};

/// The largest value of the voxels nearest to points from `first` on, in indices; air outside.
float largest_along(const CtVolume& ct, const Vector3d& first, const Vector3d& step, int count) {
  const std::span<const std::int16_t> hu = ct.hu.view();
  const auto [width, height, depth] = ct.grid.size;
  double i = first.x() + 0.5;
  double j = first.y() + 0.5;
  double k = first.z() + 0.5;
  std::int16_t largest = kAirHu;
  for (int n = 0; n < count; ++n, i += step.x(), j += step.y(), k += step.z()) {
    if (i < 0.0 || j < 0.0 || k < 0.0 || i >= width || j >= height || k >= depth) continue;
    const std::ptrdiff_t at =
        static_cast<int>(i) +
        std::ptrdiff_t{width} *
            (static_cast<int>(j) + std::ptrdiff_t{height} * static_cast<int>(k));
    largest = std::max(largest, hu[static_cast<std::size_t>(at)]);
  }
  return static_cast<float>(largest);
}

/// Samples the largest values by voxels, then enlarges them to the sheet's pixels.
Image2d largest_values(const CtVolume& ct, const CtSheet& sheet) {
  const double spacing = ct.grid.spacing_mm.minCoeff();
  const CtSheet coarse = {sheet.plane, sheet.shown, std::min(sheet.px_per_mm, 1.0 / spacing)};
  const int axis = sheet.plane.depth;
  const double low = sheet.shown.low_mm[axis];
  const auto count = static_cast<int>((sheet.shown.high_mm[axis] - low) / spacing);
  const auto index = [&](int column, int row, double depth_mm) {
    return ct.grid.index_of(coarse.point(column, row, depth_mm));
  };
  const Vector3d step = index(0, 0, low + spacing) - index(0, 0, low);
  Image2d values(coarse.width(), coarse.height());
  for (int row = 0; row < values.height; ++row)
    for (int column = 0; column < values.width; ++column)
      values.at(column, row) =
          largest_along(ct, index(column, row, low + 0.5 * spacing), step, count);
  const auto places = [](int from, int to) {
    std::vector<double> result;
    for (int at = 0; at < to; ++at)
      result.push_back(std::clamp((at + 0.5) * from / to - 0.5, 0.0, from - 1.0));
    return result;
  };
  return resampled_bilinearly(
      values, places(values.width, sheet.width()), places(values.height, sheet.height()));
}

Image2d slice_values(const CtVolume& ct, const CtSheet& sheet, double level_mm) {
  Image2d values(sheet.width(), sheet.height());
  for (int row = 0; row < values.height; ++row)
    for (int column = 0; column < values.width; ++column)
      values.at(column, row) =
          static_cast<float>(hu_at(ct, ct.grid.index_of(sheet.point(column, row, level_mm))));
  return values;
}

/// A round distance between lines, such that about six cross the longer side.
double grid_step_mm(double longest_mm) {
  for (const double step : {1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0})
    if (longest_mm / step <= 9.0) return step;
  return 200.0;
}

/// Lines of the coordinates with their numbers beside and below the image.
void add_grid(const CtSheet& sheet, double step_mm, PicturePanel& panel) {
  const double right = kLeftPx + sheet.width() - 0.5;
  const double bottom = sheet.height() - 0.5;
  const auto each = [&](int axis, const auto& draw) {
    for (double at = step_mm * std::ceil(sheet.shown.low_mm[axis] / step_mm);
         at <= sheet.shown.high_mm[axis];
         at += step_mm)
      draw(at, fixed_text(at + 0.0, 0));
  };
  const auto add = [&](const std::array<double, 2>& from,
                       const std::array<double, 2>& to,
                       const std::array<double, 2>& label,
                       const std::string& text) {
    panel.lines.push_back({{from, to}, PictureColor::Cyan, 0.5});
    panel.marks.push_back({label, PictureMark::Shape::Label, text, PictureColor::Ink});
  };
  each(sheet.plane.right, [&](double mm, const std::string& text) {
    const double x = kLeftPx + sheet.column_of(mm);
    add({x, 0.0}, {x, bottom}, {x, bottom + kBelowPx / 2.0}, text);
  });
  each(sheet.plane.down, [&](double mm, const std::string& text) {
    const double y = sheet.row_of(mm);
    add({kLeftPx, y}, {right, y}, {kLeftPx / 2.0, std::max(y, 6.0)}, text);
  });
}

void add_marks(const CtSheet& sheet,
               const CtMarks& marks,
               double level_mm,
               double reach_mm,
               PicturePanel& panel) {
  const int depth = sheet.plane.depth;
  if (marks.target && level_mm >= marks.target->low_mm[depth] - reach_mm &&
      level_mm <= marks.target->high_mm[depth] + reach_mm) {
    const auto [left, top] = sheet.place(marks.target->low_mm.cwiseMax(sheet.shown.low_mm));
    const auto [right, bottom] = sheet.place(marks.target->high_mm.cwiseMin(sheet.shown.high_mm));
    panel.lines.push_back(
        {{{left, top}, {right, top}, {right, bottom}, {left, bottom}, {left, top}},
         PictureColor::Yellow,
         1.5});
  }
  for (std::size_t i = 0; i < marks.landmarks_ct_mm.size(); ++i)
    if (const Vector3d& point = marks.landmarks_ct_mm[i];
        std::abs(point[depth] - level_mm) <= reach_mm)
      panel.marks.push_back({sheet.place(point),
                             PictureMark::Shape::Cross,
                             std::to_string(i + 1),
                             PictureColor::Red});
}

/// The image with white room for the coordinates.
Image2d with_room(const Image2d& image) {
  Image2d wider(kLeftPx + image.width + kRightPx, image.height + kBelowPx);
  std::ranges::fill(wider.pixels, std::numeric_limits<float>::max());
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < image.width; ++column)
      wider.at(column + kLeftPx, row) = image.at(column, row);
  return wider;
}

/// One slice or, without a level, the largest values along the plane's depth.
PicturePanel ct_panel(const CtVolume& ct,
                      const CtMarks& marks,
                      const CtSheet& sheet,
                      std::optional<double> level_mm,
                      double reach_mm) {
  const Image2d image = level_mm ? slice_values(ct, sheet, *level_mm) : largest_values(ct, sheet);
  const auto [low, high] = percentile_window(image, 0.5, 99.5);
  const CtPlane& plane = sheet.plane;
  const auto name = [](int axis) { return kAxisNames[static_cast<std::size_t>(axis)]; };
  PicturePanel panel;
  panel.image = with_room(image);
  panel.low = low;
  panel.high = high;
  panel.has_scale = false;
  panel.title = plane.name + (level_mm ? std::string(" slice, ") + name(plane.depth) + " = " +
                                             fixed_text(*level_mm + 0.0, 1) + " mm"
                                       : std::string(", largest values"));
  panel.caption = std::string("seen from ") + plane.seen_from + "; " + name(plane.right) +
                  " to the right, " + name(plane.down) +
                  (plane.down_sign > 0 ? " downwards" : " upwards");
  const Vector3d right = Vector3d::Unit(plane.right);
  const Vector3d down = plane.down_sign * Vector3d::Unit(plane.down);
  add_grid(sheet, grid_step_mm((sheet.shown.high_mm - sheet.shown.low_mm).maxCoeff()), panel);
  add_letters({patient_letters(-right),
               patient_letters(right),
               patient_letters(-down),
               patient_letters(down),
               {},
               {}},
              {kLeftPx, 0, image.width, image.height},
              panel);
  add_marks(sheet,
            marks,
            level_mm.value_or(0.0),
            level_mm ? reach_mm : std::numeric_limits<double>::infinity(),
            panel);
  return panel;
}

Vector3d middle(const CtBox& box) {
  return 0.5 * (box.low_mm + box.high_mm);
}

double longest_mm(const CtBox& box) {
  return (box.high_mm - box.low_mm).maxCoeff();
}

std::vector<PicturePanel> axial_slices(const CtVolume& ct, const CtMarks& marks) {
  constexpr int kCount = 20;
  constexpr double kWidestPx = 360.0;
  const CtBox whole = bounding_box(ct.grid);
  const Vector3d size = whole.high_mm - whole.low_mm;
  const double step = size.z() / kCount;
  std::vector<PicturePanel> panels;
  for (int i = 0; i < kCount; ++i)
    panels.push_back(ct_panel(ct,
                              marks,
                              {kPlanes[0], whole, kWidestPx / std::max(size.x(), size.y())},
                              whole.low_mm.z() + (i + 0.5) * step,
                              0.5 * step));
  return panels;
}

/// The three slices through each landmark, showing what lies within 40 mm.
std::vector<PicturePanel> landmark_slices(const CtVolume& ct, const CtMarks& marks) {
  constexpr double kHalfSideMm = 40.0;
  constexpr double kPxPerMm = 8.0;
  const CtBox whole = bounding_box(ct.grid);
  std::vector<PicturePanel> panels;
  for (const Vector3d& landmark : marks.landmarks_ct_mm)
    for (const CtPlane& plane : kPlanes) {
      const CtBox near = {landmark - Vector3d::Constant(kHalfSideMm),
                          landmark + Vector3d::Constant(kHalfSideMm)};
      const CtBox shown = {near.low_mm.cwiseMax(whole.low_mm).cwiseMin(landmark),
                           near.high_mm.cwiseMin(whole.high_mm).cwiseMax(landmark)};
      panels.push_back(ct_panel(ct,
                                marks,
                                {plane, shown, kPxPerMm},
                                landmark[plane.depth],
                                0.5 * ct.grid.spacing_mm.maxCoeff()));
    }
  return panels;
}

}  // namespace

std::vector<PicturePanel> ct_overview(const CtVolume& ct, const CtMarks& marks) {
  constexpr double kLongestPx = 560.0;
  const CtBox whole = bounding_box(ct.grid);
  const Vector3d at = middle(marks.target.value_or(whole));
  std::vector<PicturePanel> panels;
  for (const bool is_slice : {false, true})
    for (const CtPlane& plane : kPlanes)
      panels.push_back(ct_panel(ct,
                                marks,
                                {plane, whole, kLongestPx / longest_mm(whole)},
                                is_slice ? std::optional(at[plane.depth]) : std::nullopt,
                                0.5 * ct.grid.spacing_mm.maxCoeff()));
  return panels;
}

std::vector<std::filesystem::path> draw_ct_pictures(const CtVolume& ct,
                                                    const CtMarks& marks,
                                                    const std::filesystem::path& folder,
                                                    const std::string& stem) {
  std::vector<std::filesystem::path> files;
  const auto write = [&](const std::vector<PicturePanel>& panels,
                         int columns,
                         const char* name,
                         const char* what) {
    files.push_back(folder / (stem + name + ".png"));
    write_picture(panels, columns, stem + what, files.back());
  };
  constexpr const char* kFrame = ": ct coordinates (LPS) in mm";
  write(ct_overview(ct, marks), 3, "-ct", kFrame);
  write(axial_slices(ct, marks), 5, "-ct-axial", kFrame);
  if (!marks.landmarks_ct_mm.empty())
    write(landmark_slices(ct, marks), 3, "-ct-landmarks", ": slices through the landmarks, mm");
  return files;
}

}  // namespace af
