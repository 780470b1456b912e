# SPDX-License-Identifier: Apache-2.0
"""study.toml from cameras, a CT and a pose. It has what the files say, and lines to fill in where they say nothing."""
import os

from .dicom_header import is_dicom
from .own_poses import write_toml
from .source import Source, toml_numbers, toml_text


def study_text(study, rig_name, rig, camera_files, ct, grid, pose):
    """The text of the file `study`. `camera_files` are also the X-rays if they are DICOM images, one per camera."""
    folder = os.path.dirname(os.path.abspath(study))

    def relative(path):
        return toml_text(os.path.relpath(os.path.abspath(path), folder))
    center = toml_numbers(grid.middle_mm)
    text = (f"rig = {toml_text(rig_name)}\n\n[[case]]\nname = {toml_text(os.path.basename(os.path.abspath(ct)).partition('.')[0])}\n"
            f"ct = {relative(ct)}\ncenter_ct_mm = {center}  # the CT's middle: TO BE STATED, the target's\n"
            f"target_box_ct_mm = [{center}, {center}]  # TO BE STATED: low and high corner of the target\n")
    if pose is not None:
        text += "nominal_" + write_toml([pose], None)
    are_xrays = len(camera_files) == len(rig.cameras) and all(is_dicom(Source(file)) for file in camera_files)
    for i, camera in enumerate(rig.cameras):
        xray = f"{relative(camera_files[i])}\n" if are_xrays else f"{toml_text(camera.name + '.mha')}  # TO BE STATED: the X-ray\n"
        text += f"\n[[case.view]]\ncamera = {toml_text(camera.name)}\nxray = {xray}xray_domain = \"intensity\"\n"
    return text
