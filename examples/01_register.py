# SPDX-License-Identifier: Apache-2.0
import attenuation_fields as af
import matplotlib.pyplot as plt

case = af.RegistrationCase.load("head/study.toml", renderer="raycast")
found = case.run()
print(f"{found.verdict}: {found.initial_tre_mm:.1f} mm off at the start, {found.tre_mm:.2f} mm at the end")
caster = af.RayCaster(af.Ct.read("head/ct.nii.gz"), case.views[0].camera)
for place, title, pose in ((121, "before", found.start), (122, "after", found.pose)):
    plt.subplot(place, title=title, xticks=[], yticks=[]).imshow(case.views[0].xray, cmap="gray")
    plt.contour(caster.drr(pose=pose), [1, 2.9], colors="orange", linewidths=1)
plt.savefig("registered.png", bbox_inches="tight")
