# SPDX-License-Identifier: Apache-2.0
"""The arguments of DiffDRR's DRR(subject, sdd, ...) and drr(rotation, translation, ...), as TOML. They are those of its
commit 799ca1e; docs/poses.md says what is known about its releases. DiffDRR's world has RAS axes about the middle of the
volume. In its camera's frame the source is at the origin, the beam runs along +z, x against the columns and y against the
rows."""
import math
from dataclasses import dataclass

import numpy as np

from .geometry import Camera, about, inverse, quaternion_rotation, rigid, transform
from .rig import StatedCamera, StatedRig, require
from .source import toml_numbers, toml_text
from .toml_table import Table, parse_toml

CAMERA_TABLE = "diffdrr_camera"
POSE_KEY = "diffdrr_parameterization"
# World from camera before any turn.
ORIENTATIONS = {"AP": [[1, 0, 0], [0, 0, -1], [0, 1, 0]], "PA": [[-1, 0, 0], [0, 0, 1], [0, 1, 0]], "none": np.eye(3)}


@dataclass
class Frame:
    """How to interpret the numbers of a pose."""
    parameterization: str = "euler_angles"  # or "quaternion" (real part first)
    convention: str = "ZXY"  # of Euler angles
    orientation: str = "AP"  # DiffDRR's Subject has it: "AP", "PA" or "none"

    @staticmethod
    def of(table, parameterization_key):
        frame = Frame(table.text(parameterization_key, "euler_angles"), table.text("convention", "ZXY"),
                      table.text("orientation", "AP"))
        if frame.parameterization not in ("euler_angles", "quaternion"):
            table.fail(parameterization_key, 'must be "euler_angles" or "quaternion"')
        letters = frame.convention
        if len(letters) != 3 or set(letters) - set("XYZ") or letters[0] == letters[1] or letters[1] == letters[2]:
            table.fail("convention", "must be three of X, Y and Z, neighbours different")
        if frame.orientation not in ORIENTATIONS:
            table.fail("orientation", 'must be "AP", "PA" or "none"')
        return frame

    @property
    def count(self):
        return 4 if self.parameterization == "quaternion" else 3

    def world_from_camera(self, rotation, translation, place):
        """World from camera: x -> R (R0 x + t). R0 turns the camera to its orientation."""
        if self.parameterization == "quaternion":
            require(abs(np.linalg.norm(rotation) - 1) <= 1e-5, f"{place}: rotation must be a quaternion of norm 1, real part first")
            turn = quaternion_rotation(*rotation)
        else:
            turn = np.linalg.multi_dot([about("XYZ".index(letter), angle) for letter, angle in zip(self.convention, rotation)])
        return transform(turn @ ORIENTATIONS[self.orientation], turn @ translation)

    def numbers_of(self, world_from_camera):
        """The angles and the translation that put the camera there."""
        turn = world_from_camera[:3, :3] @ np.transpose(ORIENTATIONS[self.orientation])
        return angles_of_convention(turn, self.convention), turn.T @ world_from_camera[:3, 3]


def angles_of_convention(rotation, convention):
    """The angles of R = R_a(angle 0) R_b(angle 1) R_c(angle 2), where a, b and c are the letters, all different. The first
    angle is taken off, and the other two are found from what remains. So a first angle that is poorly known at gimbal lock
    costs no accuracy."""
    a, b, c = ("XYZ".index(letter) for letter in convention)
    sign = 1 if (b - a + 3) % 3 == 1 else -1
    is_locked = math.hypot(rotation[b, c], rotation[c, c]) < 1e-15
    first = 0.0 if is_locked else math.atan2(-sign * rotation[b, c], rotation[c, c])
    rest = about(a, first).T @ rotation
    return np.array([first, math.atan2(sign * rest[a, c], rest[c, c]), math.atan2(sign * rest[b, a], rest[b, b])])


def world_from_lps(middle_mm):
    axes = np.diag([-1.0, -1.0, 1.0])
    return transform(axes, -axes @ middle_mm)


def room_from_camera(camera):
    """Its x runs against the columns (reverse_x_axis=True, the default), or along them for a mirrored camera (False)."""
    column = camera.column_direction if camera.is_mirrored else -camera.column_direction
    return transform(np.column_stack([column, -camera.row_direction, camera.beam_direction]), camera.source_point)


def is_diffdrr_camera(source):
    return source.has_line(f"[[{CAMERA_TABLE}]]")


def read_diffdrr_camera(source, options):
    table = Table(parse_toml(source), f"{source.name}: ")
    middle = table.vector("volume_middle_ct_mm", 3, None)
    room_from_world = inverse(world_from_lps(np.zeros(3) if middle is None else middle))
    stated = StatedRig(isocenter_point=room_from_world[:3, 3], file=source.name)
    for camera in table.tables(CAMERA_TABLE):
        name = camera.text("name", None)
        stated.cameras.append(StatedCamera(_camera(camera, room_from_world, name or ""), has_name=name is not None))
        camera.refuse_unknown()
    table.refuse_unknown()
    if middle is None:
        stated.notes.append(f"{source.name}: the room's origin is the middle of DiffDRR's volume, its axes are LPS: "
                            "nominal_room_from_ct moves the CT's middle there (volume_middle_ct_mm in the file makes the room the "
                            "CT's frame)")
    return stated


def _camera(table, room_from_world, name):
    def positive(key, *default):
        value = table.number(key, *default)
        if not value > 0:
            table.fail(key, "must be above 0")
        return value
    sdd, rows = positive("sdd"), table.integer("height", 1, 32768)
    columns, delx = table.integer("width", 1, 32768, rows), positive("delx")
    spacing = np.array([delx, positive("dely", delx)])
    x0, y0, reverses_x = table.number("x0", 0.0), table.number("y0", 0.0), table.get("reverse_x_axis", True)
    if not isinstance(reverses_x, bool):
        table.fail("reverse_x_axis", "must be true or false")
    frame = Frame.of(table, "parameterization")
    rotation, translation = table.vector("rotation", frame.count), table.vector("translation", 3)
    pose = room_from_world @ frame.world_from_camera(rotation, translation, table.place.rstrip("."))
    column = (-1 if reverses_x else 1) * pose[:3, 0]
    row = -pose[:3, 1]
    size = np.array([columns, rows])
    middle_mm = 0.5 * (size - 1) * spacing
    origin = (pose @ [x0, y0, sdd, 1])[:3] - middle_mm[0] * column - middle_mm[1] * row
    return Camera(name, pose[:3, 3], origin, column, row, spacing, size)


def write_diffdrr_camera(rig):
    text = ("# DRR(subject, sdd, height, delx, width, dely, x0, y0, reverse_x_axis=...) and\n"
            "# drr(rotation, translation, parameterization=..., convention=...); DiffDRR 0.4 or later.\n"
            f"volume_middle_ct_mm = {toml_numbers(rig.isocenter_point)}\n")
    frame = Frame()
    for camera in rig.cameras:
        pose = room_from_camera(camera)
        angles, translation = frame.numbers_of(world_from_lps(rig.isocenter_point) @ pose)
        middle = inverse(pose) @ np.append(camera.detector_point(*camera.middle_px()), 1)
        text += (f"\n[[{CAMERA_TABLE}]]\nname = {toml_text(camera.name)}\nsdd = {float(camera.source_detector_mm)!r}\n"
                 f"height = {camera.size_px[1]}\nwidth = {camera.size_px[0]}\ndelx = {float(camera.pixel_spacing_mm[0])!r}\n"
                 f"dely = {float(camera.pixel_spacing_mm[1])!r}\nx0 = {float(middle[0])!r}\ny0 = {float(middle[1])!r}\n"
                 f"reverse_x_axis = {'false' if camera.is_mirrored else 'true'}\norientation = {toml_text(frame.orientation)}\n"
                 f'parameterization = "euler_angles"\nconvention = {toml_text(frame.convention)}\n'
                 f"rotation = {toml_numbers(angles)}\ntranslation = {toml_numbers(translation)}\n")
    return text


def is_diffdrr_pose(source):
    return source.has_line(POSE_KEY)


def _only_camera(rig, name, place):
    """The only camera that a pose can mean. It is not mirrored: reverse_x_axis=False is nothing that a pose states."""
    require(name or len(rig.cameras) == 1, f"{place}: names no camera, and the rig has several; choose one with --camera")
    camera = rig.camera(name) if name else rig.cameras[0]
    require(not camera.is_mirrored, f"camera = {camera.name}: must not be mirrored: DiffDRR's cameras are not")
    return camera


def read_diffdrr_pose(source, context):
    table = Table(parse_toml(source), f"{source.name}: ")
    table.get(POSE_KEY)
    frame = Frame.of(table, POSE_KEY)
    rotations = table.matrix("rotation" if frame.count == 4 else "rotation_rad", None, frame.count)
    translations = table.matrix("translation_mm", None, 3)
    middle, camera = table.vector("volume_middle_ct_mm", 3, None), table.text("camera", "")
    if len(rotations) != len(translations):
        table.fail("translation_mm", "must have as many rows as the rotations")
    table.refuse_unknown()
    camera = _only_camera(context.rig(f"{source.name}: a DiffDRR pose is relative to a camera"), camera, source.name)
    if middle is None:
        middle = context.ct_grid(f"{source.name}: a DiffDRR pose is about the middle of the CT; state volume_middle_ct_mm, "
                                 "or give the CT").middle_mm
    poses = []
    for i, (rotation, translation) in enumerate(zip(rotations, translations), 1):
        place = f"{source.name}: pose {i}"
        camera_from_world = inverse(frame.world_from_camera(rotation, translation, place))
        poses.append((i, rigid(room_from_camera(camera) @ camera_from_world @ world_from_lps(middle), place)))
    return poses, []


def write_diffdrr_pose(poses, context):
    camera = _only_camera(context.rig("a DiffDRR pose is relative to a camera"), "", "diffdrr")
    middle = context.ct_grid("a DiffDRR pose is about the middle of the CT").middle_mm
    frame = Frame()
    numbers = [frame.numbers_of(world_from_lps(middle) @ inverse(pose) @ room_from_camera(camera)) for pose in poses]
    return ("# drr(rotation_rad, translation_mm, parameterization=\"euler_angles\", convention=\"ZXY\"),\n"
            "# of a Subject read with orientation=\"AP\" and center_volume=True; older releases of DiffDRR than 0.4.0 mean another "
            f'pose.\n{POSE_KEY} = "euler_angles"\nconvention = "{frame.convention}"\norientation = "{frame.orientation}"\n'
            f"camera = {toml_text(camera.name)}\nvolume_middle_ct_mm = {toml_numbers(middle)}\n"
            f"rotation_rad = [{', '.join(toml_numbers(angles) for angles, _ in numbers)}]\n"
            f"translation_mm = [{', '.join(toml_numbers(translation) for _, translation in numbers)}]\n")
