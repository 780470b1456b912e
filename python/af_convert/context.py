# SPDX-License-Identifier: Apache-2.0
"""What formats of poses need to know about the pose's CT, cameras and study. The CT's grid comes from af-inspect, which
runs as a separate process because its HDF5 library is not the one that h5py has loaded."""
import json
import pathlib
import resource
import shutil
import subprocess
import sys
from dataclasses import dataclass

import numpy as np

from af_programs.errors import ProgramError, FileError, InputError

from .own_poses import Frame
from .source import Source
from .toml_table import Table, parse_toml

ASKED = "; give --ct, or --study with --case"


@dataclass
class Grid:
    size: np.ndarray
    spacing_mm: np.ndarray
    origin_mm: np.ndarray
    direction: np.ndarray

    def point_mm(self, index):
        return self.origin_mm + self.direction @ (self.spacing_mm * index)

    @property
    def middle_mm(self):
        return self.point_mm(0.5 * (self.size - 1))


def af_inspect():
    """The af-inspect beside af-convert, or else the one on the PATH."""
    beside = pathlib.Path(sys.argv[0]).absolute().parent / "af-inspect"
    found = str(beside) if beside.is_file() else shutil.which("af-inspect")
    if found is None:
        raise FileError("af-inspect: is neither beside af-convert nor on the PATH; it reads the CT")
    return found


def inspected(path, options=()):
    """The facts that af-inspect PATH --json prints. Its errors become ours, with its exit code."""
    most = resource.getrlimit(resource.RLIMIT_DATA)[1]  # our soft limit is for small files
    run = subprocess.run([af_inspect(), str(path), *options, "--json"], capture_output=True, text=True, check=False,
                         preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_DATA, (most, most)))
    report = json.loads(run.stdout)[0] if run.stdout.startswith("[") else {"error": run.stderr.strip()[-2000:]}
    if run.returncode != 0:
        error = ProgramError(f"af-inspect ended with exit code {run.returncode}: {report.get('error')}")
        error.exit_code = run.returncode if run.returncode in (3, 4) else ProgramError.exit_code
        raise error
    return report["facts"]


class Study:
    """The parts of a study.toml that matter here."""

    def __init__(self, path, case=None):
        self.path = pathlib.Path(path)
        source = Source(path)
        self.table = parse_toml(source)
        cases = self.table.get("case", [])
        if not isinstance(cases, list) or not all(isinstance(one, dict) for one in cases):
            raise InputError(f"{path}: case: must be tables [[case]]")
        self.cases = cases
        self.place, self.case_name = f"{path}: ", case

    def case(self):
        names = [one.get("name") for one in self.cases]
        if self.case_name is None and len(names) == 1:
            return self.cases[0]
        if names.count(self.case_name) != 1:
            raise InputError(f"{self.place}--case = {self.case_name}: must be one of {', '.join(map(str, names))}")
        return self.cases[names.index(self.case_name)]

    def file(self, name):
        return self.path.parent / name

    def rig_files(self):
        """The files of its rig. A shipped rig is given by its name."""
        rig = Table(self.table, self.place).text("rig")
        return [str(self.file(part)) if self.file(part).exists() else part for part in ([rig] if self.file(rig).exists() else rig.split(","))]

    def ct(self):
        case = Table(self.case(), self.place)
        series = case.text("ct_series", None)
        return self.file(case.text("ct")), ["--series", series] if series else []

    def nominal_pose(self):
        """The pose that the study states. If it states none, the one that af-inspect works out."""
        case = Table(self.case(), f"{self.place}case '{self.case().get('name')}': ")
        if "nominal_room_from_ct" in case:
            return case.matrix("nominal_room_from_ct", 4, 4)
        facts = inspected(self.path)["cases"]
        return np.array(facts[self.cases.index(self.case())]["nominal_room_from_ct"], dtype=float)

    def frame(self):
        return Frame(self.nominal_pose(), Table(self.case(), self.place).vector("center_ct_mm", 3))


class Context:
    """Looks up CT, rig and frame only when a format needs them. One that is not known raises an error with `why`."""

    def __init__(self, ct=None, study=None, read_rig=None, camera=None):
        self.study, self.camera, self.read_rig = study, camera, read_rig
        self.ct_path, self.ct_options = (ct, []) if ct else study.ct() if study and study.cases else (None, [])
        self._facts = None

    def facts(self):
        if self._facts is None:
            self._facts = inspected(self.ct_path, self.ct_options)
        return self._facts

    def ct_grid(self, why):
        if self.ct_path is None:
            raise InputError(f"{why}{ASKED}")
        geometry = self.facts().get("geometry")
        if geometry is None:
            raise InputError(f"{self.ct_path}: is no CT, af-inspect says")
        size, spacing, origin, axes = (np.array(geometry[key], dtype=float)
                                       for key in ("size_voxels", "spacing_mm", "origin_mm", "direction"))
        return Grid(size, spacing, origin, axes.T)  # axes.T: one column per axis of voxels

    def ct_frame_of_reference(self):
        """DICOM's UID. Empty where there is none."""
        return "" if self.ct_path is None else self.facts().get("frame_of_reference_uid", "")

    def rig(self, why):
        if self.read_rig is None:
            raise InputError(f"{why}; give its rig (--rig, or --study)")
        rig = self.read_rig()
        if self.camera:
            rig.cameras = [rig.camera(self.camera)]
        elif self.study is not None:
            views = self.study.case().get("view", [])
            used = {view.get("camera") for view in views if isinstance(view, dict)}
            rig.cameras = [camera for camera in rig.cameras if camera.name in used] or rig.cameras
        return rig

    def frame(self, why):
        if self.study is None:
            raise InputError(f"{why}, which is not known; give --study, or m00 ... m23 (room_from_ct) instead")
        return self.study.frame()
