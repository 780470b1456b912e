# SPDX-License-Identifier: Apache-2.0
# %% [markdown]
# DRRs looked up in a field beside the same DRRs cast through the CT.
#
#     python3 02_look_up.py FIELD.af.h5 CT

# %%
import sys
from time import perf_counter

import matplotlib.pyplot as plt
import numpy as np

import attenuation_fields as af

field = af.Field.open(sys.argv[1])
ct = af.Ct.read(sys.argv[2])
print(f"camera {field.camera.name}: {field.shape[1]} x {field.shape[0]} pixels, looked up {field.look_up}")
print(f"poses within {field.max_rotation_deg:.1f} deg and {field.max_translation_mm:.1f} mm")

# %% [markdown]
# A field belongs to one CT. The ray caster takes the field's frame and attenuation, so that both see
# the same thing.

# %%
if not field.is_of(ct):
    sys.exit("this CT is not the one that the field was made from")
caster = af.RayCaster(
    ct, field.camera, frame=field.frame, water_mu_per_mm=field.water_mu_per_mm, step_mm=0.5
)

# %% [markdown]
# Twenty poses, uniform in a quarter of the field's range.

# %%
random = np.random.default_rng(1)
limits = np.repeat([field.max_rotation_deg, field.max_translation_mm], 3)
parameters = random.uniform(-0.25, 0.25, (20, 6)) * limits
start = perf_counter()
looked_up = field.drrs(parameters)
middle = perf_counter()
cast = caster.drrs(parameters)
end = perf_counter()
psnr_db = np.array([af.psnr_db(a, b) for a, b in zip(looked_up, cast)])
print(f"PSNR {np.median(psnr_db):.1f} dB (median of {len(psnr_db)}), lowest {psnr_db.min():.1f} dB")
print(f"looking up took {1000 * (middle - start) / 20:.2f} ms each, casting {1000 * (end - middle) / 20:.1f} ms")

# %% [markdown]
# The derivatives say how the image changes per degree and per mm.

# %%
drr, gradient = field.drr_and_gradient(parameters[0, :3], parameters[0, 3:])
for name, plane in zip(("rx", "ry", "rz", "tx", "ty", "tz"), gradient):
    print(f"  d/d{name}: {plane.min():+.3f} to {plane.max():+.3f}")

# %%
difference = looked_up[0] - cast[0]
largest = np.abs(difference).max()
figure, axes = plt.subplots(1, 3, figsize=(7.2, 2.8))
axes[0].imshow(looked_up[0], cmap="gray")
axes[0].set_title("looked up")
axes[1].imshow(cast[0], cmap="gray")
axes[1].set_title("cast")
axes[2].imshow(difference, cmap="RdBu", vmin=-largest, vmax=largest)
axes[2].set_title(f"difference, within {largest:.2f}")
for panel in axes:
    panel.axis("off")
figure.savefig("looked-up.png", bbox_inches="tight")
