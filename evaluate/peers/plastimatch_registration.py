# SPDX-License-Identifier: Apache-2.0
"""Registration with the DRRs of plastimatch (`plastimatch drr`, a process per DRR) and af-register's nelder-mead, which is
NLopt's, called as register/optimizer/nlopt_search.cpp does. It maximises the sum of the views' correlations of gradients. Needs plastimatch, numpy and nlopt (Debian's python3-nlopt).

    python3 evaluate/peers/plastimatch_registration.py --study study.toml --case NAME --starts starts.csv -o poses.csv
"""
import pathlib
import subprocess
import tempfile

import nlopt
import numpy as np

from peer_case import PeerCase, moved, options_of, run

FACTOR = 4  # pixels so many times as wide
MOST_POSES = 220
FIRST_STEPS = np.array([0.06, 0.06, 0.06, 5.0, 5.0, 5.0])  # rad, mm
FINAL_STEP = 0.02  # of the first ones, so 0.1 mm


def write_mha(path, values, ct_from_index):
    """Attenuation in thousandths of water, which plastimatch takes as it is (-P none)."""
    spacing = np.linalg.norm(ct_from_index[:3, :3], axis=0)
    direction = ct_from_index[:3, :3] / spacing
    if not np.allclose(direction, np.diag(np.sign(np.diag(direction)))):
        raise ValueError("the CT's axes are not the patient's")
    origin = ct_from_index[:3, 3].copy()
    for axis in range(3):  # plastimatch's DRRs take no directions: flipped to +1
        if direction[axis, axis] < 0:
            values = np.flip(values, axis=2 - axis)
            origin[axis] -= spacing[axis] * (values.shape[2 - axis] - 1)
    depth, height, width = values.shape
    header = (
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
        f"Offset = {origin[0]} {origin[1]} {origin[2]}\nElementSpacing = {spacing[0]} {spacing[1]} {spacing[2]}\n"
        f"DimSize = {width} {height} {depth}\nElementType = MET_SHORT\nElementDataFile = LOCAL\n"
    )
    pathlib.Path(path).write_bytes(header.encode() + np.ascontiguousarray(values, "<i2").tobytes())


def text(vector):
    return " ".join(repr(float(value)) for value in vector)


class Projector:
    def __init__(self, view, folder):
        self.view, self.folder = view, folder
        self.xray, _, _ = view.region(FACTOR)

    def __call__(self, pose):
        """The region's DRR (h, w) of a pose. The camera is brought to the CT."""
        view, camera = self.view, self.view.camera
        ct_from_room = np.linalg.inv(pose)
        turn = ct_from_room[:3, :3]
        normal, distance = camera.beam()
        source = turn @ camera.source + ct_from_room[:3, 3]
        beam = turn @ normal
        half = 0.5 * distance  # the isocentre may be any point of the axis
        foot = camera.source + distance * normal - camera.origin
        h, w = self.xray.shape
        # The detector is the region's block of coarse pixels; its centre is where the axis meets it, in their units.
        middle = 0.5 * (FACTOR - 1)
        column = (foot @ camera.columns / camera.spacing[0] - view.column - middle) / FACTOR
        row = (foot @ camera.rows / camera.spacing[1] - view.row - middle) / FACTOR
        prefix = self.folder / f"{camera.name}-"
        command = ["plastimatch", "drr", "-i", "exact", "-A", "cpu", "-P", "none", "-t", "pfm", "-a", "1"]
        command += ["-n", text(-beam), "--vup", text(turn @ -camera.rows), "-o", text(source + half * beam)]
        command += ["--sad", repr(half), "--sid", repr(distance), "-r", f"{h} {w}", "-c", f"{row!r} {column!r}"]
        command += ["-z", f"{h * FACTOR * camera.spacing[1]!r} {w * FACTOR * camera.spacing[0]!r}"]
        command += ["-O", str(prefix), str(self.folder / "ct.mha")]
        subprocess.run(command, check=True, capture_output=True)
        data = pathlib.Path(f"{prefix}0000.pfm").read_bytes()
        return np.frombuffer(data[-4 * h * w :], "<f4").reshape(h, w)


def gradient_correlation(a, b):
    total = 0.0
    for axis in (0, 1):
        x, y = np.diff(a, axis=axis).ravel(), np.diff(b, axis=axis).ravel()
        x, y = x - x.mean(), y - y.mean()
        total += float(x @ y) / (float(np.linalg.norm(x) * np.linalg.norm(y)) + 1e-12)
    return 0.5 * total


def best_of(value):
    """The scaled parameters where value(parameters) was highest, searched from 0."""
    search = nlopt.opt(nlopt.LN_NELDERMEAD, 6)
    search.set_max_objective(lambda scaled, _: value(scaled))
    search.set_initial_step(1.0)
    search.set_xtol_abs(FINAL_STEP)
    search.set_maxeval(MOST_POSES)
    return search.optimize(np.zeros(6))


def main():
    options = options_of(__doc__).parse_args()
    case = PeerCase(options.study, options.case)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        write_mha(folder / "ct.mha", np.minimum(np.round(case.mu_per_mm / 2e-5), 32767), case.ct_from_index)
        projectors = [Projector(view, folder) for view in case.views]

        def register(start):
            def pose_of(scaled):
                return moved(start, case.center_ct, scaled * FIRST_STEPS)

            def value(scaled):
                pose = pose_of(scaled)
                return sum(gradient_correlation(p(pose), p.xray) for p in projectors)

            return pose_of(best_of(value))

        run(options, register)


if __name__ == "__main__":
    main()
