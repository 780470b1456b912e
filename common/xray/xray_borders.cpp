// SPDX-License-Identifier: Apache-2.0
#include "xray/xray_borders.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "base/error.h"
#include "base/number_text.h"
#include "xray/gaussian_blur.h"
#include "xray/quantile.h"

namespace af {

namespace {

constexpr double kMostMasked = 0.75;    ///< of the picture
constexpr double kLeastMasked = 0.001;  ///< less is noise at the edge
constexpr double kMostBorderShare =
    0.5;                             ///< share of the bright level, including the detector's offset
constexpr double kDarkShare = 0.15;  ///< share of the way from the border's level to the bright one
constexpr double kAsDarkShare = 0.12;  ///< share of the same way: as dark as the border
constexpr double kLeastRiseShare =
    0.2;  ///< share of the same way: least level inside a field's edge
constexpr double kLeastFieldPart =
    0.005;                                ///< share of the picture: smaller bright parts are specks
constexpr double kMostOpaquePart = 0.02;  ///< share of the picture, for one body
constexpr double kPenumbraShare = 0.06;   ///< share of the shorter side: the widest penumbra
constexpr double kRisen = 0.9;            ///< share of the level inside: where the penumbra ends
constexpr double kStraightShare = 0.15;   ///< share of the shorter side
constexpr double kMostStraight = 0.5;     ///< share of a circle's edge, where anatomy crosses it
constexpr double kCircleRmsShare = 0.02;  ///< share of the radius
constexpr double kMostMore = 0.1;         ///< share that a circle may mask beyond the hull
constexpr double kNoiseSigmaPx = 1.5;

struct Rect {
  int left = 0, top = 0, right = 0, bottom = 0;  ///< inclusive
  [[nodiscard]] int width() const { return right - left + 1; }
  [[nodiscard]] int height() const { return bottom - top + 1; }
};

bool is_constant_row(const Image2d& image, int row, int left, int right) {
  for (int column = left; column <= right; ++column)
    if (image.at(column, row) != image.at(left, row)) return false;
  return true;
}

bool is_constant_column(const Image2d& image, int column, int top, int bottom) {
  for (int row = top; row <= bottom; ++row)
    if (image.at(column, row) != image.at(column, top)) return false;
  return true;
}

/// The picture without its constant rows and columns. At most a quarter of a side is cut from each.
Rect live_rect(const Image2d& image) {
  Rect live = {0, 0, image.width - 1, image.height - 1};
  const int most_columns = image.width / 4;
  const int most_rows = image.height / 4;
  while (live.top < most_rows && is_constant_row(image, live.top, 0, image.width - 1)) ++live.top;
  while (image.height - 1 - live.bottom < most_rows &&
         is_constant_row(image, live.bottom, 0, image.width - 1))
    --live.bottom;
  while (live.left < most_columns && is_constant_column(image, live.left, live.top, live.bottom))
    ++live.left;
  while (image.width - 1 - live.right < most_columns &&
         is_constant_column(image, live.right, live.top, live.bottom))
    --live.right;
  return live;
}

Image2d part_of(const Image2d& image, const Rect& rect) {
  return crop(image, {rect.left, rect.top, rect.width(), rect.height()});
}

struct Levels {
  double border = 0.0;  ///< level of the darkest place of the outermost pixels
  double dark = 0.0;    ///< below this a pixel may be border
  double bright = 0.0;
  bool is_border_dark = false;  ///< much darker than air, as dark as the picture's darkest parts
};

Levels levels_of(const Image2d& smooth) {
  Levels levels;
  levels.bright = nearest_rank(smooth.pixels, 0.95);
  const double darkest = nearest_rank(smooth.pixels, 0.001);
  double border = std::numeric_limits<double>::infinity();
  for (int row = 0; row < smooth.height; ++row)
    for (int column = 0; column < smooth.width;
         column += row == 0 || row == smooth.height - 1 ? 1 : std::max(1, smooth.width - 1))
      border = std::min(border, static_cast<double>(smooth.at(column, row)));
  levels.border = border;
  levels.dark = border + kDarkShare * (levels.bright - border);
  levels.is_border_dark = border <= kMostBorderShare * levels.bright &&
                          border - darkest <= kDarkShare * (levels.bright - darkest);
  return levels;
}

/// Connected parts (4 neighbours) of the pixels that `is_in` accepts, each as a list of pixels.
template <typename IsIn>
std::vector<std::vector<int>> parts_of(int width, int height, const IsIn& is_in) {
  std::vector<std::vector<int>> parts;
  std::vector<std::uint8_t> seen(static_cast<std::size_t>(width) *
                                 static_cast<std::size_t>(height));
  const int count = width * height;
  for (int seed = 0; seed < count; ++seed) {
    if (seen[static_cast<std::size_t>(seed)] != 0 || !is_in(seed)) continue;
    std::vector<int> part = {seed};
    seen[static_cast<std::size_t>(seed)] = 1;
    for (std::size_t next = 0; next < part.size(); ++next) {
      const int at = part[next];
      const int column = at % width;
      const auto visit = [&](bool exists, int other) {
        if (!exists || seen[static_cast<std::size_t>(other)] != 0 || !is_in(other)) return;
        seen[static_cast<std::size_t>(other)] = 1;
        part.push_back(other);
      };
      visit(column > 0, at - 1);
      visit(column + 1 < width, at + 1);
      visit(at >= width, at - width);
      visit(at + width < count, at + width);
    }
    parts.push_back(std::move(part));
  }
  return parts;
}

struct Point {
  double x = 0.0;
  double y = 0.0;
};

double cross(const Point& o, const Point& a, const Point& b) {
  return (a.x - o.x) * (b.y - o.y) - (a.y - o.y) * (b.x - o.x);
}

/// Andrew's monotone chain. Points on straight lines are left out.
std::vector<Point> convex_hull(std::vector<Point> points) {
  std::sort(points.begin(), points.end(), [](const Point& a, const Point& b) {
    return a.x < b.x || (a.x == b.x && a.y < b.y);
  });
  std::vector<Point> hull;
  for (int pass = 0; pass < 2; ++pass) {
    const std::size_t start = hull.size();
    for (const Point& point : points) {
      while (hull.size() >= start + 2 && cross(hull[hull.size() - 2], hull.back(), point) <= 0.0)
        hull.pop_back();
      hull.push_back(point);
    }
    if (!hull.empty()) hull.pop_back();
    std::reverse(points.begin(), points.end());
  }
  return hull;
}

/// One side of the field: inside is x * column + y * row <= limit.
struct Side {
  double x = 0.0;
  double y = 0.0;
  double limit = 0.0;
  double length_px = 0.0;
  bool is_picture_edge = false;
};

std::vector<Side> sides_of(const std::vector<Point>& hull, int width, int height) {
  constexpr double kAtEdgePx = 1.5;
  std::vector<Side> sides;
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Point& a = hull[i];
    const Point& b = hull[(i + 1) % hull.size()];
    Side side;
    side.length_px = std::hypot(b.x - a.x, b.y - a.y);
    side.x = (b.y - a.y) / side.length_px;
    side.y = (a.x - b.x) / side.length_px;
    side.limit = side.x * a.x + side.y * a.y;
    const auto both = [&](double va, double vb, double edge) {
      return std::abs(va - edge) <= kAtEdgePx && std::abs(vb - edge) <= kAtEdgePx;
    };
    side.is_picture_edge = both(a.x, b.x, 0.0) || both(a.x, b.x, width - 1.0) ||
                           both(a.y, b.y, 0.0) || both(a.y, b.y, height - 1.0);
    sides.push_back(side);
  }
  return sides;
}

struct Interval {
  int first = 0;
  int last = -1;
};

/// The field's columns in a row, `margin_px` inside its sides (except along the picture's own
/// edges).
Interval row_of_field(const std::vector<Side>& sides, int row, int width, double margin_px) {
  constexpr double kRounding = 1e-6;
  double low = 0.0;
  double high = width - 1.0;
  for (const Side& side : sides) {
    const double rest = side.limit - (side.is_picture_edge ? 0.0 : margin_px) - side.y * row;
    if (side.x > kRounding)
      high = std::min(high, rest / side.x);
    else if (side.x < -kRounding)
      low = std::max(low, rest / side.x);
    else if (rest < -kRounding)
      return {};
  }
  return {static_cast<int>(std::ceil(low - kRounding)),
          static_cast<int>(std::floor(high + kRounding))};
}

/// Medians of rings of one pixel inside the field's edge, outermost first, as far in as a penumbra
/// may reach. Anatomy that crosses the edge is in every ring.
std::vector<double> ring_medians(const Image2d& smooth,
                                 const std::vector<Side>& sides,
                                 double border_level) {
  const int most = std::max(
      4, static_cast<int>(std::lround(kPenumbraShare * std::min(smooth.width, smooth.height))));
  std::vector<std::vector<float>> rings(static_cast<std::size_t>(most));
  for (int row = 0; row < smooth.height; ++row) {
    Interval outer = row_of_field(sides, row, smooth.width, 0.0);
    for (int k = 0; k < most; ++k) {
      const Interval inner = row_of_field(sides, row, smooth.width, k + 1.0);
      for (int column = outer.first; column <= outer.last; ++column) {
        if (column >= inner.first && column <= inner.last) column = inner.last + 1;
        if (column <= outer.last)
          rings[static_cast<std::size_t>(k)].push_back(smooth.at(column, row));
      }
      outer = inner;
    }
  }
  std::vector<double> medians;
  medians.reserve(rings.size());
  for (const std::vector<float>& ring : rings)
    medians.push_back(ring.empty() ? border_level : static_cast<double>(nearest_rank(ring, 0.5)));
  return medians;
}

/// How many pixels values take to rise from the border's level to the field's, along the field's
/// edge.
int penumbra_px(const std::vector<double>& medians, double border_level) {
  const double inside = *std::max_element(medians.begin(), medians.end());
  const double risen = border_level + kRisen * (inside - border_level);
  const auto end =
      std::find_if(medians.begin(), medians.end(), [&](double m) { return m >= risen; });
  return static_cast<int>(end - medians.begin());
}

/// Whether the sides separate a border from a field. Most of the edge must be bright on its inner
/// side, and what lies a third to two thirds of the widest penumbra beyond it must be as dark as a
/// border. For dark anatomy at the edge of the picture, the hull of the rest instead cuts through
/// what is equally dark on both sides, or fades slowly.
bool parts_dark_from_bright(const Image2d& smooth,
                            const std::vector<Side>& sides,
                            const std::vector<double>& rings,
                            const Levels& levels) {
  const double range = levels.bright - levels.border;
  if (*std::max_element(rings.begin(), rings.end()) < levels.border + kLeastRiseShare * range)
    return false;
  const double penumbra = kPenumbraShare / 3.0 * std::min(smooth.width, smooth.height);
  std::vector<float> beyond;
  for (int row = 0; row < smooth.height; ++row) {
    const Interval near = row_of_field(sides, row, smooth.width, -penumbra);
    const Interval far = row_of_field(sides, row, smooth.width, -2.0 * penumbra);
    for (int column = std::max(0, far.first); column <= std::min(smooth.width - 1, far.last);
         ++column)
      if (column < near.first || column > near.last) beyond.push_back(smooth.at(column, row));
  }
  return beyond.empty() ||
         static_cast<double>(nearest_rank(beyond, 0.5)) <= levels.border + 0.5 * kDarkShare * range;
}

/// Least squares by Kasa: x^2 + y^2 + D x + E y + F = 0.
std::optional<XrayBorders::Circle> fitted_circle(const std::vector<Point>& points) {
  if (points.size() < 6) return std::nullopt;
  double mx = 0.0;
  double my = 0.0;
  for (const Point& p : points) {
    mx += p.x / static_cast<double>(points.size());
    my += p.y / static_cast<double>(points.size());
  }
  double uu = 0, uv = 0, vv = 0, uz = 0, vz = 0, z_sum = 0;
  for (const Point& p : points) {
    const double u = p.x - mx;
    const double v = p.y - my;
    const double z = u * u + v * v;
    uu += u * u;
    uv += u * v;
    vv += v * v;
    uz += u * z;
    vz += v * z;
    z_sum += z;
  }
  const double determinant = uu * vv - uv * uv;
  if (!(determinant > 1e-9 * uu * vv)) return std::nullopt;
  const double cu = 0.5 * (uz * vv - vz * uv) / determinant;
  const double cv = 0.5 * (vz * uu - uz * uv) / determinant;
  XrayBorders::Circle circle;
  circle.column_px = mx + cu;
  circle.row_px = my + cv;
  circle.radius_px = std::sqrt(cu * cu + cv * cv + z_sum / static_cast<double>(points.size()));
  double squares = 0.0;
  for (const Point& p : points) {
    const double d = std::hypot(p.x - circle.column_px, p.y - circle.row_px) - circle.radius_px;
    squares += d * d;
  }
  circle.rms_px = std::sqrt(squares / static_cast<double>(points.size()));
  if (circle.rms_px > kCircleRmsShare * circle.radius_px) return std::nullopt;
  return circle;
}

/// Tangents so dense that they stand for the circle. Where dark anatomy crosses the edge, the hull
/// cuts a corner off and the circle does not.
std::vector<Side> sides_of_circle(const XrayBorders::Circle& circle) {
  constexpr int kSides = 180;
  std::vector<Side> sides;
  for (int i = 0; i < kSides; ++i) {
    const double angle = 2.0 * M_PI * i / kSides;
    Side side;
    side.x = std::cos(angle);
    side.y = std::sin(angle);
    side.limit = side.x * circle.column_px + side.y * circle.row_px + circle.radius_px;
    sides.push_back(side);
  }
  return sides;
}

double pixels_beyond(const std::vector<Side>& sides, const Image2d& live) {
  double beyond = 0.0;
  for (int row = 0; row < live.height; ++row) {
    const Interval in = row_of_field(sides, row, live.width, 0.0);
    beyond += live.width - std::max(0, in.last - in.first + 1);
  }
  return beyond;
}

/// Clears the field beyond `margin_px` inside its sides. Returns how many pixels that were.
double clear_beyond(const std::vector<Side>& sides, int margin_px, Image2d& field) {
  double cleared = 0.0;
  for (int row = 0; row < field.height; ++row) {
    const Interval in = row_of_field(sides, row, field.width, margin_px);
    for (int column = 0; column < field.width; ++column)
      if (column < in.first || column > in.last) {
        field.at(column, row) = 0.0f;
        cleared += 1.0;
      }
  }
  return cleared;
}

/// The dark parts that reach the edge.
std::vector<std::vector<int>> dark_parts_at_edge(const Image2d& smooth, double dark) {
  const auto is_at_edge = [&](int at) {
    const int column = at % smooth.width;
    const int row = at / smooth.width;
    return column == 0 || row == 0 || column == smooth.width - 1 || row == smooth.height - 1;
  };
  auto parts = parts_of(smooth.width, smooth.height, [&](int at) {
    return static_cast<double>(smooth.pixels[static_cast<std::size_t>(at)]) < dark;
  });
  std::erase_if(parts, [&](const std::vector<int>& part) {
    return std::none_of(part.begin(), part.end(), is_at_edge);
  });
  return parts;
}

/// First and last column of the field's bright parts in every row. Specks are left out.
std::vector<Point> outline_of_field(const Image2d& smooth,
                                    const std::vector<std::uint8_t>& is_dark) {
  const auto parts = parts_of(smooth.width, smooth.height, [&](int at) {
    return is_dark[static_cast<std::size_t>(at)] == 0;
  });
  const auto least = kLeastFieldPart * static_cast<double>(smooth.pixels.size());
  std::vector<Point> points;
  for (const std::vector<int>& part : parts) {
    if (static_cast<double>(part.size()) < least) continue;
    std::vector<Interval> rows(static_cast<std::size_t>(smooth.height),
                               {std::numeric_limits<int>::max(), -1});
    for (const int at : part) {
      Interval& row = rows[static_cast<std::size_t>(at / smooth.width)];
      row.first = std::min(row.first, at % smooth.width);
      row.last = std::max(row.last, at % smooth.width);
    }
    for (std::size_t row = 0; row < rows.size(); ++row)
      if (rows[row].last >= 0) {
        points.push_back({static_cast<double>(rows[row].first), static_cast<double>(row)});
        points.push_back({static_cast<double>(rows[row].last), static_cast<double>(row)});
      }
  }
  return points;
}

/// Clears small bodies at the edge that are as dark as the border, with `margin_px` around them.
double clear_opaque_parts(const Image2d& smooth,
                          const std::vector<std::vector<int>>& dark_parts,
                          double as_dark,
                          int margin_px,
                          Image2d& field) {
  std::size_t cleared = 0;
  const Image2d before = field;
  for (const std::vector<int>& part : dark_parts) {
    std::vector<float> inside;
    for (const int at : part)
      if (before.pixels[static_cast<std::size_t>(at)] != 0.0f)
        inside.push_back(smooth.pixels[static_cast<std::size_t>(at)]);
    if (inside.empty() || static_cast<double>(inside.size()) >
                              kMostOpaquePart * static_cast<double>(smooth.pixels.size()))
      continue;
    if (static_cast<double>(nearest_rank(inside, 0.5)) > as_dark) continue;
    for (const int at : part)
      for (int row = std::max(0, at / smooth.width - margin_px);
           row <= std::min(smooth.height - 1, at / smooth.width + margin_px);
           ++row)
        for (int column = std::max(0, at % smooth.width - margin_px);
             column <= std::min(smooth.width - 1, at % smooth.width + margin_px);
             ++column)
          if (field.at(column, row) != 0.0f) {
            field.at(column, row) = 0.0f;
            ++cleared;
          }
  }
  return static_cast<double>(cleared);
}

/// The field within the live part of a picture. Writes what it found into `borders`.
Image2d field_of(const Image2d& live, XrayBorders& borders) {
  constexpr int kOpaqueMarginPx = 3;
  Image2d field(live.width, live.height);
  std::fill(field.pixels.begin(), field.pixels.end(), 1.0f);
  const Image2d smooth = gaussian_blur(live, kNoiseSigmaPx);
  const Levels levels = levels_of(smooth);
  if (!levels.is_border_dark || !(levels.bright > levels.border)) return field;
  const auto dark_parts = dark_parts_at_edge(smooth, levels.dark);
  std::vector<std::uint8_t> is_dark(live.pixels.size());
  for (const auto& part : dark_parts)
    for (const int at : part) is_dark[static_cast<std::size_t>(at)] = 1;
  const std::vector<Point> hull = convex_hull(outline_of_field(smooth, is_dark));
  if (hull.size() < 3) return field;
  std::vector<Side> sides = sides_of(hull, live.width, live.height);
  const auto total = static_cast<double>(live.pixels.size());
  const double beyond = pixels_beyond(sides, live);
  const std::vector<double> rings = ring_medians(smooth, sides, levels.border);
  if (beyond > kMostMasked * total ||
      (beyond > kLeastMasked * total && !parts_dark_from_bright(smooth, sides, rings, levels))) {
    borders.doubt = "something dark at the edge, " + number_text(std::round(100 * beyond / total)) +
                    " % of the picture, may be anatomy and is left in";
    return field;
  }
  if (beyond > kLeastMasked * total) {
    std::vector<Point> edge;
    double length_px = 0.0;
    double straight_px = 0.0;
    for (std::size_t i = 0; i < sides.size(); ++i) {
      if (sides[i].is_picture_edge) continue;
      length_px += sides[i].length_px;
      if (sides[i].length_px > kStraightShare * std::min(live.width, live.height)) {
        straight_px += sides[i].length_px;
        ++borders.straight_sides;
      }
      edge.push_back(hull[i]);
      edge.push_back(hull[(i + 1) % hull.size()]);
    }
    // This test comes first because a circle goes through the corners of any rectangle.
    if (straight_px < kMostStraight * length_px) borders.circle = fitted_circle(edge);
    if (borders.circle) {
      const std::vector<Side> tangents = sides_of_circle(*borders.circle);
      // A short arc does not tell where the rest of its circle runs.
      if (pixels_beyond(tangents, live) <= (1.0 + kMostMore) * beyond)
        sides = tangents;
      else
        borders.circle.reset();
    }
    const std::vector<double> edge_rings =
        borders.circle ? ring_medians(smooth, sides, levels.border) : rings;
    borders.margin_px = 1 + penumbra_px(edge_rings, levels.border) +
                        (borders.circle ? static_cast<int>(std::ceil(borders.circle->rms_px)) : 0);
    borders.aperture_share = clear_beyond(sides, borders.margin_px, field);
  }
  borders.opaque_share =
      clear_opaque_parts(smooth,
                         dark_parts,
                         levels.border + kAsDarkShare * (levels.bright - levels.border),
                         kOpaqueMarginPx,
                         field);
  return field;
}

std::string percent(double share) {
  return number_text(std::round(1000.0 * share) / 10.0) + " %";
}

}  // namespace

double XrayBorders::masked_share() const {
  if (mask.pixels.empty()) return 0.0;
  return static_cast<double>(std::count(mask.pixels.begin(), mask.pixels.end(), 0.0f)) /
         static_cast<double>(mask.pixels.size());
}

std::string XrayBorders::text() const {
  std::string text = "masked " + percent(masked_share());
  const char* separator = ": ";
  const auto add = [&](const std::string& what) {
    text += separator + what;
    separator = "; ";
  };
  if (dead_px != std::array<int, 4>{0, 0, 0, 0})
    add("dead borders of " + std::to_string(dead_px[0]) + ", " + std::to_string(dead_px[1]) + ", " +
        std::to_string(dead_px[2]) + ", " + std::to_string(dead_px[3]) +
        " px (left, top, right, bottom)");
  if (aperture_share > 0.0) {
    std::string what = percent(aperture_share) + " beyond ";
    if (circle)
      what += "a round edge about pixel (" + number_text(std::round(circle->column_px)) + ", " +
              number_text(std::round(circle->row_px)) + ") of radius " +
              number_text(std::round(circle->radius_px)) + " px (rms " +
              number_text(std::round(10 * circle->rms_px) / 10) + " px)";
    else
      what += "a convex edge with " + std::to_string(straight_sides) + " long straight sides";
    add(what + ", with a margin of " + std::to_string(margin_px) + " px");
  }
  if (opaque_share > 0.0) add(percent(opaque_share) + " opaque bodies at the edge");
  if (!doubt.empty()) add(doubt);
  return text;
}

XrayBorders find_xray_borders(const Image2d& intensity) {
  check(intensity.width > 0 && intensity.height > 0, "borders are looked for in a picture");
  XrayBorders borders;
  const Rect live = live_rect(intensity);
  borders.dead_px = {
      live.left, live.top, intensity.width - 1 - live.right, intensity.height - 1 - live.bottom};
  borders.mask = Image2d(intensity.width, intensity.height);
  if (live.width() < 8 || live.height() < 8) {
    std::fill(borders.mask.pixels.begin(), borders.mask.pixels.end(), 1.0f);
    borders.dead_px = {0, 0, 0, 0};
    return borders;
  }
  const Image2d field = field_of(part_of(intensity, live), borders);
  if (borders.circle) {
    borders.circle->column_px += live.left;
    borders.circle->row_px += live.top;
  }
  for (int row = 0; row < field.height; ++row)
    for (int column = 0; column < field.width; ++column)
      borders.mask.at(live.left + column, live.top + row) = field.at(column, row);
  const auto total = static_cast<double>(intensity.pixels.size());
  borders.aperture_share /= total;
  borders.opaque_share /= total;
  return borders;
}

std::vector<float> values_along_edge(const Image2d& intensity, const Image2d& mask, int width_px) {
  check(mask.pixels.empty() || (mask.width == intensity.width && mask.height == intensity.height),
        "a mask has the size of its image");
  const int width = intensity.width;
  const int height = intensity.height;
  std::vector<float> values;
  const auto at = [&](int column, int row) {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(column);
  };
  if (mask.pixels.empty()) {
    for (int row = 0; row < height; ++row)
      for (int column = 0; column < width; ++column)
        if (std::min({column, row, width - 1 - column, height - 1 - row}) < width_px)
          values.push_back(intensity.pixels[at(column, row)]);
    return values;
  }
  // Steps to the nearest masked pixel or to the outside, along rows and along columns.
  const int far = width_px + 1;
  std::vector<int> steps(intensity.pixels.size(), far);
  std::vector<int> down(static_cast<std::size_t>(width), 0);
  std::vector<int> up(down);
  const auto walk = [&](int column, int row, int& across, int& along) {
    const std::size_t pixel = at(column, row);
    const bool is_masked = mask.pixels[pixel] == 0.0f;
    across = is_masked ? 0 : std::min(far, across + 1);
    along = is_masked ? 0 : std::min(far, along + 1);
    steps[pixel] = std::min({steps[pixel], across, along});
  };
  for (int row = 0; row < height; ++row) {
    int across = 0;
    for (int column = 0; column < width; ++column)
      walk(column, row, across, down[static_cast<std::size_t>(column)]);
  }
  for (int row = height - 1; row >= 0; --row) {
    int across = 0;
    for (int column = width - 1; column >= 0; --column)
      walk(column, row, across, up[static_cast<std::size_t>(column)]);
  }
  for (std::size_t i = 0; i < steps.size(); ++i)
    if (steps[i] > 0 && steps[i] <= width_px) values.push_back(intensity.pixels[i]);
  return values;
}

}  // namespace af
