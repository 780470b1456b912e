// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "base/thread_pool.h"
#include "scan/self_calibration.h"
#include "tools/scan/scan_file.h"

namespace af::tools {

/// Reads every view of a scan and turns it into line integrals. Images are binned until their
/// larger side has at most `most_px`. InputError when a file has another size than the scan states
/// or when there are more files than views; FileError when one is missing or damaged.
ScanImages read_scan_images(const ScanFile& file,
                            const std::filesystem::path& folder,
                            int most_px,
                            ThreadPool& pool);

}  // namespace af::tools
