# SPDX-License-Identifier: Apache-2.0
import attenuation_fields as af
import numpy as np

case = af.RegistrationCase.load("head/study.toml", renderer="raycast")
found = case.run()
print(f"{found.verdict}: {found.initial_tre_mm:.1f} mm off at the start, {found.tre_mm:.2f} mm at the end")
view = case.views[0]
caster = af.RayCaster(af.Ct.read("head/ct.nii.gz"), view.camera)
before, after = (view.xray - caster.drr(pose=pose) for pose in (found.start, found.pose))
picture = np.clip(40 * np.hstack([view.xray, before + 3, after + 3]), 0, 255).astype(np.uint8)
open("registered.pgm", "wb").write(b"P5 %d %d 255\n" % picture.shape[::-1] + picture.tobytes())
