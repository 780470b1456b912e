// SPDX-License-Identifier: Apache-2.0
#include "register/search/pose_search.h"

#include <algorithm>
#include <array>
#include <bitset>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>
#include <sstream>
#include <utility>

#include "base/error.h"
#include "base/joined.h"
#include "geometry/tre.h"
#include "register/method/registration_options.h"
#include "register/problem/target_region.h"
#include "register/search/rotation_set.h"
#include "register/search/searched_view.h"

namespace af::registration {
namespace {

constexpr std::array kOrientations{"field", "flips", "any"};
/// Coarse pixels across the longer side of what is compared; DRRs of more tell no more about where
/// anatomy lies at the steps of this search.
constexpr int kPixelsAcross = 64;
/// Of the first look at all rotations, of which there are eight times fewer at twice the step.
constexpr int kFirstPixelsAcross = 32;
/// How many modes of a look at all rotations are looked at again, with rotations between its own,
/// and of these once more.
struct ModesKept {
  std::size_t first;
  std::size_t second;
};
constexpr ModesKept kKept{8, 5};
/// Shafts of bones lie along each other at many places.
constexpr ModesKept kKeptInSilhouettes{128, 32};
/// How far, in coarse pixels, points at the middle distance from the centre may move between
/// neighbouring rotations. An edge that lies a pixel aside still overlaps, because edges are two to
/// three pixels wide.
constexpr double kPixelsPerRotation = 4.0;
/// Range without fields and without a stated one.
constexpr double kUsualRotationRad = 20.0 * kRadPerDeg;
constexpr double kUsualTranslationMm = 40.0;
constexpr std::size_t kMostRotations = 20000;
/// A range about an axis that holds every angle has no ends.
constexpr double kHalfTurnRad = std::numbers::pi;
/// Maxima of one rotation that are kept: more only repeat each other.
constexpr std::size_t kMaximaPerRotation = 8;
/// Modes lie at least this far from each other: registrations that start nearer end at the same
/// pose.
constexpr double kModesApartMm = 20.0;

/// What both ranges hold.
MotionRange common_part(const MotionRange& a, const MotionRange& b) {
  return {{a.low.rotation_rad.cwiseMax(b.low.rotation_rad),
           a.low.translation_mm.cwiseMax(b.low.translation_mm)},
          {a.high.rotation_rad.cwiseMin(b.high.rotation_rad),
           a.high.translation_mm.cwiseMin(b.high.translation_mm)}};
}

/// A range relative to another frame of the same orientation. InputError for other frames.
MotionRange seen_from(const PoseFrame& frame, const MotionLimit& limit) {
  if (!limit.frame.rotation.isApprox(frame.rotation, 1e-6) ||
      !limit.frame.center_ct_mm.isApprox(frame.center_ct_mm, 1e-6))
    throw InputError("search of starts",
                     "several fields",
                     "the fields' nominal poses differ in rotation or centre: --renderer raycast "
                     "searches without them");
  MotionRange range = limit.range;
  const Eigen::Vector3d apart = limit.frame.center_room_mm - frame.center_room_mm;
  range.low.translation_mm += apart;
  range.high.translation_mm += apart;
  return range;
}

/// Where all fields hold poses, relative to the first one's frame; none without fields.
std::optional<MotionLimit> reach_of_fields(const RegistrationProblem& problem) {
  std::optional<MotionLimit> reach;
  for (const RegistrationView& view : problem.views) {
    if (!view.reach.has_value()) continue;
    if (reach.has_value())
      reach->range = common_part(reach->range, seen_from(reach->frame, *view.reach));
    else
      reach = view.reach;
  }
  return reach;
}

void replace(const std::optional<std::array<double, 3>>& values,
             double unit,
             Eigen::Vector3d& low,
             Eigen::Vector3d& high) {
  if (!values.has_value()) return;
  high = unit * Eigen::Vector3d((*values)[0], (*values)[1], (*values)[2]);
  low = -high;
}

MotionLimit searched_range(const RegistrationProblem& problem, const PoseSearchOptions& options) {
  const std::optional<MotionLimit> of_fields = reach_of_fields(problem);
  MotionLimit searched = of_fields.value_or(
      MotionLimit{problem.frame(), MotionRange(kUsualRotationRad, kUsualTranslationMm)});
  MotionRange& range = searched.range;
  replace(options.rotation_deg, kRadPerDeg, range.low.rotation_rad, range.high.rotation_rad);
  replace(options.translation_mm, 1.0, range.low.translation_mm, range.high.translation_mm);
  if (of_fields.has_value() &&
      (options.orientations != "field" || !of_fields->range.contains(range.low) ||
       !of_fields->range.contains(range.high)))
    throw InputError("--search-orientations, --search-rotation-deg, --search-translation-mm",
                     options.orientations + ", " + range.text(),
                     "must stay within the fields, " + of_fields->range.text() +
                         "; --renderer raycast searches everywhere");
  return searched;
}

/// The rotations from ct to room about which others are searched.
std::vector<Eigen::Matrix3d> searched_orientations(const PoseSearchOptions& options,
                                                   const Eigen::Matrix3d& nominal) {
  std::vector<Eigen::Matrix3d> turned{nominal};
  if (options.orientations == "flips") {
    turned.clear();
    for (const Eigen::Matrix3d& turn : half_turns()) turned.emplace_back(nominal * turn);
  }
  return turned;
}

/// Rotations from ct to room. `step_rad`: between neighbours.
std::vector<Eigen::Matrix3d> searched_rotations(const PoseSearchOptions& options,
                                                const MotionLimit& searched,
                                                double step_rad) {
  const std::vector<Eigen::Matrix3d> moved = options.orientations == "any"
                                                 ? all_rotations(step_rad)
                                                 : rotations_of_range(searched.range, step_rad);
  std::vector<Eigen::Matrix3d> rotations;
  for (const Eigen::Matrix3d& from : searched_orientations(options, searched.frame.rotation))
    for (const Eigen::Matrix3d& by : moved) rotations.emplace_back(by * from);
  if (rotations.size() > kMostRotations)
    throw InputError("--search-rotation-deg",
                     searched.range.text(),
                     "asks for " + std::to_string(rotations.size()) +
                         " rotations: --search-orientations any needs fewer");
  return rotations;
}

/// A place of the search that no neighbour beats.
struct Maximum {
  float likeness = 0.0f;
  std::uint32_t turn = 0;
  std::uint32_t translation = 0;

  /// The likelier first; equal ones by their place, so that the order is always the same.
  [[nodiscard]] bool is_before(const Maximum& other) const {
    if (likeness != other.likeness) return likeness > other.likeness;
    return std::pair(turn, translation) < std::pair(other.turn, other.translation);
  }
};

/// Scratch memory of one thread.
struct Scratch {
  std::vector<std::unique_ptr<RenderWorkspace>> workspaces;  ///< of the views
  Image2d drr;
  std::vector<Eigen::Vector2d> cuts_px;
  std::vector<float> likeness;  ///< of one view, depth after depth
  std::vector<float> sums;      ///< over the views, at every node
};

/// Some translations of a search.
struct SearchedPart {
  LatticePart nodes;
  std::vector<std::size_t> indices;      ///< of the nodes
  std::vector<SearchedView::Part> seen;  ///< by each view
};

/// A rotation, and the translations that are looked at with it.
struct Turn {
  Eigen::Matrix3d rotation;
  const SearchedPart* part;
};

/// A search at one size of pixels, over any rotations.
struct Looking {
  const RegistrationProblem& problem;
  PoseFrame frame;  ///< of the searched range
  double pixel_mm;
  double rotation_step_rad;
  TranslationLattice lattice;
  std::vector<SearchedView> views;

  Looking(const RegistrationProblem& registered,
          const MotionLimit& searched,
          int pixels_across,
          double silhouette_mm);

  [[nodiscard]] RigidTransform pose(const Eigen::Matrix3d& rotation,
                                    const Eigen::Vector3d& translation) const {
    PoseFrame moved = frame;
    moved.rotation = rotation;
    moved.center_room_mm += translation;
    return moved.nominal_room_from_ct();
  }
  [[nodiscard]] SearchedPart part(const LatticePart& nodes) const;
  /// Adds how alike a view is at every translation.
  void add_view(std::size_t view, const Turn& turn, Scratch& scratch) const;
  /// The best maxima of one turn, whose index they get.
  [[nodiscard]] std::vector<Maximum> maxima_of(const Turn& turn,
                                               std::size_t index,
                                               Scratch& scratch) const;
  /// The likeliest poses of these turns, at most `count`, apart from each other.
  [[nodiscard]] std::vector<PoseMode> modes(const std::vector<Turn>& turns,
                                            std::size_t count,
                                            ThreadPool& threads) const;
  /// The same over all translations.
  [[nodiscard]] std::vector<PoseMode> modes(const std::vector<Eigen::Matrix3d>& rotations,
                                            std::size_t count,
                                            ThreadPool& threads) const;
  /// The same about some modes: rotations that differ by a step about some of the axes, and
  /// translations up to `reach_mm` away.
  [[nodiscard]] std::vector<PoseMode> modes_near(const std::vector<PoseMode>& modes,
                                                 double step_rad,
                                                 double reach_mm,
                                                 std::size_t count,
                                                 ThreadPool& threads) const;
};

Looking::Looking(const RegistrationProblem& registered,
                 const MotionLimit& searched,
                 int pixels_across,
                 double silhouette_mm)
    : problem(registered),
      frame(searched.frame),
      pixel_mm(pixel_mm_of(registered, pixels_across, silhouette_mm)),
      rotation_step_rad(kPixelsPerRotation * 2.0 * std::numbers::sqrt2 / pixels_across),
      lattice(searched.range, pixel_mm) {
  for (const RegistrationView& view : problem.views)
    views.push_back(
        searched_view(problem, frame.center_room_mm, view, lattice, pixel_mm, silhouette_mm));
}

SearchedPart Looking::part(const LatticePart& nodes) const {
  SearchedPart part{nodes, lattice.nodes(nodes), {}};
  for (const SearchedView& view : views) part.seen.push_back(view.part(part.indices));
  return part;
}

void Looking::add_view(std::size_t view, const Turn& turn, Scratch& scratch) const {
  const SearchedView& seen = views[view];
  scratch.drr.width = seen.pattern.roi.width;
  scratch.drr.height = seen.pattern.roi.height;
  scratch.drr.pixels.resize(seen.pattern.pixel_count());
  const RigidTransform room_from_ct = pose(turn.rotation, lattice.middle());
  const RenderStatus status = seen.renderer->render(
      room_from_ct, seen.pattern, *scratch.workspaces[view], scratch.drr.pixels);
  // Where a field lacks rays, their zeros would be edges.
  if (!status.is_inside()) return;
  scratch.cuts_px.clear();
  if (seen.silhouette_px > 0.0)
    for (const Eigen::Vector3d& cut : problem.cut_points_ct)
      scratch.cuts_px.emplace_back(seen.pattern.camera.project(room_from_ct * cut));
  const SearchedView::Part& part = turn.part->seen[view];
  scratch.likeness.resize(part.size());
  seen.compare(part, scratch.drr, scratch.cuts_px, scratch.likeness);
  seen.add_likeness(part, turn.part->indices, scratch.likeness, scratch.sums);
}

std::vector<Maximum> Looking::maxima_of(const Turn& turn,
                                        std::size_t index,
                                        Scratch& scratch) const {
  if (scratch.workspaces.empty())
    for (const SearchedView& view : views)
      scratch.workspaces.push_back(view.renderer->make_workspace());
  scratch.sums.assign(turn.part->indices.size(), 0.0f);
  for (std::size_t view = 0; view < views.size(); ++view) add_view(view, turn, scratch);
  std::vector<Maximum> found;
  for (const std::size_t i : maxima(scratch.sums, turn.part->nodes))
    found.push_back({scratch.sums[i] / static_cast<float>(views.size()),
                     static_cast<std::uint32_t>(index),
                     static_cast<std::uint32_t>(turn.part->indices[i])});
  const std::size_t kept = std::min(found.size(), kMaximaPerRotation);
  std::partial_sort(found.begin(),
                    found.begin() + static_cast<std::ptrdiff_t>(kept),
                    found.end(),
                    [](const Maximum& a, const Maximum& b) { return a.is_before(b); });
  found.resize(kept);
  return found;
}

std::vector<PoseMode> Looking::modes(const std::vector<Turn>& turns,
                                     std::size_t count,
                                     ThreadPool& threads) const {
  std::vector<std::vector<Maximum>> of_turns(turns.size());
  std::vector<Scratch> scratch(static_cast<std::size_t>(threads.threads()));
  threads.for_each(static_cast<int>(turns.size()), [&](int turn, int slot) {
    const auto i = static_cast<std::size_t>(turn);
    of_turns[i] = maxima_of(turns[i], i, scratch[static_cast<std::size_t>(slot)]);
  });
  std::vector<Maximum> all;
  for (const std::vector<Maximum>& found : of_turns)
    all.insert(all.end(), found.begin(), found.end());
  std::sort(
      all.begin(), all.end(), [](const Maximum& a, const Maximum& b) { return a.is_before(b); });

  std::vector<PoseMode> found;
  for (const Maximum& maximum : all) {
    if (found.size() == count || maximum.likeness <= 0.0f) break;
    const RigidTransform here =
        pose(turns[maximum.turn].rotation, lattice.translation(maximum.translation));
    const bool is_apart = std::all_of(found.begin(), found.end(), [&](const PoseMode& likelier) {
      return are_apart(problem, here, likelier.room_from_ct, kModesApartMm);
    });
    if (is_apart) found.push_back({here, static_cast<double>(maximum.likeness)});
  }
  return found;
}

std::vector<PoseMode> Looking::modes(const std::vector<Eigen::Matrix3d>& rotations,
                                     std::size_t count,
                                     ThreadPool& threads) const {
  const SearchedPart everywhere = part(lattice.whole());
  std::vector<Turn> turns;
  for (const Eigen::Matrix3d& rotation : rotations) turns.push_back({rotation, &everywhere});
  return modes(turns, count, threads);
}

std::vector<PoseMode> Looking::modes_near(const std::vector<PoseMode>& modes_found,
                                          double step_rad,
                                          double reach_mm,
                                          std::size_t count,
                                          ThreadPool& threads) const {
  std::vector<SearchedPart> parts;
  for (const PoseMode& mode : modes_found) {
    const Eigen::Vector3d center = mode.room_from_ct * frame.center_ct_mm;
    parts.push_back(part(lattice.around(center - frame.center_room_mm, reach_mm)));
  }
  std::vector<Turn> turns;
  for (std::size_t i = 0; i < modes_found.size(); ++i)
    for (const double x : {-step_rad, 0.0, step_rad})
      for (const double y : {-step_rad, 0.0, step_rad})
        for (const double z : {-step_rad, 0.0, step_rad})
          turns.push_back(
              {rotation_from_angles({x, y, z}) * modes_found[i].room_from_ct.linear(), &parts[i]});
  return modes(turns, count, threads);
}

}  // namespace

struct PoseSearch::Parts {
  PoseSearchOptions options;
  std::shared_ptr<ThreadPool> threads;
  MotionLimit searched;
  std::optional<Looking> first;  ///< with a first look at all rotations
  Looking looking;
  std::vector<Eigen::Matrix3d> rotations;  ///< of the first look, if there is one
  ModesKept kept;                          ///< likewise
};

void PoseSearchOptions::describe(Fields& field) {
  field("search_modes",
        modes,
        "Search: how many of the likeliest poses are registered; the best end wins")
      .at_least(1)
      .at_most(100);
  field("search_orientations",
        orientations,
        "Search: 'field' looks at rotations of the fields' range (without fields +-20 "
        "degrees); 'flips' also at the patient turned by 180 degrees about each axis; 'any' at all "
        "rotations. The last two need --renderer raycast")
      .choice({kOrientations.begin(), kOrientations.end()});
  field("search_rotation_deg",
        rotation_deg,
        "Search: rx,ry,rz farthest from nominal, degrees (default: the fields' range)");
  field("search_translation_mm",
        translation_mm,
        "Search: tx,ty,tz farthest from nominal, mm (default: the fields' range, without "
        "fields 40 mm)");
}

std::vector<std::string> problems(const PoseSearchOptions& options) {
  std::vector<std::string> found;
  const auto check_each =
      [&](const std::optional<std::array<double, 3>>& values, const char* name, double most) {
        if (!values.has_value()) return;
        for (const double value : *values)
          if (!(value >= 0.0 && value <= most))
            found.push_back(std::string(name) + " = " + std::to_string(value) +
                            ": must be from 0 to " + std::to_string(static_cast<int>(most)));
      };
  if (std::ranges::find(kOrientations, options.orientations) == kOrientations.end())
    found.push_back("--search-orientations = " + options.orientations + ": must be one of " +
                    joined(kOrientations));
  check_each(options.rotation_deg, "--search-rotation-deg", 180.0);
  check_each(options.translation_mm, "--search-translation-mm", 1000.0);
  if (options.orientations == "any" && options.rotation_deg.has_value())
    found.emplace_back(
        "--search-rotation-deg = set: must be left out with --search-orientations any");
  return found;
}

std::vector<std::string> problems_without_search(const PoseSearchOptions& options,
                                                 const std::string& wanted_by) {
  const PoseSearchOptions usual;
  std::vector<std::string> found;
  const auto refuse = [&](const char* name, bool is_given) {
    if (is_given)
      found.push_back(std::string(name) + " = set: must not be given without " + wanted_by);
  };
  refuse("--search-modes", options.modes != usual.modes);
  refuse("--search-orientations", options.orientations != usual.orientations);
  refuse("--search-rotation-deg", options.rotation_deg.has_value());
  refuse("--search-translation-mm", options.translation_mm.has_value());
  return found;
}

int coarsest_level(const PoseSearchOptions& options) {
  return options.orientations == "any" ? kCoarsestLevel : kCoarsestLevel - 1;
}

double seen_distance_mm(const RegistrationProblem& problem,
                        const RigidTransform& a,
                        const RigidTransform& b) {
  const std::vector<Eigen::Vector3d>& points =
      problem.target_points_ct.empty() ? problem.scaling_points_ct : problem.target_points_ct;
  return problem.views.size() > 1 ? mean_tre_mm(a, b, points)
                                  : across_beam_mm(problem, points, a, b);
}

bool are_apart(const RegistrationProblem& problem,
               const RigidTransform& a,
               const RigidTransform& b,
               double distance_mm) {
  constexpr double kTurnedRad = 30.0 * kRadPerDeg;
  return seen_distance_mm(problem, a, b) >= distance_mm ||
         rotation_angle_between_rad(a, b) >= kTurnedRad;
}

PoseSearch::PoseSearch(const RegistrationProblem& problem,
                       const PoseSearchOptions& options,
                       double silhouette_mm,
                       std::shared_ptr<ThreadPool> threads) {
  throw_if_any(problems(options));
  throw_if_any(problems(problem));
  const MotionLimit searched = searched_range(problem, options);
  const bool is_everywhere = options.orientations == "any";
  std::optional<Looking> first;
  if (is_everywhere) first.emplace(problem, searched, kFirstPixelsAcross, silhouette_mm);
  Looking looking(problem, searched, kPixelsAcross, silhouette_mm);
  const double step_rad = is_everywhere ? first->rotation_step_rad : looking.rotation_step_rad;
  parts_ =
      std::make_unique<Parts>(Parts{options,
                                    threads ? std::move(threads) : std::make_shared<ThreadPool>(),
                                    searched,
                                    std::move(first),
                                    std::move(looking),
                                    searched_rotations(options, searched, step_rad),
                                    silhouette_mm > 0.0 ? kKeptInSilhouettes : kKept});
}

PoseSearch::~PoseSearch() = default;
PoseSearch::PoseSearch(PoseSearch&&) noexcept = default;
PoseSearch& PoseSearch::operator=(PoseSearch&&) noexcept = default;

const MotionRange& PoseSearch::range() const {
  return parts_->searched.range;
}

std::size_t PoseSearch::rotation_count() const {
  return parts_->rotations.size();
}

ParameterSet PoseSearch::ends_at(const RigidTransform& room_from_ct) const {
  const auto& [frame, range] = parts_->searched;
  const Looking& looking = parts_->looking;
  const std::vector<Eigen::Matrix3d> orientations =
      searched_orientations(parts_->options, frame.rotation);
  PoseFrame nearest = frame;
  nearest.rotation =
      *std::ranges::max_element(orientations, {}, [&](const Eigen::Matrix3d& orientation) {
        return (orientation.transpose() * room_from_ct.linear()).trace();
      });
  const PoseParameters at = parameters_from_pose(nearest, room_from_ct);
  const std::bitset<3> outer =
      parts_->options.orientations == "any"
          ? std::bitset<3>()
          : in_outer_cells(range, looking.rotation_step_rad, at.rotation_rad);
  ParameterSet ends;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    const bool is_depth =
        looking.views.size() == 1 && std::pow(looking.views.front().along_beam[axis], 2) > 0.5;
    ends[i] = outer[i] && range.high.rotation_rad[axis] < kHalfTurnRad - 1e-9;
    ends[i + 3] = !is_depth && looking.lattice.axes[i].is_at_end(at.translation_mm[axis]);
  }
  return ends;
}

std::string PoseSearch::options_beyond(const ParameterSet& ends) const {
  MotionRange wider = parts_->searched.range;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto axis = static_cast<Eigen::Index>(i);
    for (PoseParameters* const bound : {&wider.low, &wider.high}) {
      double& angle_rad = bound->rotation_rad[axis];
      if (ends[i]) angle_rad = std::clamp(2.0 * angle_rad, -kHalfTurnRad, kHalfTurnRad);
      if (ends[i + 3]) bound->translation_mm[axis] *= 2.0;
    }
  }
  const Looking& looking = parts_->looking;
  const std::optional<MotionLimit> of_fields = reach_of_fields(looking.problem);
  if (of_fields.has_value() &&
      !(of_fields->range.contains(wider.low) && of_fields->range.contains(wider.high)))
    return "";
  const std::array<double, 6> high = wider.high.deg_and_mm();
  const auto numbers = [&](std::size_t first) {
    std::ostringstream text;
    text.precision(4);
    text << high[first] << ',' << high[first + 1] << ',' << high[first + 2];
    return text.str();
  };
  std::vector<std::string> options;
  if (ends[0] || ends[1] || ends[2]) {
    const std::size_t rotations =
        rotations_of_range(wider, looking.rotation_step_rad).size() *
        searched_orientations(parts_->options, parts_->searched.frame.rotation).size();
    options.push_back(rotations > kMostRotations ? "--search-orientations any"
                                                 : "--search-rotation-deg " + numbers(0));
  }
  if (ends[3] || ends[4] || ends[5]) options.push_back("--search-translation-mm " + numbers(3));
  return joined(options, " ");
}

std::vector<PoseMode> PoseSearch::modes() const {
  const auto count = static_cast<std::size_t>(parts_->options.modes);
  ThreadPool& threads = *parts_->threads;
  const Looking& looking = parts_->looking;
  const ModesKept& kept = parts_->kept;
  std::vector<PoseMode> modes;
  if (parts_->first.has_value()) {
    const Looking& first = *parts_->first;
    const double step_rad = looking.rotation_step_rad;
    modes = first.modes(parts_->rotations, std::max(count, kept.first), threads);
    modes =
        looking.modes_near(modes, step_rad, first.pixel_mm, std::max(count, kept.second), threads);
    modes = looking.modes_near(modes, 0.5 * step_rad, looking.pixel_mm, count, threads);
  } else {
    modes = looking.modes(parts_->rotations, count, threads);
  }
  if (modes.empty())
    throw InputError(
        "search of starts", parts_->searched.range.text(), "no DRR there is like the X-rays");
  return modes;
}

}  // namespace af::registration
