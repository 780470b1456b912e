// SPDX-License-Identifier: Apache-2.0
#include "benchmark/plastimatch_drr.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iomanip>
#include <sstream>

#include "base/error.h"
#include "ct/ct_reader.h"
#include "support/run_program.h"

namespace af::benchmark {

namespace {

constexpr double kToleranceMm = 1e-6;

/// Gantry angle in radians, which plastimatch takes although it calls them degrees. At 0 the source
/// is at +x, at pi / 2 at -y. nullopt when the camera is no gantry.
std::optional<double> gantry_angle_rad(const CameraGeometry& camera,
                                       const Eigen::Vector3d& center) {
  const Eigen::Vector3d source = camera.source_point - center;
  const Eigen::Vector2d middle = camera.project(center);
  const Eigen::Vector2d detector_middle = 0.5 * (camera.size_px.cast<double>().array() - 1.0);
  const bool is_gantry = std::abs(source.z()) < kToleranceMm &&
                         (middle - detector_middle).norm() < kToleranceMm &&
                         camera.row_direction.isApprox(-Eigen::Vector3d::UnitZ()) &&
                         camera.beam_direction().isApprox(-source.normalized());
  if (!is_gantry) return std::nullopt;
  return std::atan2(-source.y(), source.x());
}

/// The sum of the numbers that follow `key` in a program's output.
double seconds_after(const std::string& output, const std::string& key) {
  double sum = 0.0;
  std::size_t found = 0;
  for (std::size_t at = output.find(key); at != std::string::npos; at = output.find(key, at + 1)) {
    sum += std::strtod(output.c_str() + at + key.size(), nullptr);
    ++found;
  }
  if (found == 0) throw FileError("plastimatch", "its output has no '" + key + "': " + output);
  return sum;
}

/// The CT as the attenuation that our casters see: plastimatch's own conversion from HU drops much
/// of a lung, and without it plastimatch has less to do.
CtVolume relative_attenuation_of(const BenchmarkCase& benchmark_case) {
  const CtVolume& ct = benchmark_case.ct();
  const AttenuationModel& model = benchmark_case.volume()->model();
  std::vector<std::int16_t> values;
  values.reserve(ct.hu.size());
  for (const std::int16_t hu : ct.hu.view())
    values.push_back(
        static_cast<std::int16_t>(std::min<int>(model.relative_attenuation(hu), 32767)));
  return {ct.grid, SharedArray<std::int16_t>(std::move(values))};
}

std::string drr_command(const BenchmarkCase& benchmark_case,
                        double angle_rad,
                        const std::filesystem::path& folder,
                        int drrs) {
  const CameraGeometry& camera = benchmark_case.view().camera;
  const Eigen::Vector3d isocenter_ct = benchmark_case.frame().center_ct_mm;
  std::ostringstream text;
  text << std::setprecision(17) << "OMP_NUM_THREADS=1 plastimatch drr -i exact -A cpu -P none"
       << " -y " << angle_rad << " -N 0 -a " << drrs << " -o '" << isocenter_ct.x() << ' '
       << isocenter_ct.y() << ' ' << isocenter_ct.z() << "' --sad "
       << camera.depth_mm(benchmark_case.frame().center_room_mm) << " --sid "
       << camera.source_detector_distance_mm() << " -r '" << camera.size_px.y() << ' '
       << camera.size_px.x() << "' -z '" << camera.size_px.y() * camera.pixel_spacing_mm.y() << ' '
       << camera.size_px.x() * camera.pixel_spacing_mm.x() << "' -t pfm -O '"
       << (folder / "plastimatch-").string() << "' '" << (folder / "ct.mha").string() << "'";
  return text.str();
}

}  // namespace

std::optional<PlastimatchDrr> PlastimatchDrr::prepare(const BenchmarkCase& benchmark_case,
                                                      const std::filesystem::path& folder,
                                                      int drrs_per_call) {
  const auto angle_rad =
      gantry_angle_rad(benchmark_case.view().camera, benchmark_case.frame().center_room_mm);
  const test::ProgramRun version = test::run_command("plastimatch --version");
  if (version.exit_code != 0 || !angle_rad.has_value()) return std::nullopt;
  std::filesystem::create_directories(folder);
  write_ct(relative_attenuation_of(benchmark_case), folder / "ct.mha");
  PlastimatchDrr drr;
  drr.folder_ = folder;
  drr.command_ = drr_command(benchmark_case, *angle_rad, folder, drrs_per_call);
  drr.version_ = version.output.substr(0, version.output.find('\n'));
  drr.pixels_ = benchmark_case.view().pixel_count();
  drr.drrs_per_call_ = drrs_per_call;
  return drr;
}

double PlastimatchDrr::run() const {
  const test::ProgramRun run = test::run_command(command_);
  if (run.exit_code != 0) throw FileError("plastimatch", "failed: " + run.output);
  return seconds_after(run.output, "Total time: ") - seconds_after(run.output, "I/O time: ");
}

std::vector<float> PlastimatchDrr::image() const {
  const std::filesystem::path path = folder_ / "plastimatch-0000.pfm";
  std::ifstream file(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  std::vector<float> image(pixels_);
  const std::size_t image_bytes = pixels_ * sizeof(float);
  if (bytes.size() < image_bytes) throw FileError(path.string(), "is not the PFM image asked for");
  std::memcpy(image.data(), bytes.data() + (bytes.size() - image_bytes), image_bytes);
  return image;
}

}  // namespace af::benchmark
