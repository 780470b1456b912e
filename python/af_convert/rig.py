# SPDX-License-Identifier: Apache-2.0
"""One rig from the cameras that files state, completed from the options."""
import copy
import pathlib
from dataclasses import dataclass, field

import numpy as np

from af_programs.errors import InputError

from .geometry import MOST_ROOM_MM, PLAUSIBLE_ROOM, Camera, camera_problems, vector_text, with_clean_axes, with_column_spacing

# Where the detector stands when only the rays are known: the magnification of a usual C-arm.
DEFAULT_MAGNIFICATION = 1.5


@dataclass
class Rig:
    isocenter_point: np.ndarray
    cameras: list

    def camera(self, name):
        for camera in self.cameras:
            if camera.name == name:
                return camera
        raise InputError(f"camera = {name}: the rig has only: " + ", ".join(camera.name for camera in self.cameras))


@dataclass
class StatedCamera:
    """A camera as a file states it. What it leaves open holds a placeholder."""
    camera: Camera
    has_name: bool = False
    has_size: bool = True
    has_spacing: bool = True  # otherwise the detector stands anywhere behind the source
    has_pixel_grid: bool = True  # otherwise its origin is the point (0, 0) mm of the detector and its spacing 1 mm
    knows_front: bool = True  # otherwise source and rays may point the wrong way


@dataclass
class StatedRig:
    cameras: list = field(default_factory=list)
    isocenter_point: np.ndarray = None
    notes: list = field(default_factory=list)
    file: str = ""


@dataclass
class RigOptions:
    """Settings that files leave open. None of them may contradict what a file states."""
    names: list = None
    size_px: list = None
    pixel_spacing_mm: list = None
    isocenter_point: list = None
    unit_mm: float = None
    detector_origin_mm: list = None
    source_detector_mm: float = None
    source_isocenter_mm: float = None
    positioner_deg: list = None
    flip: str = None


def name_problem(name):
    try:
        size = len(name.encode())
    except UnicodeEncodeError:
        return "must be UTF-8: a rig.toml could not state it"
    is_plain = (0 < size <= 100 and name not in (".", "..") and name[0] not in "=+-@" and
                not any(c in "/=" or ord(c) < 32 or ord(c) == 127 for c in name))
    return "" if is_plain else ("must be usable in a file name: at most 100 bytes, no '/' or control characters, no '+', '-' "
                                "or '@' in front, no '='")


def name_of_file(file):
    name = "".join("_" if ord(c) <= 32 or c in "=,\x7f" else c for c in pathlib.Path(file).stem[:90])
    return "camera" if name_problem(name) else name


def point_text(point):
    return ",".join(repr(float(value)) for value in point)


def nearest_point_of_central_rays(cameras):
    """The point with the least sum of squared distances. None where the rays are parallel to 1e-6."""
    total, moment = np.zeros((3, 3)), np.zeros(3)
    for camera in cameras:
        direction = camera.central_direction()
        across = np.eye(3) - np.outer(direction, direction)
        total += across
        moment += across @ camera.source_point
    if not np.all(np.isfinite(total)) or not np.linalg.eigvalsh(total)[0] > 1e-6:
        return None
    return np.linalg.solve(total, moment)


def completed_rig(stated, options):
    """The rig, and warnings that say what was assumed."""
    return _Completion(stated, options).run()


class _Completion:
    def __init__(self, stated, options):
        self.options = options
        self.cameras, self.files, self.notes = [], [], []
        self.isocenter, self.isocenter_file = None, ""
        for rig in stated:
            for i, one in enumerate(rig.cameras):
                one = copy.deepcopy(one)
                if not one.has_name:
                    one.camera.name = name_of_file(rig.file) + (f"-{i + 1}" if len(rig.cameras) > 1 else "")
                self.cameras.append(one)
                self.files.append(rig.file)
            self.notes += rig.notes
            if rig.isocenter_point is not None:
                self.set_isocenter(rig.isocenter_point, rig.file)
        if not self.cameras:
            raise InputError("the files hold no camera")

    def run(self):
        self.set_names()
        self.set_sizes()
        self.set_pixel_grids()
        self.set_units()
        self.find_isocenter()
        self.face_isocenter()
        self.set_spacings()
        self.flip_images()
        rig = Rig(self.isocenter, [stated.camera for stated in self.cameras])
        problems = [problem for camera in rig.cameras for problem in camera_problems(camera)]
        if not np.all(np.abs(rig.isocenter_point) <= MOST_ROOM_MM):
            problems.insert(0, f"isocenter_point = {vector_text(rig.isocenter_point)}: {PLAUSIBLE_ROOM}")
        names = [camera.name for camera in rig.cameras]
        problems += [f"camera name = {name}: must be unique within the rig" for name in sorted(set(names)) if names.count(name) > 1]
        if problems:
            raise InputError("\n".join(f"{self.files[0]}: {problem}" for problem in problems))
        rig.cameras = [with_clean_axes(camera) for camera in rig.cameras]
        for i, camera in enumerate(rig.cameras):
            if camera.is_mirrored:
                self.notes.append(f"{self.place(i)}: mirrored: column_direction x row_direction points against the beam, so "
                                  "its images show left and right swapped")
        return rig, self.notes

    def place(self, i):
        return f"{self.files[i]}: camera '{self.cameras[i].camera.name}'"

    def contradiction(self, option, given, stated, i):
        return InputError(f"{self.place(i)}: {option} = {given}: must agree with the file: {stated}")

    def set_isocenter(self, point, file):
        if self.isocenter is not None and not np.linalg.norm(point - self.isocenter) <= 1e-6:
            raise InputError(f"{file}: isocenter_point = {point_text(point)}: must be that of {self.isocenter_file}: "
                             f"{point_text(self.isocenter)}")
        self.isocenter, self.isocenter_file = np.array(point, dtype=float), file

    def set_names(self):
        names = self.options.names
        if names and len(names) != len(self.cameras):
            raise InputError(f"--rig-names = {len(names)} names: must be as many as there are cameras: {len(self.cameras)}")
        taken = set()
        for i, stated in enumerate(self.cameras):
            name = names[i] if names else stated.camera.name
            if problem := name_problem(name):
                raise InputError(f"{self.files[i]}: camera name = {name!a}: {problem}")
            stem, n = name, 2
            # Two files in two folders may have the same name. Names that somebody stated must differ.
            while name in taken and not stated.has_name and not names:
                name, n = f"{stem}-{n}", n + 1
            taken.add(name)
            stated.camera.name = name

    def set_sizes(self):
        given = self.options.size_px
        for i, stated in enumerate(self.cameras):
            if given is None and not stated.has_size:
                raise InputError(f"{self.place(i)}: the size of its images is not in the file: state it with --rig-size-px "
                                 "COLUMNS,ROWS")
            if given is None:
                continue
            if stated.has_size and list(stated.camera.size_px) != list(given):
                raise self.contradiction("--rig-size-px", f"{given[0]},{given[1]}", "{},{}".format(*stated.camera.size_px), i)
            stated.camera.size_px = np.array(given)

    def set_pixel_grids(self):
        options = self.options
        is_used = options.detector_origin_mm is None
        for i, stated in enumerate(self.cameras):
            if stated.has_pixel_grid:
                continue
            if options.pixel_spacing_mm is None:
                raise InputError(f"{self.place(i)}: the pixel spacing is not in the file: state it with "
                                 "--rig-pixel-spacing-mm COLUMN,ROW")
            camera = stated.camera
            camera.pixel_spacing_mm = np.array(options.pixel_spacing_mm)
            first_mm = -camera.middle_px() * camera.pixel_spacing_mm
            if options.detector_origin_mm is not None:
                first_mm, is_used = options.detector_origin_mm, True
            camera.detector_origin_point = (camera.detector_origin_point + first_mm[0] * camera.column_direction +
                                            first_mm[1] * camera.row_direction)
        if not is_used:
            raise InputError("--rig-detector-origin-mm: must not be given: the files state where the pixels are")

    def set_units(self):
        unit_mm = self.options.unit_mm
        if unit_mm is None:
            return
        for i, stated in enumerate(self.cameras):
            if stated.has_spacing:
                raise InputError(f"{self.place(i)}: --rig-unit-mm = {unit_mm}: must not be given: the file's lengths are mm")
            moved = (unit_mm - 1) * stated.camera.source_point
            stated.camera.source_point = stated.camera.source_point + moved
            stated.camera.detector_origin_point = stated.camera.detector_origin_point + moved
        if self.isocenter is not None:
            self.isocenter = self.isocenter * unit_mm

    def find_isocenter(self):
        if self.options.isocenter_point is not None:
            self.set_isocenter(np.array(self.options.isocenter_point), "--rig-isocenter-point")
        if self.isocenter is not None:
            return
        cameras = [stated.camera for stated in self.cameras]
        nearest = nearest_point_of_central_rays(cameras)
        if nearest is not None:
            self.isocenter = nearest
            self.notes.append(f"the isocentre is not in the files; taken as the point nearest to the {len(cameras)} central rays, "
                              f"({', '.join(f'{value:.2f}' for value in nearest)}) mm; --rig-isocenter-point states another")
            return
        camera = cameras[0]
        direction = camera.central_direction()
        along = -camera.source_point @ direction
        if len(cameras) > 1 or not (along > 1 or (not self.cameras[0].knows_front and along < -1)):
            raise InputError(f"{self.place(0)}: the isocentre is not in the file, and its only central ray does not pass the "
                             "room's origin: state it with --rig-isocenter-point X,Y,Z")
        self.isocenter = camera.source_point + along * direction
        self.notes.append("the isocentre is not in the file; taken as the point of the central ray nearest to the room's origin, "
                          f"({point_text(self.isocenter)}) mm; --rig-isocenter-point states another")

    def face_isocenter(self):
        for i, stated in enumerate(self.cameras):
            camera = stated.camera
            if camera.depth_mm(self.isocenter) > 0:
                continue
            if not stated.knows_front:  # keeps the lines of sight; source and detector change sides
                camera.detector_origin_point = 2 * camera.source_point - camera.detector_origin_point
                camera.column_direction, camera.row_direction = -camera.column_direction, -camera.row_direction
            if not camera.depth_mm(self.isocenter) > 0 and not stated.has_spacing:
                raise InputError(f"{self.place(i)}: isocenter_point = {point_text(self.isocenter)}: must lie in front of the "
                                 "source, on the detector's side")

    def set_spacings(self):
        given = self.options.pixel_spacing_mm
        for i, stated in enumerate(self.cameras):
            camera = stated.camera
            if given is not None:
                if not stated.has_spacing:
                    camera = stated.camera = with_column_spacing(camera, given[0])
                if not np.abs(camera.pixel_spacing_mm - given).max() <= 1e-2 * min(given):
                    raise self.contradiction("--rig-pixel-spacing-mm", point_text(given), point_text(camera.pixel_spacing_mm), i)
            elif not stated.has_spacing:
                camera = stated.camera = with_column_spacing(
                    camera, DEFAULT_MAGNIFICATION * camera.depth_mm(self.isocenter) / camera.source_detector_mm *
                    camera.pixel_spacing_mm[0])
                self.notes.append(f"{self.place(i)}: the pixel spacing is not in the file; the detector is put "
                                  f"{camera.source_detector_mm:.2f} mm from the source, which makes columns "
                                  f"{camera.pixel_spacing_mm[0]:.4f} mm apart. Rays do not depend on it; --rig-pixel-spacing-mm "
                                  "states it")

    def flip_images(self):
        if self.options.flip is None:
            return
        axis, key = (1, "row_direction") if self.options.flip == "rows" else (0, "column_direction")
        for stated in self.cameras:
            camera = stated.camera
            direction = getattr(camera, key)
            camera.detector_origin_point = (camera.detector_origin_point +
                                            (camera.size_px[axis] - 1) * camera.pixel_spacing_mm[axis] * direction)
            setattr(camera, key, -direction)
            if axis == 1:
                camera.distortion = with_rows_flipped(camera.distortion)


def with_rows_flipped(distortion):
    return distortion * np.array([1, 1, -1, -1, 1, 1, 1, 1])


def one_camera(source, camera, **flags):
    """What a file with one camera states."""
    return StatedRig([StatedCamera(camera, **flags)], file=source.name)


def unread_note(source, keys):
    return [f"{source.name}: not read: " + ", ".join(keys)] if keys else []


def require(is_so, message):
    if not is_so:
        raise InputError(message)
