# SPDX-License-Identifier: Apache-2.0
"""Makes X-rays of one bone among others and a study of it, to measure `--preset bone` (docs/howto/bones.md). The CT
holds one bone in air (numbers 0 to 4095). Two cameras (MayaCam files) also see other bones and soft tissue. X-rays are
cast through bodies of half the CT's voxels, so that they share none. Needs numpy, af-drr and af-convert beside it."""
import argparse
import pathlib
import struct
import subprocess
import tempfile

import numpy as np

CAMERAS = ["cam01", "cam02"]
DETECTOR_PX, FOCAL_PX, SOURCE_MM = 480, 1700.0, 950.0
MIDDLE = np.array([120.0, 150.0, 80.0])
SIZE_MM = np.array([64, 56, 96])
FINE_MM = 0.5
CENTER_CT = np.array([-31.5, -27.5, 47.5])  # NIfTI's frame is RAS, this project's is LPS: x and y run against the voxels'
TARGET_BOX_CT = [[-46, -40, 5], [-18, -16, 90]]
# The tip of the process, the notch and a point of the shaft.
LANDMARKS_CT = np.array([[-44.0, -34.0, 2.0], [-16.0, -24.0, 14.0], [-36.0, -28.0, 70.0]])
RAW_SLOPE_PER_MM = 0.02 / 1024
RAW = ("--values", "raw", "--raw-slope-per-mm", str(RAW_SLOPE_PER_MM))


def rotation(axis, degrees):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    angle = np.radians(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def posed(turn, translation):
    pose = np.eye(4)
    pose[:3, :3] = turn
    pose[:3, 3] = translation
    return pose


def projected(matrix, point):
    x = matrix @ np.append(point, 1)
    return x[:2] / x[2]


# --- bodies, in numbers that are HU + 1024 --------------------------------------------------------------------------


class Grid:
    """Voxel centres in mm of the coarse voxels' frame."""

    def __init__(self, spacing_mm):
        counts = np.round(SIZE_MM / spacing_mm).astype(int)
        axes = [(np.arange(n) + 0.5) * spacing_mm - 0.5 for n in counts]
        self.z, self.y, self.x = np.meshgrid(*reversed(axes), indexing="ij")

    def ellipsoid(self, center, radii):
        offsets = ((axis - c) / r for axis, c, r in zip((self.x, self.y, self.z), center, radii))
        return sum(offset**2 for offset in offsets) < 1

    def shaft(self, bend, outer, inner, cortex=1900.0):
        """A hollow bent shaft, cut at the upper end."""
        radius = np.hypot(self.x - 30 - bend * (self.z - 20) ** 2, (self.y - 28) / 0.8)
        return np.where(radius < outer, np.where(radius > inner, cortex, 1150.0), 0.0) * (self.z > 16)


def bone(grid, seed):
    """A shaft with a head, a process and a notch; it has no symmetry. The seed varies shapes, densities and grain."""
    random = np.random.default_rng([seed, 1])

    def about(value, share=0.15):
        return value * random.uniform(1 - share, 1 + share)

    def near(center, mm=2.5):
        return np.asarray(center) + random.uniform(-mm, mm, 3)

    outer = about(9.0)
    values = grid.shaft(random.uniform(-0.003, 0.003), outer, outer - random.uniform(2.0, 4.5), about(1900.0, 0.1))
    head = grid.ellipsoid(near([30, 28, 17]), [about(17), about(13), about(13)])
    process = grid.ellipsoid(near([44, 34, 9]), [about(5), about(4), about(8)])
    notch = grid.ellipsoid(near([13, 24, 14]), [about(6), about(8), about(7)])
    values = np.maximum(values, np.where(head, about(1350.0, 0.05), 0.0))
    values = np.maximum(values, np.where(process, about(1500.0, 0.1), 0.0))
    grain = random.normal(0, 120, values.shape)
    return np.where((values > 0) & ~notch, np.clip(values + grain, 1, 4095), 0)


def other_bone(grid, random):
    """A thinner bone with a round end."""
    end = grid.ellipsoid([30, 28, 16], [random.uniform(7, 11)] * 3)
    outer = random.uniform(5, 8)
    return np.maximum(grid.shaft(random.uniform(-0.004, 0.004), outer, outer - 2.5), np.where(end, 1300.0, 0.0))


def soft_tissue(grid, random):
    """A cylinder of muscle with strands of fat."""
    values = np.where(((grid.x - 32) / 31) ** 2 + ((grid.y - 28) / 27) ** 2 < 1, 1070.0, 0.0)
    for _ in range(12):
        center = random.uniform([10, 10, 0], [54, 46, 96])
        strand = grid.ellipsoid(center, [random.uniform(2, 6), random.uniform(2, 6), random.uniform(10, 40)])
        values = np.where(strand & (values > 0), 930.0, values)
    return values


def halved(values):
    """The mean in voxels twice as wide. It is 0, as outside the bone, where less than half is bone."""
    blocks = values.reshape(*(n for size in values.shape for n in (size // 2, 2)))
    share = (blocks > 0).mean(axis=(1, 3, 5))
    return np.where(share >= 0.5, blocks.mean(axis=(1, 3, 5)), 0.0)


# --- files ----------------------------------------------------------------------------------------------------------


def write_nifti(path, values, spacing_mm):
    """The first voxel is placed as in a grid whose first coarse voxel has its centre at 0."""
    first = 0.5 * spacing_mm - 0.5
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 3, *reversed(values.shape), 1, 1, 1, 1)
    struct.pack_into("<hh", header, 70, 512, 16)  # uint16
    struct.pack_into("<8f", header, 76, 1, *[spacing_mm] * 3, 1, 1, 1, 1)
    struct.pack_into("<3f", header, 108, 352, 1, 0)
    struct.pack_into("<2h", header, 252, 0, 2)
    for axis in range(3):
        row = [spacing_mm if axis == column else 0.0 for column in range(3)]
        struct.pack_into("<4f", header, 280 + 16 * axis, *row, first)
    header[344:348] = b"n+1\0"
    path.write_bytes(bytes(header) + np.round(values).astype("<u2").tobytes())


def write_mayacam(path, beam, down):
    """Returns the projection matrix (3x4, px from mm) of a camera whose beam goes through MIDDLE."""
    column = np.cross(down, beam)
    turn = np.stack([column, down, beam])
    translation = -turn @ (MIDDLE - SOURCE_MM * beam)
    principal = DETECTOR_PX / 2 + 7, DETECTOR_PX / 2 - 5
    path.write_text(
        f"image size\n{DETECTOR_PX},{DETECTOR_PX}\n\ncamera matrix\n{FOCAL_PX},0,{principal[0]}\n0,{FOCAL_PX},{principal[1]}\n0,0,1\n\n"
        "rotation\n" + "".join(",".join(repr(float(x)) for x in row) + "\n" for row in turn)
        + "\ntranslation\n" + "".join(f"{x!r}\n" for x in map(float, translation)))
    matrix = np.array([[FOCAL_PX, 0, principal[0]], [0, FOCAL_PX, principal[1]], [0, 0, 1]])
    return matrix @ np.column_stack([turn, translation])


def mha_values(path):
    content = path.read_bytes()
    mark = b"ElementDataFile = LOCAL\n"
    start = content.index(mark) + len(mark)
    header = dict(line.split(" = ", 1) for line in content[:start].decode().splitlines() if " = " in line)
    columns, rows = map(int, header["DimSize"].split()[:2])
    return np.frombuffer(content[start:], "<f4").reshape(rows, columns)


def write_xray(path, attenuation, noise, random):
    """Writes grey levels from 0 to 255. `noise` is their standard deviation."""
    seen = 240 * np.exp(-attenuation) + random.normal(0, noise, attenuation.shape)
    row, column = np.mgrid[: seen.shape[0], : seen.shape[1]]
    middle = seen.shape[0] / 2
    seen[np.hypot(row - middle, column - middle) > 0.98 * middle] = 0  # the aperture of an image intensifier
    header = (f"ObjectType = Image\nNDims = 2\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
              f"DimSize = {seen.shape[1]} {seen.shape[0]}\nElementSpacing = 1 1\nElementType = MET_UCHAR\n"
              "ElementDataFile = LOCAL\n")
    path.write_bytes(header.encode() + np.clip(np.round(seen), 0, 255).astype(np.uint8).tobytes())


# --- a scene --------------------------------------------------------------------------------------------------------


def pose_of(turn, offset):
    """Room from CT. The ROI centre is `offset` (mm) from MIDDLE, and the bone is upright except for `turn`."""
    upright = np.column_stack([[0.98, 0.0, -0.199], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    upright[:, 0] /= np.linalg.norm(upright[:, 0])
    upright[:, 1] = np.cross(upright[:, 2], upright[:, 0])
    turn = turn @ upright
    return posed(turn, MIDDLE + offset - turn @ CENTER_CT)


def turned(random, most_deg, most_about_axis_deg):
    """A turn about an axis in any direction, after a turn about the bones' own axis."""
    about_axis = rotation([0, 1, 0], random.uniform(-most_about_axis_deg, most_about_axis_deg))
    return rotation(random.normal(size=3), random.uniform(0, most_deg)) @ about_axis


def pose_beside(random):
    """The pose of another bone, which may cross the bone in a view."""
    angle, away_mm = random.uniform(0, 2 * np.pi), random.uniform(20, 34)
    return pose_of(turned(random, 25, 180), [away_mm * np.cos(angle), random.uniform(-5, 5), away_mm * np.sin(angle)])


def study_text(case, gold, landmarks_px):
    text = f'rig = "rig.toml"\n[[case]]\nname = "{case}"\nct = "bone.nii"\nct_values = "raw"\n'
    text += f"ct_raw_slope_per_mm = {RAW_SLOPE_PER_MM}\ncenter_ct_mm = {CENTER_CT.tolist()}\n"
    text += f"target_box_ct_mm = {TARGET_BOX_CT}\nlandmarks_ct_mm = {LANDMARKS_CT.tolist()}\n"
    text += f"gold_room_from_ct = {gold.tolist()}\n"
    for camera, px in zip(CAMERAS, landmarks_px):
        text += f'[[case.view]]\ncamera = "{camera}"\nxray = "{camera}.mha"\nxray_domain = "intensity"\n'
        text += f'mask = "auto"\nlandmarks_px = {np.array(px).tolist()}\n'
    return text


def write_scene(folder, case, seed, af_drr):
    """Writes study.toml and its files into `folder`. Returns the gold pose (4x4)."""
    random = np.random.default_rng([seed, 2])
    down = np.array([0.0, 1.0, 0.0])
    beams = [np.array([0.6, 0.0, 0.8]), np.array([-0.95, 0.0, 0.3122])]
    matrices = [write_mayacam(folder / f"{camera}.txt", beam / np.linalg.norm(beam), down) for camera, beam in zip(CAMERAS, beams)]
    rig = folder / "rig.toml"
    subprocess.run([pathlib.Path(af_drr).with_name("af-convert"), *(folder / f"{camera}.txt" for camera in CAMERAS), "-o", rig],
                   check=True, stderr=subprocess.DEVNULL)
    grid = Grid(FINE_MM)
    body, gold = bone(grid, seed), pose_of(turned(random, 25, 60), random.uniform(-8, 8, 3))
    write_nifti(folder / "bone.nii", halved(body), 2 * FINE_MM)
    seen = [(body, gold), (soft_tissue(grid, random), pose_of(np.eye(3), np.array([0.0, 2.0, 0.0])))]
    for _ in range(random.integers(1, 4)):
        seen.append((other_bone(grid, random), pose_beside(random)))
    attenuation = [np.zeros((DETECTOR_PX, DETECTOR_PX)) for _ in CAMERAS]
    with tempfile.TemporaryDirectory() as name:
        scratch = pathlib.Path(name)
        for values, pose in seen:
            write_nifti(scratch / "body.nii", values, FINE_MM)
            (scratch / "pose.toml").write_text(f"room_from_ct = {pose.tolist()}\n")
            for camera, image in zip(CAMERAS, attenuation):
                subprocess.run([af_drr, "--ct", scratch / "body.nii", *RAW, "--rig", rig, "--camera", camera, "--pose", scratch / "pose.toml",
                                "-o", scratch / "drr.mha"], check=True, stdout=subprocess.DEVNULL)
                image += mha_values(scratch / "drr.mha")
    noise = random.uniform(1, 5)
    for camera, image in zip(CAMERAS, attenuation):
        write_xray(folder / f"{camera}.mha", image, noise, random)
    # Landmarks are marked with an error of 3 px (one sigma).
    marks = [[projected(m, gold[:3, :3] @ p + gold[:3, 3]) + random.normal(0, 3, 2) for p in LANDMARKS_CT] for m in matrices]
    (folder / "study.toml").write_text(study_text(case, gold, marks))
    return gold


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, required=True, help="of shapes, poses and noise")
    parser.add_argument("--case", required=True, help="its name in study.toml")
    parser.add_argument("--af-drr", required=True, metavar="PROGRAM")
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True, help="folder; it must not exist, or be empty")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    if any(options.output.iterdir()):
        parser.error(f"--output {options.output}: must be empty")
    write_scene(options.output, options.case, options.seed, options.af_drr)


if __name__ == "__main__":
    main()
