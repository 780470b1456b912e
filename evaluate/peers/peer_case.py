# SPDX-License-Identifier: Apache-2.0
"""A case of a study for the programs that af-evaluate's registrations are compared with: read without any of this
project's code, so that a mistake in one cannot hide in the other. Needs numpy.

Frames and units are those of docs/conventions.md: ct is LPS in mm, poses are room_from_ct (4x4).
"""
import csv
import gzip
import os
import pathlib
import tomllib

import numpy as np

WATER_MU_PER_MM = 0.0200
AIR_BELOW_HU = -900


class Camera:
    """A pinhole: where pixel centres stand in the room."""

    def __init__(self, table):
        self.name = table["name"]
        self.source = np.array(table["source_point"], float)
        self.origin = np.array(table["detector_origin_point"], float)
        self.columns = np.array(table["column_direction"], float)
        self.rows = np.array(table["row_direction"], float)
        self.spacing = np.array(table["pixel_spacing_mm"], float)
        self.size = tuple(table["size_px"])

    def points(self, columns, rows):
        """Room points (..., 3) of detector positions in pixels."""
        return (
            self.origin
            + np.multiply.outer(columns * self.spacing[0], self.columns)
            + np.multiply.outer(rows * self.spacing[1], self.rows)
        )

    def beam(self):
        """Unit normal of the detector, along the beam, and the distance of source and detector."""
        normal = np.cross(self.columns, self.rows)
        distance = float(normal @ (self.origin - self.source))
        return (normal, distance) if distance > 0 else (-normal, -distance)


def read_nifti_ct(path):
    """HU (z, y, x) of a NIfTI file with an sform, and ct_from_index (4x4, LPS)."""
    data = gzip.open(path).read() if str(path).endswith(".gz") else pathlib.Path(path).read_bytes()
    header = np.frombuffer(data[:348], np.uint8)
    dims = np.frombuffer(header[40:56].tobytes(), "<i2")
    kinds = {4: "<i2", 8: "<i4", 16: "<f4", 512: "<u2"}
    kind = kinds[int(np.frombuffer(header[70:72].tobytes(), "<i2")[0])]
    offset = int(np.frombuffer(header[108:112].tobytes(), "<f4")[0])
    if np.frombuffer(header[254:256].tobytes(), "<i2")[0] <= 0:
        raise ValueError(f"{path}: no sform")
    ras_from_index = np.vstack([np.frombuffer(header[280:328].tobytes(), "<f4").reshape(3, 4), [0, 0, 0, 1]])
    count = int(np.prod(dims[1:4]))
    hu = np.frombuffer(data, kind, count, offset).reshape(dims[3], dims[2], dims[1])
    return hu, np.diag([-1.0, -1.0, 1.0, 1.0]) @ ras_from_index


def read_mha(path):
    """The pixels (rows, columns) of an uncompressed or zlib-compressed MetaImage."""
    import zlib

    data = pathlib.Path(path).read_bytes()
    end = data.index(b"\n", data.index(b"ElementDataFile")) + 1
    keys = dict(
        (part.strip() for part in line.split("=", 1)) for line in data[:end].decode().splitlines() if "=" in line
    )
    kinds = {"MET_USHORT": "<u2", "MET_SHORT": "<i2", "MET_FLOAT": "<f4", "MET_UCHAR": "u1"}
    body = data[end:]
    if keys.get("CompressedData", "False") == "True":
        body = zlib.decompress(body)
    size = [int(word) for word in keys["DimSize"].split()]
    return np.frombuffer(body, kinds[keys["ElementType"]], size[0] * size[1]).reshape(size[1], size[0])


class View:
    def __init__(self, camera, xray, roi):
        self.camera = camera
        self.column, self.row, self.width, self.height = roi
        intensity = np.maximum(xray.astype(float), 0.5)
        self.attenuation = -np.log(intensity / intensity.max())

    def region(self, factor):
        """The region of interest by pixels `factor` times as wide: attenuation (h, w), columns, rows of their centres."""
        w, h = self.width // factor, self.height // factor
        image = self.attenuation[self.row : self.row + h * factor, self.column : self.column + w * factor]
        image = image.reshape(h, factor, w, factor).mean(axis=(1, 3))
        middle = 0.5 * (factor - 1)
        return image, self.column + middle + factor * np.arange(w), self.row + middle + factor * np.arange(h)


class PeerCase:
    def __init__(self, study_path, case_name):
        folder = pathlib.Path(study_path).parent
        with open(study_path, "rb") as file:
            study = tomllib.load(file)
        case = next(entry for entry in study["case"] if entry["name"] == case_name)
        with open(folder / study["rig"], "rb") as file:
            cameras = {table["name"]: Camera(table) for table in tomllib.load(file)["camera"]}
        self.center_ct = np.array(case["center_ct_mm"], float)
        self.views = [
            View(cameras[view["camera"]], read_mha(folder / view["xray"]), view["roi_px"]) for view in case["view"]
        ]
        hu, self.ct_from_index = read_nifti_ct(folder / case["ct"])
        hu = hu.astype(np.float32)
        self.mu_per_mm = np.where(
            hu < AIR_BELOW_HU, 0.0, WATER_MU_PER_MM * np.maximum(0.0, 1.0 + hu / 1000.0)
        ).astype(np.float32)


def read_starts(path, case_name, most):
    """(start_index, room_from_ct) of a starts.csv; `most`: evenly among them, or all."""
    with open(path, newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["case"] == case_name]
    if most and most < len(rows):
        rows = [rows[(i * len(rows)) // most] for i in range(most)]
    names = [f"m{i}{j}" for i in range(3) for j in range(4)]
    return [
        (int(row["start_index"]), np.vstack([np.array([float(row[n]) for n in names]).reshape(3, 4), [0, 0, 0, 1]]))
        for row in rows
    ]


def write_poses(path, case_name, poses):
    """For af-evaluate --poses-from. `poses`: (start_index, room_from_ct, seconds)."""
    names = [f"m{i}{j}" for i in range(3) for j in range(4)]
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["case", "start_index", "seconds"] + names)
        for index, pose, seconds in poses:
            writer.writerow([case_name, index, f"{seconds:.6g}"] + [repr(float(v)) for v in pose[:3].ravel()])


def rotation(angles_rad):
    """Rz Ry Rx."""
    (sx, sy, sz), (cx, cy, cz) = np.sin(angles_rad), np.cos(angles_rad)
    rx = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    ry = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    rz = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return rz @ ry @ rx


def moved(start, center_ct, parameters):
    """The start moved by (rx, ry, rz in rad, tx, ty, tz in mm) about the ROI centre."""
    pivot = start[:3, :3] @ center_ct + start[:3, 3]
    pose = np.eye(4)
    turn = rotation(parameters[:3])
    pose[:3, :3] = turn @ start[:3, :3]
    pose[:3, 3] = turn @ (start[:3, 3] - pivot) + pivot + parameters[3:]
    return pose


def options_of(description):
    import argparse

    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--study", required=True)
    parser.add_argument("--case", required=True)
    parser.add_argument("--starts", required=True, help="starts.csv of af-evaluate registration --starts-only")
    parser.add_argument("--most", type=int, default=0, help="so many starts, evenly among them [all]")
    parser.add_argument("-o", "--output", required=True, help="poses for af-evaluate registration --poses-from")
    return parser


def cpu_seconds():
    """Of this process and of the finished ones that it started: other work on the machine does not count."""
    return sum(os.times()[:4])


def run(options, register):
    """Registers every start; `register(start)` gives the pose."""
    poses = []
    for index, start in read_starts(options.starts, options.case, options.most):
        begin = cpu_seconds()
        pose = register(start)
        poses.append((index, pose, cpu_seconds() - begin))
        print(f"start {index}: {poses[-1][2]:.1f} s of one core", flush=True)
    write_poses(options.output, options.case, poses)
