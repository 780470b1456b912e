#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""docs/howto/bones.md: one bone among others, from camera files and landmarks to its pose, without a matrix by hand.

bones.py simulated BIN   a bone in air as CT (numbers 0 to 4095); X-rays that show it, another bone and soft tissue
bones.py wrist BIN       real biplane X-rays; AF_WRIST_BIPLANE is the folder of the data that the page names
bones.py far BIN         the same from far starts, for the page's table of verdicts; no test: minutes
bones.py marks BIN       the same from marks that are 15 px worse; no test: minutes

Exit 77: skipped, and why.
"""
import csv
import json
import os
import pathlib
import random
import re
import struct
import subprocess
import sys
import tempfile

try:
    import numpy as np
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

BIN = pathlib.Path(sys.argv[2])
FOLDER = pathlib.Path(os.environ.get("AF_KEEP") or tempfile.mkdtemp())
FAILURES = []

# As docs/howto/bones.md has them: marked by a person, in the wrist's frame 0002.
WRIST_PAGE = pathlib.Path(__file__).resolve().parents[2] / "docs/howto/bones.md"


def run(*arguments, accepted=(0,)):
    result = subprocess.run([str(x) for x in arguments], capture_output=True, text=True)
    if result.returncode not in accepted:
        sys.exit(f"{' '.join(map(str, arguments))}\nexit code {result.returncode}\n{result.stdout}{result.stderr}")
    return result.stdout


def require(what, is_true):
    print(("ok      " if is_true else "FAILED  ") + what)
    if not is_true:
        FAILURES.append(what)


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


def write_starts(path, poses):
    with open(path, "w") as file:
        file.write(",".join(f"m{r}{c}" for r in range(3) for c in range(4)) + "\n")
        for pose in poses:
            file.write(",".join(repr(float(x)) for x in pose[:3].ravel()) + "\n")


def starts_about(pose, center_ct, count, most_mm=5.0, most_deg=5.0):
    """Each number uniform within +-5 mm, each rotation about a random axis by up to 5 degrees."""
    random = np.random.default_rng(1)
    center = pose[:3, :3] @ center_ct + pose[:3, 3]
    starts = []
    for _ in range(count):
        turn = rotation(random.normal(size=3), random.uniform(0, most_deg)) @ pose[:3, :3]
        move = random.normal(size=3)
        move *= random.uniform(0, most_mm) / np.linalg.norm(move)
        starts.append(posed(turn, center + move - turn @ center_ct))
    return starts


def poses_of(folder):
    """Ends of registrations.csv, relative to their median, as (mm, deg) per number; and their verdicts."""
    rows = list(csv.DictReader(open(folder / "registrations.csv")))
    names = ("rx_deg", "ry_deg", "rz_deg", "tx_mm", "ty_mm", "tz_mm")
    ends = np.array([[float(row["final_" + name]) for name in names] for row in rows])
    return ends - np.median(ends, axis=0), [row["verdict"] for row in rows]


# --- simulated -----------------------------------------------------------------------------------------------------

SPACING = 1.0  # mm
SIZE = 64, 56, 96  # voxels


def points():
    z, y, x = np.meshgrid(*(np.arange(n) * SPACING for n in reversed(SIZE)), indexing="ij")
    return x, y, z


def shaft_of(bend, outer, inner):
    """A hollow bent shaft that is cut at the upper end. Numbers are HU + 1024."""
    x, y, z = points()
    radius = np.hypot(x - 30 - bend * (z - 20) ** 2, (y - 28) / 0.8)
    return np.where(radius < outer, np.where(radius > inner, 1900.0, 1150.0), 0.0) * (z > 16)


def bone():
    """A shaft with a head, a process and a notch; no symmetry."""
    x, y, z = points()
    shaft = shaft_of(0.002, 9, 5.5)
    head = ((x - 30) / 17) ** 2 + ((y - 28) / 13) ** 2 + ((z - 17) / 13) ** 2 < 1
    process = ((x - 44) / 5) ** 2 + ((y - 34) / 4) ** 2 + ((z - 9) / 8) ** 2 < 1
    notch = ((x - 13) / 6) ** 2 + ((y - 24) / 8) ** 2 + ((z - 14) / 7) ** 2 < 1
    values = np.maximum(shaft, np.where(head, 1350.0, 0.0))
    values = np.maximum(values, np.where(process, 1500.0, 0.0))
    grain = np.random.default_rng(3).normal(0, 60, values.shape)
    return np.where((values > 0) & ~notch, np.clip(values + grain, 1, 4095), 0)


def other_bone():
    """Thinner, and bent the other way, with a round end."""
    x, y, z = points()
    end = np.hypot(np.hypot(x - 30, y - 28), z - 16) < 9
    return np.maximum(shaft_of(-0.003, 6, 3.5), np.where(end, 1300.0, 0.0))


def soft_tissue():
    x, y, z = points()
    return np.where(((x - 32) / 31) ** 2 + ((y - 28) / 27) ** 2 < 1, 1040.0, 0.0)


def write_nifti(path, values):
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 3, *reversed(values.shape), 1, 1, 1, 1)
    struct.pack_into("<hh", header, 70, 512, 16)  # uint16
    struct.pack_into("<8f", header, 76, 1, SPACING, SPACING, SPACING, 1, 1, 1, 1)
    struct.pack_into("<3f", header, 108, 352, 1, 0)
    struct.pack_into("<2h", header, 252, 0, 2)
    struct.pack_into("<12f", header, 280, SPACING, 0, 0, 0, 0, SPACING, 0, 0, 0, 0, SPACING, 0)
    header[344:348] = b"n+1\0"
    path.write_bytes(bytes(header) + values.astype("<u2").tobytes())


def write_mayacam(path, source, beam, down, focal_px, size):
    column = np.cross(down, beam)
    turn = np.stack([column, down, beam])
    translation = -turn @ source
    path.write_text(
        f"image size\n{size},{size}\n\ncamera matrix\n{focal_px},0,{size / 2 + 7}\n0,{focal_px},{size / 2 - 5}\n0,0,1\n\n"
        "rotation\n" + "".join(",".join(repr(float(x)) for x in row) + "\n" for row in turn)
        + "\ntranslation\n" + "".join(f"{x!r}\n" for x in map(float, translation)))
    matrix = np.array([[focal_px, 0, size / 2 + 7], [0, focal_px, size / 2 - 5], [0, 0, 1]])
    return matrix @ np.column_stack([turn, translation])


def mha_values(path):
    content = path.read_bytes()
    mark = b"ElementDataFile = LOCAL\n"
    start = content.index(mark) + len(mark)
    header = dict(line.split(" = ", 1) for line in content[:start].decode().splitlines() if " = " in line)
    columns, rows = map(int, header["DimSize"].split()[:2])
    return np.frombuffer(content[start:], "<f4").reshape(rows, columns)


def write_xray(path, attenuation):
    random = np.random.default_rng(7)
    seen = 240 * np.exp(-attenuation) + random.normal(0, 1.0, attenuation.shape)
    row, column = np.mgrid[: seen.shape[0], : seen.shape[1]]
    middle = seen.shape[0] / 2
    seen[np.hypot(row - middle, column - middle) > 0.98 * middle] = 0  # the aperture of an image intensifier
    header = (f"ObjectType = Image\nNDims = 2\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
              f"DimSize = {seen.shape[1]} {seen.shape[0]}\nElementSpacing = 1 1\nElementType = MET_UCHAR\n"
              "ElementDataFile = LOCAL\n")
    path.write_bytes(header.encode() + np.clip(np.round(seen), 0, 255).astype(np.uint8).tobytes())


def projected(matrix, point):
    x = matrix @ np.append(point, 1)
    return x[:2] / x[2]


RAW = ("--values", "raw", "--raw-slope-per-mm", 0.02 / 1024)


def simulated():
    size, focal = 480, 1700.0
    beams = [np.array([0.6, 0.0, 0.8]), np.array([-0.95, 0.0, 0.3122])]
    down = np.array([0.0, 1.0, 0.0])
    middle = np.array([120.0, 150.0, 80.0])
    cameras = ["cam01.txt", "cam02.txt"]
    matrices = []
    for name, beam in zip(cameras, beams):
        beam = beam / np.linalg.norm(beam)
        matrices.append(write_mayacam(FOLDER / name, middle - 950 * beam, beam, down, focal, size))
    # CT x and y run against the voxels' (NIfTI's frame is RAS, this project's LPS).
    center = np.array([-31.5, -27.5, 47.5])
    upright = np.column_stack([[0.98, 0.0, -0.199], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    upright[:, 0] /= np.linalg.norm(upright[:, 0])
    upright[:, 1] = np.cross(upright[:, 2], upright[:, 0])

    def pose_of(turn, offset):
        turn = turn @ upright
        return posed(turn, middle + offset - turn @ center)

    gold = pose_of(rotation([0.3, 1, 0.2], 20), np.array([8.0, 5.0, -6.0]))
    bodies = {"bone": (bone(), gold),
              "other": (other_bone(), pose_of(rotation([0, 1, 0.3], -35), np.array([-22.0, -3.0, 9.0]))),
              "tissue": (soft_tissue(), pose_of(np.eye(3), np.array([0.0, 2.0, 0.0])))}
    attenuation = [np.zeros((size, size)) for _ in cameras]
    for name, (values, pose) in bodies.items():
        write_nifti(FOLDER / f"{name}.nii", values)
        np.savetxt(FOLDER / f"{name}.txt", pose)
        for i, camera in enumerate(cameras):
            run(BIN / "af-drr", "--ct", FOLDER / f"{name}.nii", *RAW, "--rig", ",".join(str(FOLDER / c) for c in cameras),
                "--camera", camera[:-4], "--pose", FOLDER / f"{name}.txt", "-o", FOLDER / "drr.mha")
            attenuation[i] += mha_values(FOLDER / "drr.mha")
    for camera, image in zip(cameras, attenuation):
        write_xray(FOLDER / (camera[:-4] + ".mha"), image)
    # The tip of the process, the notch and a point of the shaft, marked 3 px wrong (one sigma).
    landmarks = np.array([[-44.0, -34.0, 2.0], [-16.0, -24.0, 14.0], [-36.0, -28.0, 70.0]])
    random = np.random.default_rng(11)
    seen = [[projected(m, gold[:3, :3] @ p + gold[:3, 3]) + random.normal(0, 3, 2) for p in landmarks] for m in matrices]

    def study(name):
        text = f'rig = "{",".join(cameras)}"\n[[case]]\nname = "bone"\nct = "bone.nii"\nct_values = "raw"\n'
        text += f"ct_raw_slope_per_mm = {0.02 / 1024}\ncenter_ct_mm = {center.tolist()}\n"
        text += f"target_box_ct_mm = [[-46, -40, 5], [-18, -16, 90]]\nlandmarks_ct_mm = {landmarks.tolist()}\n"
        for camera, px in zip(cameras, seen):
            text += f'[[case.view]]\ncamera = "{camera[:-4]}"\nxray = "{camera[:-4]}.mha"\nxray_domain = "intensity"\n'
            text += f'mask = "auto"\nlandmarks_px = {np.array(px).tolist()}\n'
        (FOLDER / name).write_text(text)
        return FOLDER / name

    def distance_mm(pose):
        corners = np.array([[x, y, z] for x in (-46, -18) for y in (-40, -16) for z in (5, 90)], float)
        return np.linalg.norm((corners @ pose[:3, :3].T + pose[:3, 3]) - (corners @ gold[:3, :3].T + gold[:3, 3]),
                              axis=1).mean()

    def registered(preset, output, *more):
        run(BIN / "af-register", "--study", study("study.toml"), "--renderer", "raycast", "--preset", preset,
            "-o", FOLDER / output, *more, accepted=(0, 7))
        return json.loads((FOLDER / output / "result.json").read_text())

    result = registered("bone", "found")
    start = np.array(result["start_room_from_ct"])
    print(f"landmarks: {distance_mm(start):.2f} mm from gold")
    require(f"verdict '{result['verdict']}' is found: {result['verdict_reason']}", result["verdict"] == "found")
    pose = np.array(result.get("room_from_ct") or result["rejected_room_from_ct"])
    require(f"{distance_mm(pose):.3f} mm from gold, at most 0.1", distance_mm(pose) <= 0.1)

    write_starts(FOLDER / "starts.csv", starts_about(pose, center, 6))
    registered("bone", "many", "--starts", FOLDER / "starts.csv")
    ends, verdicts = poses_of(FOLDER / "many")
    require(f"6 starts come back within {np.abs(ends).max():.3f} (deg, mm), at most 0.1", np.abs(ends).max() <= 0.1)
    require(f"verdicts {sorted(set(verdicts))} are all found", set(verdicts) == {"found"})

    wrong = posed(rotation([0, 1, 0], 130) @ gold[:3, :3], [0, 0, 0])
    wrong[:3, 3] = gold[:3, :3] @ center + gold[:3, 3] + [9, 14, 4] - wrong[:3, :3] @ center
    write_starts(FOLDER / "two.csv", [wrong, start])
    best = np.array(registered("bone", "two", "--starts", FOLDER / "two.csv")["room_from_ct"])
    ends, _ = poses_of(FOLDER / "two")
    turned = next(csv.DictReader(open(FOLDER / "two/registrations.csv")))
    print(f"a start turned by 130 deg: verdict '{turned['verdict']}', lowest view in detail {turned['judge_fine_lowest_view']}")
    require(f"a start turned by 130 deg ends elsewhere ({2 * np.abs(ends).max():.0f} deg or mm)", np.abs(ends).max() > 5)
    require(f"the better of both ends is {distance_mm(best):.3f} mm from gold", distance_mm(best) <= 0.1)


# --- the wrist -----------------------------------------------------------------------------------------------------


def wrist_study(page, data):
    """The study of the page, its paths in `data`."""
    block = page.split("```toml")[1].split("```")[0]
    return block.replace('"wrist/', f'"{data}/').replace(",wrist/", f",{data}/")


def wrist_case(bone):
    """Options of af-register for a bone of the page's study."""
    data = os.environ.get("AF_WRIST_BIPLANE")
    if not data:
        print("skipped: set AF_WRIST_BIPLANE to the folder of the X-rays that docs/howto/bones.md names")
        sys.exit(77)
    study = FOLDER / "study.toml"
    study.write_text(wrist_study(WRIST_PAGE.read_text(), pathlib.Path(data).resolve()))
    return "--study", study, "--case", bone, "--renderer", "raycast", "--preset", "bone"


CENTERS = {"radius": np.array([-13.0, -17.0, 30.0]), "ulna": np.array([-13.0, -9.0, 30.0])}


def found_pose(bone):
    run(BIN / "af-register", *wrist_case(bone), "-o", FOLDER / bone)
    result = json.loads((FOLDER / bone / "result.json").read_text())
    require(f"{bone}: verdict '{result['verdict']}' is found: {result['verdict_reason']}", result["verdict"] == "found")
    return np.array(result["room_from_ct"]), result["similarity"]


def wrist():
    for bone, center in CENTERS.items():
        write_starts(FOLDER / f"{bone}.csv", starts_about(found_pose(bone)[0], center, 20))
        run(BIN / "af-register", *wrist_case(bone), "--starts", FOLDER / f"{bone}.csv", "-o", FOLDER / f"{bone}-20")
        ends, _ = poses_of(FOLDER / f"{bone}-20")
        spread = np.abs(ends).max(axis=0)
        print(f"{bone}: 20 ends, largest distance from the median: rx, ry, rz {spread[:3].round(3)} deg, "
              f"tx, ty, tz {spread[3:].round(3)} mm; standard deviation {ends.std(axis=0).round(3)}")
        require(f"{bone}: 20 starts come back within 0.5 deg and 0.1 mm",
                spread[:3].max() <= 0.5 and spread[3:].max() <= 0.1)


def far():
    for bone, center in CENTERS.items():
        pose, best = found_pose(bone)
        write_starts(FOLDER / f"{bone}.csv", starts_about(pose, center, 30, most_mm=30.0, most_deg=120.0))
        run(BIN / "af-register", *wrist_case(bone), "--starts", FOLDER / f"{bone}.csv", "-o", FOLDER / f"{bone}-far")
        rows = list(csv.DictReader(open(FOLDER / f"{bone}-far/registrations.csv")))
        for is_right in (True, False):
            # Other ends have a fifth less.
            ends = [row for row in rows if (float(row["similarity"] or "-1") > 0.98 * best) == is_right]
            for verdict in ("found", "doubtful", "not found"):
                of = [row for row in ends if row["verdict"] == verdict]
                values = sorted(float(row["judge_fine_lowest_view"]) for row in of)
                print(f"{bone}, {'right' if is_right else 'wrong'}: {len(of)} {verdict}"
                      + (f", lowest view in detail {values[0]:.2f} to {values[-1]:.2f}" if of else ""))


def distance_of(pose, other, center):
    """Of the bone's centre (mm), and the angle between the two (deg)."""
    turn = pose[:3, :3].T @ other[:3, :3]
    mm = np.linalg.norm((pose[:3, :3] - other[:3, :3]) @ center + pose[:3, 3] - other[:3, 3])
    return mm, np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))


def marks():
    poses = {bone: found_pose(bone)[0] for bone in CENTERS}
    page = (FOLDER / "study.toml").read_text()
    numbers = random.Random(3)

    def worse(mark):
        return "[" + ", ".join(f"{float(px) + numbers.gauss(0, 15):.0f}" for px in mark.groups()) + "]"

    for trial in range(6):
        study = re.sub("landmarks_px = .*", lambda line: re.sub(r"\[(\d+), (\d+)\]", worse, line.group()), page)
        (FOLDER / "worse.toml").write_text(study)
        for bone, center in CENTERS.items():
            output = FOLDER / f"{bone}-{trial}"
            run(BIN / "af-register", "--study", FOLDER / "worse.toml", "--case", bone, "--renderer", "raycast", "--preset",
                "bone", "-o", output, accepted=(0, 7))
            result = json.loads((output / "result.json").read_text())
            start, end = (np.array(result.get(name) or result["rejected_room_from_ct"])
                          for name in ("start_room_from_ct", "room_from_ct"))
            print("{}: start {:.1f} mm, {:.1f} deg, end {:.3f} mm, {:.2f} deg from the pose found, {}".format(
                bone, *distance_of(start, poses[bone], center), *distance_of(end, poses[bone], center), result["verdict"]))


{"simulated": simulated, "wrist": wrist, "far": far, "marks": marks}[sys.argv[1]]()
print(f"{len(FAILURES)} failed")
sys.exit(1 if FAILURES else 0)
