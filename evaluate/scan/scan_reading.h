// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "base/thread_pool.h"
#include "evaluate/scan/scan_file.h"
#include "evaluate/scan/self_calibration.h"

namespace af::tools {

/// Receives a line about what was found, for people.
using ReportLine = std::function<void(const std::string&)>;

/// Reads every view of a scan and turns it into line integrals. Images are binned until their
/// larger side has at most `most_px`. `report` receives what the open beam was taken to be, and
/// warnings. Throws InputError when a file has another size than the scan states, when there are
/// more files than views, when a view was exposed differently from the rest, or when attenuation
/// does not hold line integrals. Throws FileError when a file is missing or damaged.
ScanImages read_scan_images(const ScanFile& file,
                            const std::filesystem::path& folder,
                            int most_px,
                            ThreadPool& pool,
                            const ReportLine& report);

}  // namespace af::tools
