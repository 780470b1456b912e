// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "benchmark/benchmark_case.h"

namespace af::benchmark {

/// `plastimatch drr`, exact mode (Siddon), one thread, on the case's CT and camera at the nominal
/// pose. Its own clock counts, over several equal DRRs of one call: "Total time" less "I/O time",
/// which leaves out reading the CT.
class PlastimatchDrr {
 public:
  /// nullopt when plastimatch is not installed or its gantry cannot take the camera, which must
  /// turn about z, aim at the isocentre and have it at its centre. Writes the CT's attenuation into
  /// `folder`.
  static std::optional<PlastimatchDrr> prepare(const BenchmarkCase& benchmark_case,
                                               const std::filesystem::path& folder,
                                               int drrs_per_call);

  /// Seconds of drrs_per_call DRRs. FileError when its output is not understood.
  [[nodiscard]] double run() const;
  /// The latest DRR, row-major, in plastimatch's own unit of attenuation.
  [[nodiscard]] std::vector<float> image() const;
  [[nodiscard]] int drrs_per_call() const { return drrs_per_call_; }
  [[nodiscard]] const std::string& command() const { return command_; }
  [[nodiscard]] const std::string& version() const { return version_; }

 private:
  std::filesystem::path folder_;
  std::string command_;
  std::string version_;
  std::size_t pixels_ = 0;
  int drrs_per_call_ = 1;
};

}  // namespace af::benchmark
