# SPDX-License-Identifier: Apache-2.0
"""Tables of all formats of cameras and of poses; content tells files apart. docs/cameras.md and docs/poses.md describe
them."""
from collections.abc import Callable
from dataclasses import dataclass

from af_programs.errors import FileError, InputError

from . import (autoscoper, diffdrr, dicom_camera, elastix, itk, matrices, mayacam, opencv, own_poses, plastimatch, rad,
               registration, rig_toml, rtk, xreg)
from .rig import Rig, completed_rig, require
from .source import Source


@dataclass(frozen=True)
class Format:
    name: str
    is_this: Callable  # (source) -> bool
    read: Callable  # cameras: (source, options) -> StatedRig; poses: (source, context) -> [(number from 1, 4x4)], notes
    write: Callable = None  # cameras: (rig); poses: (poses, context) -> text or bytes
    holds_one: bool = True  # camera per file, or pose
    states_distortion: bool = False


CAMERAS = (
    Format("rig", rig_toml.is_rig_toml, rig_toml.read_rig_toml, rig_toml.write_rig_toml, False, True),
    Format("mayacam2", mayacam.is_mayacam2, mayacam.read_mayacam2, mayacam.write_mayacam2),
    Format("mayacam1", mayacam.is_mayacam1, mayacam.read_mayacam1, mayacam.write_mayacam1),
    Format("opencv", opencv.is_opencv, opencv.read_opencv, opencv.write_opencv, True, True),
    Format("rtk", rtk.is_rtk, rtk.read_rtk, rtk.write_rtk, False),
    Format("plastimatch", plastimatch.is_plastimatch, plastimatch.read_plastimatch, plastimatch.write_plastimatch),
    Format("plastimatch-command", plastimatch.is_plastimatch_command, plastimatch.read_plastimatch_command),
    Format("elastix", elastix.is_elastix, elastix.read_elastix, elastix.write_elastix),
    Format("xreg", xreg.is_xreg, xreg.read_xreg, xreg.write_xreg, False),
    Format("rad", rad.is_rad, rad.read_rad, rad.write_rad),
    Format("diffdrr", diffdrr.is_diffdrr_camera, diffdrr.read_diffdrr_camera, diffdrr.write_diffdrr_camera, False),
    Format("dicom", dicom_camera.is_dicom_camera, dicom_camera.read_dicom_camera),
    Format("matrix", matrices.is_matrix_text, matrices.read_matrix_text, matrices.write_matrix_text, False),
)
POSES = (
    Format("itk-hdf5", itk.is_itk_hdf5, itk.read_itk_hdf5, itk.write_itk_hdf5),
    Format("dicom", registration.is_registration, registration.read_registration, registration.write_registration),
    Format("itk", itk.is_itk_text, itk.read_itk_text, itk.write_itk_text),
    Format("json", own_poses.is_json, own_poses.read_json),
    Format("diffdrr", diffdrr.is_diffdrr_pose, diffdrr.read_diffdrr_pose, diffdrr.write_diffdrr_pose, False),
    Format("toml", own_poses.is_toml, own_poses.read_toml, own_poses.write_toml),
    Format("csv", own_poses.is_csv, own_poses.read_csv, own_poses.write_csv, False),
    Format("autoscoper", autoscoper.is_autoscoper, autoscoper.read_autoscoper, autoscoper.write_autoscoper, False),
    Format("matrix", own_poses.is_plain, own_poses.read_plain, own_poses.write_plain),
)


def written(formats):
    return [one.name for one in formats if one.write is not None]


def recognised(source, formats, name=None):
    """The format that fits a file's content, or None. `name` chooses among several that fit."""
    named = [one for one in formats if one.name == name] if name else list(formats)
    found = next((one for one in named if one.is_this(source)), None)
    return named[0] if found is None and name and len(named) == 1 else found


def read_rig(paths, options, name=None):
    """The rig of all cameras in several files, each in any format, and warnings."""
    stated = []
    for path in paths:
        source = Source(path)
        found = recognised(source, CAMERAS, name)
        if found is None:
            raise FileError(f"{path}: states no camera in a known format; tried: " + ", ".join(one.name for one in CAMERAS))
        stated.append(found.read(source, options))
    return completed_rig(stated, options)


def rig_files(rig, name, path):
    """[(path, text or bytes)]. There is one file, unless the format holds one camera per file and the rig has several. Then
    there is one per camera, with the camera's name before the extension."""
    found = next(one for one in CAMERAS if one.name == name)
    for camera in rig.cameras:
        require(found.states_distortion or not camera.distortion.any(),
                f"--to = {name}: cannot state the distortion of camera '{camera.name}'; those that can: " +
                ", ".join(one.name for one in CAMERAS if one.states_distortion))
    if not found.holds_one or len(rig.cameras) == 1:
        return [(path, found.write(rig))]
    return [(path.with_name(f"{path.stem}-{camera.name}{path.suffix}"), found.write(Rig(rig.isocenter_point, [camera])))
            for camera in rig.cameras]


def read_poses(path, context, name=None):
    source = Source(path)
    found = recognised(source, POSES, name)
    if found is None:
        raise FileError(f"{path}: holds no pose of a known format (" + ", ".join(one.name for one in POSES) + ")")
    poses, notes = found.read(source, context)
    if not poses:
        raise InputError(f"{path}: holds no pose")
    return poses, notes


def pose_file(poses, name, context):
    """The text or bytes of a file that holds `poses`, [(number, 4x4)]."""
    found = next(one for one in POSES if one.name == name)
    numbers, matrices_ = [number for number, _ in poses], [pose for _, pose in poses]
    require(not found.holds_one or len(poses) == 1, f"number of poses = {len(poses)}: must be 1 for the format {name}")
    return found.write(matrices_, context, numbers) if name == "csv" else found.write(matrices_, context)
