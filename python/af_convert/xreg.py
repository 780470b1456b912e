# SPDX-License-Identifier: Apache-2.0
"""Cameras of xReg in HDF5: its projection data (groups proj-000, proj-001 ... with a group cam each), a camera alone, and
the group proj-params of the DeepFluoro data set. `extrinsic` takes world mm to the camera's frame, and `intrinsic` takes
that frame to pixels. cam-coord-frame-type says which frame it is. Either the source is at the origin and the detector at +z
or at -z (as in DeepFluoro), or the origin is on the detector and the source at +z."""
import numpy as np

from af_programs.errors import FileError, shown

from . import hdf5
from .geometry import camera_from_pinhole, pinhole_of, rigid, transform
from .rig import StatedCamera, StatedRig, require
from .source import size_of

FRAMES = ("origin-at-focal-pt-det-pos-z", "origin-at-focal-pt-det-neg-z", "origin-on-det")
FRAME_TYPE = "cam-coord-frame-type"
NAME, ISOCENTER = "camera-name", "isocenter-point"  # this project's own
MOST_PROJECTIONS = 10000
HALF_TURN = np.diag([-1.0, 1.0, -1.0])  # about the rows' axis


def _groups(file):
    groups = [""]
    if "proj-params" in file:
        groups.append("/proj-params")
    elif "num-projs" in file:
        count = file["num-projs"][()]
        if np.size(count) == 1 and 1 <= np.ravel(count)[0] <= MOST_PROJECTIONS:
            groups += [f"/proj-{i:03d}/cam" for i in range(int(np.ravel(count)[0])) if f"proj-{i:03d}/cam" in file]
    return groups


def is_xreg(source):
    if not hdf5.is_hdf5(source):
        return False
    try:
        top = hdf5.datasets(source, lambda file: [""])[""]
    except FileError:
        return False
    return "proj-params" in top or "num-projs" in top or FRAME_TYPE in top


def read_xreg(source, options):
    if not hdf5.is_hdf5(source):
        raise FileError(f"{source.name}: is no HDF5 file")
    groups = hdf5.datasets(source, _groups)
    stated = StatedRig(file=source.name)
    if "/proj-params" in groups:
        names = ["/proj-params"]
    elif "num-projs" in groups[""]:
        count = _numbers(source, groups, "", "num-projs", 1)[0]
        require(1 <= count <= MOST_PROJECTIONS and count == int(count),
                f"{source.name}: /num-projs = {count:g}: must be a whole number between 1 and {MOST_PROJECTIONS}")
        names = [f"/proj-{i:03d}/cam" for i in range(int(count))]
    else:
        names = [""]
    for name in names:
        stated.cameras.append(_camera(source, groups, name, stated.notes))
    if ISOCENTER in groups[""]:
        stated.isocenter_point = _numbers(source, groups, "", ISOCENTER, 3)
    return stated


def _numbers(source, groups, group, name, count, extents=None):
    place = f"{source.name}: {group}/{name}"
    if name not in groups.get(group, {}):
        raise FileError(f"{source.name}: has no {group}/{name}")
    value = groups[group][name]
    if not isinstance(value, list) or len(value[1]) != count or (extents and value[0] != extents):
        raise FileError(f"{place}: is no " + ("matrix of {} x {}".format(*extents) if extents else f"{count} number(s)"))
    require(np.all(np.isfinite(value[1])), f"{place}: must be finite")
    return np.array(value[1])


def _camera(source, groups, group, notes):
    prefix = "pixel-" if group == "/proj-params" else ""

    def place(name):
        return f"{source.name}: {group}/{name}"

    def scalar(name):
        return _numbers(source, groups, group, name, 1)[0]
    k = _numbers(source, groups, group, "intrinsic", 9, [3, 3]).reshape(3, 3)
    extrinsic = _numbers(source, groups, group, "extrinsic", 16, [4, 4]).reshape(4, 4)
    rigid(extrinsic, place("extrinsic"))
    size = size_of([scalar("num-cols"), scalar("num-rows")], place("num-cols and num-rows"))
    spacing = np.array([scalar(prefix + "col-spacing"), scalar(prefix + "row-spacing")])
    require(spacing.min() > 0, place(prefix + "col-spacing") + ": spacings must be above 0")
    frame = groups[group].get(FRAME_TYPE, FRAMES[1])
    require(frame in FRAMES, f"{place(FRAME_TYPE)} = '{shown(str(frame))}': must be one of " + ", ".join(FRAMES))
    # z runs along the beam and the source is at the origin. For a point x in xReg's frame y = HALF_TURN x has its depth in
    # z, and x_0 / z = y_0 / y_2 where z = x_2 and -y_0 / y_2 where z = focal length - x_2.
    rotation, translation, k = extrinsic[:3, :3], extrinsic[:3, 3], k.copy()
    if frame != FRAMES[0]:
        rotation, translation = HALF_TURN @ rotation, HALF_TURN @ translation
    if frame == FRAMES[1]:
        k[:, 1] *= -1
    if frame == FRAMES[2]:
        translation[2] += np.mean(np.abs(np.diag(k)[:2]) * spacing)
        k[:, 0] *= -1
    name = groups[group].get(NAME)
    camera = camera_from_pinhole(name if isinstance(name, str) else group, k, rotation, translation, spacing[0], size)
    require(abs(camera.pixel_spacing_mm[1] - spacing[1]) <= 1e-2 * spacing[1],
            f"{place(prefix + 'row-spacing')} = {spacing[1]}: must agree with the intrinsic matrix and the spacing of columns: "
            f"{camera.pixel_spacing_mm[1]:g} mm")
    known = {"intrinsic", "extrinsic", "num-cols", "num-rows", prefix + "col-spacing", prefix + "row-spacing", FRAME_TYPE, NAME,
             ISOCENTER}
    if unread := [shown(key) for key in groups[group] if key not in known]:
        notes.append(place(", ".join(unread)) + ": not read")
    return StatedCamera(camera, has_name=isinstance(name, str))


def write_xreg(rig):
    def fill(file):
        file.attrs["xreg-type"] = np.bytes_("proj-data")
        file["num-projs"] = np.uint64(len(rig.cameras))
        file[ISOCENTER] = rig.isocenter_point
        for i, camera in enumerate(rig.cameras):
            k, rotation, translation = pinhole_of(camera)
            if camera.is_mirrored:
                k[:, 1] *= -1
                rotation, translation = HALF_TURN @ rotation, HALF_TURN @ translation
            group = file.create_group(f"proj-{i:03d}/cam")
            group.attrs["xreg-type"] = np.bytes_("cam-model")
            group[NAME] = np.bytes_(camera.name.encode())
            group["num-rows"], group["num-cols"] = np.uint64(camera.size_px[1]), np.uint64(camera.size_px[0])
            group["row-spacing"], group["col-spacing"] = camera.pixel_spacing_mm[1], camera.pixel_spacing_mm[0]
            group[FRAME_TYPE] = np.bytes_(FRAMES[1 if camera.is_mirrored else 0])
            group["intrinsic"], group["extrinsic"] = k, transform(rotation, translation)
    return hdf5.file_bytes(fill)
