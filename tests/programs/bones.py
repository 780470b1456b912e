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
import subprocess
import sys
import tempfile

try:
    import numpy as np
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "jobs"))
import bone_scenes
from bone_scenes import posed, rotation

BIN = pathlib.Path(sys.argv[2])
SEED = 67  # of the simulated scene
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


def mean_distance_mm(pose, other):
    """The mean distance of the target box's corners in both poses."""
    low, high = np.array(bone_scenes.TARGET_BOX_CT, float)
    corners = np.stack(np.meshgrid(*zip(low, high)), axis=-1).reshape(-1, 3)
    return np.linalg.norm(corners @ (pose - other)[:3, :3].T + (pose - other)[:3, 3], axis=1).mean()


def simulated():
    gold = bone_scenes.write_scene(FOLDER, "bone", SEED, BIN / "af-drr")
    center = bone_scenes.CENTER_CT

    def registered(output, *more):
        run(BIN / "af-register", "--study", FOLDER / "study.toml", "--renderer", "raycast", "--preset", "bone",
            "-o", FOLDER / output, *more, accepted=(0, 7))
        return json.loads((FOLDER / output / "result.json").read_text())

    result = registered("found")
    start = np.array(result["start_room_from_ct"])
    print(f"landmarks: {mean_distance_mm(start, gold):.2f} mm from gold")
    require(f"verdict '{result['verdict']}' is found: {result['verdict_reason']}", result["verdict"] == "found")
    pose = np.array(result.get("room_from_ct") or result["rejected_room_from_ct"])
    off_mm = mean_distance_mm(pose, gold)
    require(f"{off_mm:.3f} mm from gold, at most 0.1", off_mm <= 0.1)
    told = [result["uncertainty"][name] for name in ("tre_rms_mm", "tre_95_mm", "confidence")]
    require(f"predicted TRE, its 95 % limit and the confidence are {told}",
            None not in told and off_mm <= told[1] <= 2.0 and told[2] > 0.95)

    write_starts(FOLDER / "starts.csv", starts_about(pose, center, 6))
    registered("many", "--starts", FOLDER / "starts.csv")
    ends, verdicts = poses_of(FOLDER / "many")
    require(f"6 starts come back within {np.abs(ends).max():.3f} (deg, mm), at most 0.1", np.abs(ends).max() <= 0.1)
    require(f"verdicts {sorted(set(verdicts))} are all found", set(verdicts) == {"found"})

    wrong = posed(gold[:3, :3] @ rotation([0, 0, 1], 130), [0, 0, 0])
    wrong[:3, 3] = gold[:3, :3] @ center + gold[:3, 3] + [9, 14, 4] - wrong[:3, :3] @ center
    write_starts(FOLDER / "two.csv", [wrong, start])
    best = np.array(registered("two", "--starts", FOLDER / "two.csv")["room_from_ct"])
    ends, _ = poses_of(FOLDER / "two")
    turned, right = csv.DictReader(open(FOLDER / "two/registrations.csv"))
    for name, row in ("turned by 130 deg", turned), ("the landmarks' pose", right):
        print(f"a start {name}: verdict '{row['verdict']}', lowest view in detail {row['judge_fine_lowest_view']}, "
              f"confidence {row['confidence']}")
    require(f"a start turned by 130 deg ends elsewhere ({2 * np.abs(ends).max():.0f} deg or mm)", np.abs(ends).max() > 5)
    require("and is not confident", float(turned["confidence"] or "nan") < 0.5 < float(right["confidence"] or "nan"))
    require(f"the better of both ends is {mean_distance_mm(best, gold):.3f} mm from gold, at most 0.1", mean_distance_mm(best, gold) <= 0.1)


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


VERDICTS = {"radius": "found", "ulna": "doubtful"}
CENTERS = {"radius": np.array([-13.0, -17.0, 30.0]), "ulna": np.array([-13.0, -9.0, 30.0])}


def found_pose(bone):
    run(BIN / "af-register", *wrist_case(bone), "-o", FOLDER / bone)
    result = json.loads((FOLDER / bone / "result.json").read_text())
    require(f"{bone}: verdict '{result['verdict']}' is {VERDICTS[bone]}: {result['verdict_reason']}", result["verdict"] == VERDICTS[bone])
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
            # Wrong ends have a similarity that is a fifth lower.
            ends = [row for row in rows if (float(row["similarity"] or "-1") > 0.98 * best) == is_right]
            for verdict in ("found", "doubtful", "not found"):
                same = [row for row in ends if row["verdict"] == verdict]
                values = sorted(float(row["judge_fine_lowest_view"]) for row in same)
                confidences = sorted(float(row["confidence"] or "nan") for row in same)
                print(f"{bone}, {'right' if is_right else 'wrong'}: {len(same)} {verdict}"
                      + (f", lowest view in detail {values[0]:.2f} to {values[-1]:.2f}, "
                         f"confidence {confidences[0]:.3f} to {confidences[-1]:.3f}" if same else ""))


def distance_of(pose, other, center):
    """The distance of the bone's centre (mm) and the angle (deg) between two poses."""
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
