# SPDX-License-Identifier: Apache-2.0
"""Cameras in OpenCV's FileStorage YAML and in the plain YAML of ROS. They have a camera matrix K, R (3x3, or a rotation
vector) and t, with (column, row, 1) ~ K (R x + t). There is no standard for the names of the keys, so the usual ones are
known. A number at the end of a name (K1, R2) tells several cameras in one file apart."""
import re

import numpy as np
import yaml

from af_programs.errors import FileError, InputError, shown

from .geometry import camera_from_pinhole, pinhole_of, vector_rotation
from .rig import StatedCamera, StatedRig, unread_note, with_rows_flipped
from .source import is_number, number_of, numbers_text, size_of, toml_text

MOST_BYTES = 1 << 20
MOST_NUMBERS = 4096  # more than any matrix of a camera has
MOST_NESTED = 50  # the scanner's time grows with the square
# Lower case, without '_' and '-'. Messages show the first.
MATRIX = "cameramatrix k m mtx intrinsic intrinsics intrinsicmatrix".split()
ROTATION = "r rotation rotationmatrix rmat rvec rotationvector".split()
TRANSLATION = "t tvec translation translationvector".split()
DISTORTION = """distortioncoefficients d dist distcoeffs distortion distortioncoeffs distortioncoefficient distcoeff distcoef
distcoefs distortionparameters distortionparams""".split()
NEEDS_POSE = ("K alone does not say where the camera stands; add R (3x3, or rvec) and t (or tvec), with x_camera = R x_room + t, "
              "mm")


class _Loader(yaml.SafeLoader):
    """Reads nodes only. It constructs nothing and expands no alias, so that a file cannot run code or grow."""

    def fetch_flow_collection_start(self, TokenClass):
        if self.flow_level == MOST_NESTED:
            raise yaml.scanner.ScannerError(None, None, "lists are nested too deeply", self.get_mark())
        super().fetch_flow_collection_start(TokenClass)

    def compose_node(self, parent, index):
        if self.check_event(yaml.AliasEvent):
            raise yaml.composer.ComposerError(None, None, "aliases are not read", self.peek_event().start_mark)
        return super().compose_node(parent, index)


def plain_key(key):
    """A key without case, '_' and '-', and its trailing number."""
    plain = key.replace("_", "").replace("-", "").lower()
    name = plain.rstrip("0123456789")
    return name, plain[len(name):]


def is_opencv(source):
    return any(":" in line.text and plain_key(line.text.partition(":")[0][:64].strip('"'))[0] in MATRIX for line in source.lines)


class _Values:
    """The values of one file, looked up by any of their names."""

    def __init__(self, source):
        self.source, self.entries, self.taken = source, {}, set()
        # OpenCV's directive has a colon in place of a blank.
        text = re.sub(r"^%YAML[: ].*$", "", source.limited_text(MOST_BYTES), count=1, flags=re.MULTILINE)
        try:
            root = yaml.compose(text, Loader=_Loader)
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            raise FileError(f"{source.name}:{mark.line + 1 if mark else 1}: broken YAML: {error.problem}") from error
        except (yaml.YAMLError, RecursionError, ValueError) as error:
            raise FileError(f"{source.name}: broken YAML: {str(error).splitlines()[0][:100]}") from error
        if not isinstance(root, yaml.MappingNode):
            raise FileError(f"{source.name}: is no YAML of 'key: value' lines")
        for key, value in root.value:
            if not isinstance(key, yaml.ScalarNode):
                raise FileError(f"{self.place(key)}: a key is no text")
            if key.value in self.entries:
                raise FileError(f"{self.place(key)}: the key {shown(key.value)} is there twice")
            self.entries[key.value] = value
        self.numbers = sorted({number for name, number in map(plain_key, self.entries) if name in MATRIX})

    def place(self, node):
        return f"{self.source.name}:{node.start_mark.line + 1}"

    def find_exactly(self, names, number):
        for key, value in self.entries.items():
            name, of_key = plain_key(key)
            if of_key == number and name in names:
                self.taken.add(key)
                return value
        return None

    def find(self, names, number):
        """The value for that camera, or the one that all cameras share."""
        own = self.find_exactly(names, number)
        return own if own is not None else self.find_exactly(names, "")

    def required(self, names, number, what):
        value = self.find(names, number)
        if value is None:
            raise InputError(f"{self.source.name}: {names[0]}{number} is missing: {what}")
        return value

    def of_camera(self, names, number):
        """An unnumbered R or t belongs to the only camera. Beside several cameras it comes from a stereo calibration: it is
        that of the second camera relative to the first, and is not taken."""
        if len(self.numbers) == 1:
            return self.required(names, number, NEEDS_POSE)
        value = self.find_exactly(names, number)
        if value is not None:
            return value
        is_stereo = any(plain_key(key) in ((name, "") for name in names) for key in self.entries)
        raise InputError(f"{self.source.name}: {names[0]}{number} is missing: {NEEDS_POSE}" +
                         ("; that without a number, of a stereo calibration, is relative to the first camera" if is_stereo else ""))

    def text(self, node):
        return node.value if isinstance(node, yaml.ScalarNode) else ""

    def matrix_numbers(self, node, what):
        """The numbers of a scalar, a list, a list of lists or an opencv-matrix, row by row."""
        if isinstance(node, yaml.MappingNode):
            parts = {self.text(key): value for key, value in node.value}
            for key in ("rows", "cols", "data"):
                if key not in parts:
                    raise FileError(f"{self.place(node)}: the matrix {what} has no '{key}'")
            count = 1
            for key in ("rows", "cols"):
                extent = number_of(self.text(parts[key]), f"{self.place(parts[key])}: {key}")
                if not (1 <= extent <= MOST_NUMBERS) or extent != int(extent):
                    raise FileError(f"{self.place(parts[key])}: {what}: '{key}' = {extent:g}")
                count *= int(extent)
            numbers = self.matrix_numbers(parts["data"], what)
            if len(numbers) != count:
                raise FileError(f"{self.place(node)}: the matrix {what}: expected {count} numbers, found {len(numbers)}")
            return numbers
        leaves, pending = [], [node]
        while pending:
            one = pending.pop()
            if isinstance(one, yaml.SequenceNode):
                pending += reversed(one.value)
            else:
                leaves.append(one)
            if len(leaves) + len(pending) > MOST_NUMBERS:
                raise FileError(f"{self.place(node)}: {what} has more numbers than any camera")
        return np.array([number_of(self.text(leaf), f"{self.place(leaf)}: {what}") for leaf in leaves])

    def vector(self, node, count, what):
        numbers = self.matrix_numbers(node, what)
        if len(numbers) != count:
            raise FileError(f"{self.place(node)}: {what}: expected {count} numbers, found {len(numbers)}")
        return numbers


def _rotation(values, node):
    """A rotation matrix, or OpenCV's rotation vector: axis times angle in radians."""
    numbers = values.matrix_numbers(node, "R")
    return vector_rotation(numbers) if len(numbers) == 3 else values.vector(node, 9, "R").reshape(3, 3)


def _size(values, number):
    """Columns and rows. None where they are not stated."""
    width, height = values.find(["imagewidth", "width"], number), values.find(["imageheight", "height"], number)
    both = values.find(["imagesize", "size", "resolution"], number)
    if both is not None:
        return size_of(values.vector(both, 2, "image_size"), values.place(both))
    if width is None or height is None:
        return None
    return size_of([values.vector(width, 1, "image_width")[0], values.vector(height, 1, "image_height")[0]], values.place(width))


def _distortion(values, number, k):
    """OpenCV's first eight coefficients. Further ones, for thin prisms and tilted sensors, must be 0."""
    model = values.find(["distortionmodel"], number)
    if model is not None and values.text(model) not in ("plumb_bob", "rational_polynomial"):
        raise InputError(f"{values.place(model)}: distortion_model = '{shown(values.text(model))}': must be plumb_bob or "
                         "rational_polynomial")
    node, distortion = values.find(DISTORTION, number), np.zeros(8)
    if node is None or (isinstance(node, yaml.ScalarNode) and not is_number(node.value)):
        return distortion
    numbers = values.matrix_numbers(node, "distortion_coefficients")
    if len(numbers) not in (0, 4, 5, 8, 12, 14):
        raise FileError(f"{values.place(node)}: distortion_coefficients: expected 4, 5, 8, 12 or 14 numbers, found {len(numbers)}")
    if numbers[8:].any():
        raise InputError(f"{values.place(node)}: distortion of thin prisms or tilted sensors (s1 ... s4, tx, ty) that is not 0 is "
                         "not supported: undistort the images first")
    distortion[:len(numbers[:8])] = numbers[:8]
    # A negative focal length along rows reverses x and y of our normalised image.
    return with_rows_flipped(distortion) if k[1, 1] < 0 else distortion


def _camera(values, number):
    k = values.vector(values.required(MATRIX, number, "K, 3x3"), 9, "camera_matrix").reshape(3, 3)
    rotation = _rotation(values, values.of_camera(ROTATION, number))
    translation = values.vector(values.of_camera(TRANSLATION, number), 3, "t")
    size, spacing = _size(values, number), values.find(["pixelspacingmm"], number)
    column_spacing = 1.0
    if spacing is not None:
        column_spacing = values.vector(spacing, 2, "pixel_spacing_mm")[0]
        if not column_spacing > 0:
            raise InputError(f"{values.place(spacing)}: pixel_spacing_mm must be positive")
    name = values.find(["cameraname", "name"], number)
    name = values.text(name) if name is not None else ""
    camera = camera_from_pinhole(name or "camera" + number, k, rotation, translation, column_spacing, [1, 1] if size is None else size)
    camera.distortion = _distortion(values, number, k)
    return StatedCamera(camera, has_name=bool(name), has_size=size is not None, has_spacing=spacing is not None)


def read_opencv(source, options):
    values = _Values(source)
    if not values.numbers:
        raise InputError(f"{source.name}: camera_matrix is missing: K, 3x3")
    stated = StatedRig([_camera(values, number) for number in values.numbers], file=source.name)
    point = values.find(["isocenterpoint"], "")
    if point is not None:
        stated.isocenter_point = values.vector(point, 3, "isocenter_point")
    stated.notes += unread_note(source, [shown(key) for key in values.entries if key not in values.taken])
    return stated


def write_opencv(rig):
    camera = rig.cameras[0]
    k, rotation, translation = pinhole_of(camera)

    def matrix(key, numbers):
        numbers = np.asarray(numbers, dtype=float)
        numbers = numbers[:, None] if numbers.ndim == 1 else numbers
        return (f"{key}: !!opencv-matrix\n   rows: {numbers.shape[0]}\n   cols: {numbers.shape[1]}\n   dt: d\n   data: [ "
                f"{numbers_text(numbers, ', ')} ]\n")
    coefficients = camera.distortion if camera.distortion[5:].any() else camera.distortion[:5]
    return (f"%YAML:1.0\n---\ncamera_name: {toml_text(camera.name)}\nimage_width: {camera.size_px[0]}\n"
            f"image_height: {camera.size_px[1]}\n" + matrix("camera_matrix", k) + matrix("distortion_coefficients", coefficients) +
            matrix("R", rotation) + matrix("t", translation) + matrix("pixel_spacing_mm", camera.pixel_spacing_mm) +
            matrix("isocenter_point", rig.isocenter_point))
