# SPDX-License-Identifier: Apache-2.0
"""2D-3D registration with attenuation fields: DRRs, their derivatives, registration, evaluation.

Lengths are mm, angles degrees. Frames: ct (DICOM LPS), room (fixed to the X-ray cameras), detector
(column, row). A pose is a 4x4 matrix room_from_ct. python/README.md is the guide.
"""

from attenuation_fields.errors import Error, FileError, InputError, NumericError
from attenuation_fields._core import (
    Camera,
    CaseView,
    Ct,
    Field,
    PoseFrame,
    PoseMode,
    RayCaster,
    Registration,
    RegistrationCase,
    Renderer,
    Rig,
    SuccessRate,
    Table,
    Uncertainty,
    ViewAgreement,
    mean_tre_mm,
    preset_names,
    psnr_db,
    read_pose,
    success_rate,
)
from attenuation_fields._core import version as _version
from attenuation_fields.results import (
    Result,
    ray_cast,
    read_image_quality,
    read_registrations,
    read_result,
    register,
)

__version__: str = _version()

__all__ = [
    "Camera",
    "CaseView",
    "Ct",
    "Error",
    "Field",
    "FileError",
    "InputError",
    "NumericError",
    "PoseFrame",
    "PoseMode",
    "RayCaster",
    "Registration",
    "RegistrationCase",
    "Renderer",
    "Result",
    "Rig",
    "SuccessRate",
    "Table",
    "Uncertainty",
    "ViewAgreement",
    "mean_tre_mm",
    "preset_names",
    "psnr_db",
    "ray_cast",
    "read_image_quality",
    "read_pose",
    "read_registrations",
    "read_result",
    "register",
    "success_rate",
]
