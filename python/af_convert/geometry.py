# SPDX-License-Identifier: Apache-2.0
"""Cameras and rigid poses. A camera's frame and constraints are those of rig.toml."""
import copy
import math
from dataclasses import dataclass, field

import numpy as np

from af_programs.errors import InputError

MOST_ROOM_MM = 1e6
PLAUSIBLE_ROOM = "must be finite and within 1e6 mm (1 km)"


def _vector(*values):
    return field(default_factory=lambda: np.array(values, dtype=float))


@dataclass
class Camera:
    """Detector coordinates are (column, row), and integers are pixel centres. They refer to undistorted images."""
    name: str = ""
    source_point: np.ndarray = _vector(0, 0, 0)
    detector_origin_point: np.ndarray = _vector(0, 0, 0)  # centre of pixel (0, 0)
    column_direction: np.ndarray = _vector(1, 0, 0)
    row_direction: np.ndarray = _vector(0, 1, 0)
    pixel_spacing_mm: np.ndarray = _vector(1, 1)  # column, row
    size_px: np.ndarray = field(default_factory=lambda: np.array([1, 1]))
    distortion: np.ndarray = field(default_factory=lambda: np.zeros(8))  # OpenCV's k1 k2 p1 p2 k3 k4 k5 k6

    @property
    def is_mirrored(self):
        normal = np.cross(self.column_direction, self.row_direction)
        return bool(normal @ (self.detector_origin_point - self.source_point) < 0)

    @property
    def beam_direction(self):
        normal = np.cross(self.column_direction, self.row_direction)
        with np.errstate(invalid="ignore"):
            normal = normal / np.linalg.norm(normal)
        return -normal if self.is_mirrored else normal

    @property
    def source_detector_mm(self):
        return float((self.detector_origin_point - self.source_point) @ self.beam_direction)

    def depth_mm(self, point):
        return float((point - self.source_point) @ self.beam_direction)

    def detector_point(self, column, row):
        return (self.detector_origin_point + column * self.pixel_spacing_mm[0] * self.column_direction +
                row * self.pixel_spacing_mm[1] * self.row_direction)

    def project(self, point):
        offset = np.asarray(point, dtype=float) - self.source_point
        seen = self.source_point + self.source_detector_mm / (offset @ self.beam_direction) * offset
        from_origin = seen - self.detector_origin_point
        return np.array([from_origin @ self.column_direction, from_origin @ self.row_direction]) / self.pixel_spacing_mm

    def middle_px(self):
        return 0.5 * (self.size_px - 1)

    def central_direction(self):
        direction = self.detector_point(*self.middle_px()) - self.source_point
        return direction / np.linalg.norm(direction)

    def stored_from_ideal(self, pixel):
        """Where the stored X-ray shows what an undistorted one shows at `pixel`."""
        k = pinhole_of(self)[0]
        focal, center = np.diag(k)[:2], k[:2, 2]
        return _distorted(self.distortion, (np.asarray(pixel) - center) / focal)[0] * focal + center


def vector_text(values):
    return "[" + ", ".join(f"{value:g}" for value in values) + "]"


def _distorted(c, at):
    """The distorted place of a normalised point, and whether the map keeps orientation there."""
    k1, k2, p1, p2, k3, k4, k5, k6 = c
    x, y = at
    r2 = x * x + y * y
    above = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    below = 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    slope = ((k1 + r2 * (2 * k2 + 3 * r2 * k3)) * below - above * (k4 + r2 * (2 * k5 + 3 * r2 * k6))) / (below * below)
    f = above / below
    across = 2 * (x * y * slope + p1 * x + p2 * y)
    xx = f + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x
    yy = f + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x
    place = np.array([x * f + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * f + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y])
    return place, (below > 0) & (xx * yy - across * across > 0) & (xx + yy > 0)


def _distortion_problem(camera):
    if not np.all(np.abs(camera.distortion) <= 1e6):
        return "must be finite and within 1e6"
    k = pinhole_of(camera)[0]
    share = np.linspace(0, 1, 33)
    x = (share * camera.size_px[0] - 0.5 - k[0, 2]) / k[0, 0]
    y = (share * camera.size_px[1] - 0.5 - k[1, 2]) / k[1, 1]
    with np.errstate(all="ignore"):
        keeps = _distorted(camera.distortion, np.meshgrid(x, y))[1]
    if np.all(keeps):
        return ""
    row, column = np.argwhere(~keeps)[0]
    return (f"must not fold the image; it does near column {round(share[column] * camera.size_px[0] - 0.5)}, "
            f"row {round(share[row] * camera.size_px[1] - 0.5)}")


def camera_problems(camera):
    """The reasons why rig.toml cannot state a camera. Each names key, value and constraint."""
    found = []

    def add(key, values, constraint):
        found.append(f"camera '{camera.name}': {key} = {vector_text(values)}: {constraint}")
    for key in ("source_point", "detector_origin_point"):
        if not np.all(np.abs(getattr(camera, key)) <= MOST_ROOM_MM):
            add(key, getattr(camera, key), PLAUSIBLE_ROOM)
    is_unit = {}
    for key in ("column_direction", "row_direction"):
        is_unit[key] = abs(np.linalg.norm(getattr(camera, key)) - 1) < 1e-5
        if not is_unit[key]:
            add(key, getattr(camera, key), "must have length 1")
    if all(is_unit.values()):
        if not abs(camera.column_direction @ camera.row_direction) < 1e-5:
            add("row_direction", camera.row_direction,
                "must be orthogonal to column_direction " + vector_text(camera.column_direction))
        elif not abs(camera.source_detector_mm) > 1e-3:
            add("source_point", camera.source_point, "must not lie on the detector plane")
    if not np.all((camera.pixel_spacing_mm >= 0.01) & (camera.pixel_spacing_mm <= 100)):
        add("pixel_spacing_mm", camera.pixel_spacing_mm, "must be 0.01 to 100 mm")
    if np.any(camera.size_px < 1) or np.any(camera.size_px > 32768) or np.prod(camera.size_px) > 1 << 28:
        add("size_px", camera.size_px, "must be between 1 and 32768, at most 2^28 pixels")
    if np.any(camera.distortion) and not found and (problem := _distortion_problem(camera)):
        add("distortion", camera.distortion, problem)
    return found


def with_clean_axes(camera):
    """The camera with exactly unit and orthogonal axes. Axes that are so already keep their bits."""
    camera = copy.deepcopy(camera)

    def unit(direction):
        norm = np.linalg.norm(direction)
        return direction / norm if abs(norm - 1) > 1e-12 else direction
    camera.column_direction = unit(camera.column_direction)
    cosine = camera.column_direction @ camera.row_direction
    if abs(cosine) > 1e-12:
        camera.row_direction = camera.row_direction - cosine * camera.column_direction
    camera.row_direction = unit(camera.row_direction)
    return camera


def camera_from_pinhole(name, k, rotation, translation, column_spacing_mm, size_px):
    """The camera with (column, row, 1) ~ K (R x + t), whose detector is |K_00| column_spacing_mm behind the source. A
    negative focal length reverses an axis of the detector."""
    place = f"camera '{name}': "

    def fail(what, values, constraint):
        raise InputError(f"{place}{what} = {np.asarray(values).tolist()}: {constraint}")
    if k[1, 0] != 0 or k[2, 0] != 0 or k[2, 1] != 0 or k[2, 2] != 1:
        fail("K", k, "must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")
    if not abs(k[0, 0]) > 1e-3 or not abs(k[1, 1]) > 1e-3:
        fail("K", k, "the focal lengths must not be 0")
    if not abs(k[0, 1]) <= 1e-6 * abs(k[0, 0]):
        fail("K", k, "must have no skew: columns and rows of pixels are orthogonal")
    with np.errstate(over="ignore", invalid="ignore"):
        deviation = np.abs(rotation @ rotation.T - np.eye(3)).max()
    if not deviation < 1e-3 or not np.linalg.det(rotation) > 0:
        fail("R", rotation, "must be a rotation: orthonormal rows, determinant +1")
    rotation = nearest_rotation(rotation)
    distance_mm = abs(k[0, 0]) * column_spacing_mm
    spacing = np.array([column_spacing_mm, distance_mm / abs(k[1, 1])])
    column = math.copysign(1, k[0, 0]) * rotation[0]
    row = math.copysign(1, k[1, 1]) * rotation[1]
    source = -rotation.T @ translation
    origin = source + distance_mm * rotation[2] - k[0, 2] * spacing[0] * column - k[1, 2] * spacing[1] * row
    return Camera(name, source, origin, column, row, spacing, np.array(size_px))


def pinhole_of(camera):
    """K, R and t. A mirrored camera has a negative focal length along columns."""
    sign = -1.0 if camera.is_mirrored else 1.0
    rotation = np.array([sign * camera.column_direction, camera.row_direction, camera.beam_direction])
    to_source = camera.source_point - camera.detector_origin_point
    distance_mm = camera.source_detector_mm
    sx, sy = camera.pixel_spacing_mm
    k = np.array([[sign * distance_mm / sx, 0, to_source @ camera.column_direction / sx],
                  [0, distance_mm / sy, to_source @ camera.row_direction / sy], [0, 0, 1]])
    return k, rotation, -rotation @ camera.source_point


def camera_from_matrix(name, matrix, spacing_mm, size_px, front_point):
    """The camera of a matrix from room mm to pixels. `front_point` lies in front of it."""
    place = f"camera '{name}': projection_matrix"
    matrix = np.array(matrix, dtype=float)
    if matrix[2] @ np.append(front_point, 1) < 0:
        matrix = -matrix
    left = matrix[:, :3]
    with np.errstate(all="ignore"):
        if not abs(np.linalg.det(left)) > 1e-12 * np.linalg.norm(left) ** 3:
            raise InputError(f"{place} is singular: its left 3x3 part must be invertible")
    z = left[2] / np.linalg.norm(left[2])
    y = left[1] - left[1] @ z * z
    y -= y @ z * z
    y /= np.linalg.norm(y)
    x = np.cross(y, z)
    x /= np.linalg.norm(x)
    if left[0] @ x < 0:
        x = -x
    axes = np.array([x, y, z])
    k = left / np.linalg.norm(left[2]) @ axes.T
    k /= k[2, 2]
    if abs(k[0, 1]) > 1e-6 * k[0, 0]:
        raise InputError(f"{place} = skew of {k[0, 1]:g} px: pixel columns and rows must be orthogonal")
    distance_mm = k[0, 0] * spacing_mm[0]
    if abs(distance_mm - k[1, 1] * spacing_mm[1]) > 1e-2 * distance_mm:
        raise InputError(f"{place} = focal lengths {k[0, 0]:g} and {k[1, 1]:g} px: must agree with pixel_spacing_mm to 1 %")
    spacing = np.array([spacing_mm[0], distance_mm / k[1, 1]])
    source = -np.linalg.inv(left) @ matrix[:, 3]
    origin = source + distance_mm * z - k[0, 2] * spacing[0] * x - k[1, 2] * spacing[1] * y
    return Camera(name, source, origin, x, y, spacing, np.array(size_px))


def with_column_spacing(camera, column_spacing_mm):
    """The camera with the same rays and its detector moved along the beam."""
    factor = column_spacing_mm / camera.pixel_spacing_mm[0]
    moved = copy.deepcopy(camera)
    moved.pixel_spacing_mm = factor * camera.pixel_spacing_mm
    moved.detector_origin_point = camera.source_point + factor * (camera.detector_origin_point - camera.source_point)
    return moved


def about(axis, angle_rad):
    """The rotation about axis 0, 1 or 2."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[a, a] = matrix[b, b] = math.cos(angle_rad)
    matrix[b, a] = math.sin(angle_rad)
    matrix[a, b] = -matrix[b, a]
    return matrix


def rotation_zyx(angles_rad):
    return about(2, angles_rad[2]) @ about(1, angles_rad[1]) @ about(0, angles_rad[0])


def angles_zyx(rotation):
    """The inverse of rotation_zyx(), with rz = 0 at gimbal lock."""
    cos_y = math.hypot(rotation[0, 0], rotation[1, 0])
    z = 0.0 if cos_y < 1e-12 else math.atan2(rotation[1, 0], rotation[0, 0])
    sin_z, cos_z = math.sin(z), math.cos(z)
    x = math.atan2(sin_z * rotation[0, 2] - cos_z * rotation[1, 2], cos_z * rotation[1, 1] - sin_z * rotation[0, 1])
    return np.array([x, math.atan2(-rotation[2, 0], cos_y), z])


def quaternion_rotation(w, x, y, z):
    w, x, y, z = np.array([w, x, y, z]) / math.sqrt(w * w + x * x + y * y + z * z)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def vector_rotation(vector):
    """The rotation of a vector that is its axis times its angle in radians."""
    angle = np.linalg.norm(vector)
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def nearest_rotation(matrix):
    if np.abs(matrix.T @ matrix - np.eye(3)).max() <= 1e-14:
        return matrix
    u, _, v = np.linalg.svd(matrix)
    return u @ v


def transform(rotation, translation):
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = translation
    return matrix


def inverse(pose):
    return transform(pose[:3, :3].T, -pose[:3, :3].T @ pose[:3, 3])


def rigid(matrix, place):
    """The exactly rigid 4x4 nearest to one that is rigid to 1e-5."""
    matrix = np.array(matrix, dtype=float)
    rotation = matrix[:3, :3]
    if not np.all(np.isfinite(matrix)):
        raise InputError(f"{place}: the pose has values that are not finite")
    if not np.abs(matrix[:3, 3]).max() <= MOST_ROOM_MM:
        raise InputError(f"{place}: the pose's translation {PLAUSIBLE_ROOM}")
    if not np.abs(matrix[3] - [0, 0, 0, 1]).max() <= 1e-5:
        raise InputError(f"{place}: the pose's last row must be 0 0 0 1")
    with np.errstate(over="ignore", invalid="ignore"):
        deviation = np.abs(rotation.T @ rotation - np.eye(3)).max()
    if not deviation <= 1e-5:
        raise InputError(f"{place}: the pose is not rigid: its rotation part deviates from orthonormal by {deviation:g}")
    if not np.linalg.det(rotation) > 0:
        raise InputError(f"{place}: the pose is not rigid: its rotation part is a reflection (determinant -1)")
    return transform(nearest_rotation(rotation), matrix[:3, 3])
