# SPDX-License-Identifier: Apache-2.0
"""Finished runs of af-evaluate, read from their folders."""
import json
import os
import re
import urllib.parse
from functools import cached_property
from pathlib import Path

from af_programs.errors import FileError, InputError

from .files import rows_of
from .numbers import as_number

FORMAT, VERSION = "attenuation-fields evaluation", 1
KINDS = ("registration", "error-budget", "similarity-curves", "image-quality", "field-parameters")


class Run:
    def __init__(self, folder, summary):
        self.folder, self.summary, self.kind = folder, summary, summary["kind"]
        self.name = folder.name
        self.page_folder = folder

    def path(self, relative):
        """A file of the run. Raises FileError if its path, or a link in it, leads out of the folder."""
        path = (self.folder / str(relative)).resolve()
        if path == self.folder or self.folder not in path.parents:
            raise FileError(f"{self.folder / 'summary.json'}: names '{relative}', which is not a file of the run")
        return path

    def rows(self, name):
        return rows_of(self.path(name))

    def picture(self, name):
        try:
            return self.path(name).read_bytes()
        except (OSError, ValueError) as error:
            raise FileError(f"{self.folder / str(name)}: {error}") from None

    def link(self, relative):
        self.path(relative)
        return urllib.parse.quote(os.path.relpath(self.folder / relative, self.page_folder))

    @cached_property
    def starts(self):
        """The rows of registrations.csv, with what figures and lists need."""
        columns = ("initial_tre_mm", "tre_mm", "mrpd_mm", "confidence")
        one_view = {case["case"] for case in self.summary["cases"] if case["views"] == 1}
        starts = []
        for row in self.rows("registrations.csv"):
            start = {key: row.number(key) for key in columns if key in row or key != "confidence"}
            start["error_mm"] = start["mrpd_mm" if row.text("case") in one_view else "tre_mm"]
            for key in ("case", "renderer", "start_index", "success", "stop_reason", "error", *(["verdict"] if "verdict" in row else [])):
                start[key] = row.text(key)
            starts.append(start)
        return starts

    @property
    def anchor(self):
        return f"run-{file_name_part(self.name)}"

    @property
    def error(self):
        """The error by which its ends are judged: TRE, mRPD with one view, or both."""
        return self.summary["renderers"][0]["error"]

    @property
    def has_one_view(self):
        return any(case["views"] == 1 for case in self.summary["cases"])

    def is_default(self, renderer):
        method = self.summary["method"]
        return renderer["renderer"] == "field" and method["preset"] == "robust" and not method.get("corrected")


def file_name_part(name):
    return re.sub(r"[^A-Za-z0-9_-]", "_", name.encode("utf-8").decode("latin-1"))


def method_name(renderer):
    """The words for a renderer's name in summaries and tables."""
    return {"field": "attenuation fields", "raycast": "ray casting"}.get(renderer, renderer)


def read_summary(path):
    try:
        summary = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        raise FileError(f"{path}: {error}") from None
    if not isinstance(summary, dict):
        raise FileError(f"{path}: is no JSON object")
    # Other programs may write a summary.json too.
    if summary.get("format") != FORMAT:
        return None
    if summary.get("format_version") != VERSION:
        raise FileError(f"{path}: format_version = {summary.get('format_version')}: must be {VERSION}")
    if summary.get("kind") not in KINDS:
        raise FileError(f"{path}: kind = {summary.get('kind')}: must be one of {', '.join(KINDS)}")
    return summary


def find_runs(folders):
    """The finished runs in the folders and below, each once, with the default method first and then by path. Repeats of
    single starts count only if their own folder is named."""
    named, found = {Path(folder).resolve() for folder in folders}, set()
    for folder in map(Path, folders):
        if not folder.is_dir():
            raise FileError(f"{folder}: is not a folder of results")
        for place, _, names in os.walk(folder):
            path = Path(place) / "summary.json"
            if "summary.json" in names and not path.is_symlink():
                found.add(path.resolve().parent)
    runs = []
    for folder in sorted(found):
        summary = read_summary(folder / "summary.json")
        if summary is not None and ("only_start" not in summary or folder in named):
            runs.append(Run(folder, summary))
    if not runs:
        raise InputError(f"RUN = {folders[0]}: holds no finished run of af-evaluate")
    set_names(runs)
    return sorted(runs, key=lambda run: (KINDS.index(run.kind), not begins_with_default(run), run.folder))


def begins_with_default(run):
    try:
        return run.kind == "registration" and run.is_default(run.summary["renderers"][0])
    except (KeyError, IndexError, TypeError, AttributeError):  # the page will refuse it
        return False


def set_names(runs):
    """Names the runs by their paths below the deepest folder that all share. Registrations whose paths end alike
    ("skull/registration", "thorax/registration") lose the common end."""
    shared = Path(os.path.commonpath([run.folder.parent for run in runs]))
    for run in runs:
        run.name = run.folder.relative_to(shared).as_posix()
    registrations = [run for run in runs if run.kind == "registration"]
    ends = {Path(run.name).name if "/" in run.name else None for run in registrations}
    if len(registrations) > 1 and len(ends) == 1 and None not in ends:
        for run in registrations:
            run.name = Path(run.name).parent.as_posix()


def field_name(run):
    camera, case = run.summary["field"]["camera"], run.summary.get("case")
    if case:
        return f"{case} {camera}"
    study = Path(run.name).parent.as_posix()
    return f"camera {camera}" + ("" if study == "." else f" of {study}")


def is_papers_setting(run):
    """Whether the field has the paper's motion range and camera, so that the paper's PSNR levels hold for it."""
    field = run.summary["field"]
    stated = [*field["detector_px"], *field["pixel_spacing_mm"], field["source_detector_mm"], field["max_rotation_deg"],
              field["max_translation_mm"]]
    papers = [256, 256, 1.190625, 1.190625, 1020, 10, 100]
    return (run.summary.get("has_fitted_viewpoints") is not True
            and all(abs(as_number(value) - paper) <= 1e-3 * paper for value, paper in zip(stated, papers)))
