# SPDX-License-Identifier: Apache-2.0
# %% [markdown]
# Success rates and errors from the tables that the programs write.
#
#     python3 evaluate_results.py registrations.csv [image-quality.csv]

# %%
import sys

import numpy as np

import attenuation_fields as af

rows = af.read_registrations(sys.argv[1])
print(f"{len(rows['case'])} registrations of {len(set(rows['case']))} cases")

# %% [markdown]
# The paper's success: a target registration error below 2.5 mm, by 2 mm of initial error.

# %%
for renderer in sorted(set(rows["renderer"])):
    chosen = rows["renderer"] == renderer
    all_starts = af.success_rate(rows["tre_mm"][chosen])
    print(
        f"{renderer}: {all_starts.successes} of {all_starts.trials} succeed, "
        f"{100 * all_starts.low:.0f} to {100 * all_starts.high:.0f} %"
    )
    initial_mm = rows["initial_tre_mm"]
    for low_mm in np.arange(0.0, np.nanmax(initial_mm[chosen]), 2.0):
        of_interval = chosen & (initial_mm >= low_mm) & (initial_mm < low_mm + 2.0)
        if of_interval.any():
            rate = af.success_rate(rows["tre_mm"][of_interval])
            print(f"  {low_mm:4.0f} mm: {rate.successes} of {rate.trials}")
    successes_mm = rows["tre_mm"][chosen & (rows["tre_mm"] < 2.5)]
    if successes_mm.size > 0:
        print(f"  median TRE of successes {np.median(successes_mm):.3f} mm")

# %%
if len(sys.argv) > 2:
    quality = af.read_image_quality(sys.argv[2])
    print(f"PSNR {np.median(quality['psnr_db']):.1f} dB, median of {len(quality['psnr_db'])} DRRs")
