# SPDX-License-Identifier: Apache-2.0
# %% [markdown]
# Success rates and errors from the tables that the programs write.
#
#     python3 04_success.py RUN/registrations.csv...

# %%
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import attenuation_fields as af

# %% [markdown]
# Success is the paper's, a target registration error below 2.5 mm, here by 4 mm of initial error.
# Bars are intervals of 95 %.

# %%
width_mm = 4.0
figure, axes = plt.subplots(figsize=(5.6, 2.8))
for number, path in enumerate(sys.argv[1:]):
    name = Path(path).parent.name
    rows = af.read_registrations(path)
    all_starts = af.success_rate(rows["tre_mm"])
    print(
        f"{name}: {all_starts.successes} of {all_starts.trials} succeed, "
        f"{100 * all_starts.low:.0f} to {100 * all_starts.high:.0f} %"
    )
    middles, rates = [], []
    initial_mm = rows["initial_tre_mm"]
    for low_mm in np.arange(0.0, np.nanmax(initial_mm), width_mm):
        of_interval = (initial_mm >= low_mm) & (initial_mm < low_mm + width_mm)
        if of_interval.any():
            rate = af.success_rate(rows["tre_mm"][of_interval])
            print(f"  {low_mm:4.0f} mm: {rate.successes} of {rate.trials}")
            middles.append(low_mm + width_mm / 2 + 0.3 * number)
            rates.append((rate.rate, rate.rate - rate.low, rate.high - rate.rate))
    rate, below, above = 100 * np.array(rates).T
    axes.errorbar(middles, rate, (below, above), marker="o", capsize=2, label=name)
    successes_mm = rows["tre_mm"][rows["tre_mm"] < 2.5]
    if successes_mm.size > 0:
        print(f"  median TRE of successes {np.median(successes_mm):.3f} mm")

# %%
axes.set(xlabel="initial TRE [mm]", ylabel="success [%]", ylim=(0, 105))
axes.legend(loc="lower left")
figure.savefig("success.png", bbox_inches="tight")
