# SPDX-License-Identifier: Apache-2.0
# %% [markdown]
# Registers one case from several starts, by fields, and compares where they end.
#
#     python3 03_starts.py study.toml AP=AP.af.h5 LAT=LAT.af.h5

# %%
import sys

import matplotlib.pyplot as plt
import numpy as np

import attenuation_fields as af

study = sys.argv[1]
fields = {name: af.Field.open(path) for name, path in (word.split("=", 1) for word in sys.argv[2:])}
case = af.RegistrationCase.load(study, fields=fields)  # read once, for all starts

# %% [markdown]
# Eight starts, uniform in half of the fields' range. Fields of one case share its frame.

# %%
view = case.views[-1]
field = fields[view.camera.name]
limits = np.repeat([field.max_rotation_deg, field.max_translation_mm], 3)
starts = np.random.default_rng(1).uniform(-0.5, 0.5, (8, 6)) * limits
ends = case.run_all([case.frame.pose(start[:3], start[3:]) for start in starts])
for found in ends:
    confidence = found.uncertainty.confidence
    text = f"{found.verdict:9} right with {100 * confidence:5.1f} %, {1000 * found.seconds:3.0f} ms"
    if found.tre_mm is not None:  # the study states the true pose
        text += f": {found.initial_tre_mm:4.1f} mm off at the start, {found.tre_mm:.2f} mm at the end"
    print(text)
spread = np.ptp([found.parameters for found in ends], axis=0)
print(f"ends differ by at most {spread[:3].max():.3f} deg and {spread[3:].max():.3f} mm")

# %% [markdown]
# Outlines of the DRRs at all starts, and at all ends.

# %%
figure, axes = plt.subplots(1, 2, figsize=(5.6, 3))
for panel, title, poses in (
    (axes[0], "eight starts", [found.start for found in ends]),
    (axes[1], "their ends", [found.pose for found in ends]),
):
    panel.imshow(view.xray, cmap="gray")
    for pose in poses:
        drr = field.drr(pose=pose)
        panel.contour(drr, [0.3 * drr.max()], colors="orange", linewidths=0.8)
    panel.set_title(title)
    panel.axis("off")
figure.savefig("starts.png", bbox_inches="tight")
