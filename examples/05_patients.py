# SPDX-License-Identifier: Apache-2.0
# %% [markdown]
# Registers the first case of many studies, one process per patient, and tabulates what was found.
#
#     python3 05_patients.py PATIENT/study.toml...

# %%
import multiprocessing
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import matplotlib.pyplot as plt

import attenuation_fields as af


def register(study):
    """What was found, an X-ray, and the DRR of the bones; a text where nothing could be done."""
    try:
        case = af.RegistrationCase.load(study, renderer="raycast")
        found = case.run()
        ct = af.Ct.read(Path(study).with_name("ct.nii.gz"))  # af-simulate puts it there
    except af.Error as error:
        return str(error)
    hu = (ct.hu > 200) * (ct.hu + 1000) - 1000
    bones = af.Ct(hu, ct.spacing_mm, ct.origin_mm, ct.direction)
    view = case.views[0]
    caster = af.RayCaster(bones, view.camera)
    return found, view.xray, caster.drr(pose=found.pose)


# %% [markdown]
# A patient that fails is a line of the table, and ends nothing.

# %%
if __name__ == "__main__":
    context = multiprocessing.get_context("spawn")  # the same everywhere
    with ProcessPoolExecutor(mp_context=context) as processes:
        results = dict(zip(sys.argv[1:], processes.map(register, sys.argv[1:])))
    figure, axes = plt.subplots(1, len(results), figsize=(2.4 * len(results), 2.7), squeeze=False)
    for (study, result), panel in zip(results.items(), axes[0]):
        panel.axis("off")
        if isinstance(result, str):
            print(f"{study}: {result}")
            continue
        found, xray, drr = result
        print(f"{study}: {found.verdict}, right with {100 * found.uncertainty.confidence:.1f} %")
        panel.imshow(xray, cmap="gray")
        panel.contour(drr, [drr.max() / 4], colors="orange", linewidths=0.8)
        panel.set_title(f"{Path(study).parent.name}: {found.verdict}")
    figure.savefig("patients.png", bbox_inches="tight")
