# SPDX-License-Identifier: Apache-2.0
"""The command line of af-convert."""
import argparse
import math
import os
import pathlib
import re
import resource
import sys

from af_programs.argument_pages import add_common_options
from af_programs.errors import ProgramError, FileError, InputError

from . import formats
from .context import Context, Study
from .rig import RigOptions, require
from .rig_toml import write_rig_toml
from .source import Source
from .study_toml import study_text

# The formats that the ending of a written file chooses.
ENDINGS = {".csv": "csv", ".tfm": "itk", ".tra": "autoscoper"}
SHIPPED_RIGS = ("c-arm-12in", "treatment-room")


def _numbers(count, low, high, convert=float):
    def parse(text):
        try:
            values = [convert(word) for word in text.split(",")]
        except ValueError:
            values = []
        if len(values) != count or not all(math.isfinite(value) and low <= value <= high for value in values):
            raise argparse.ArgumentTypeError(f"takes {','.join(['NUMBER'] * count)}, each between {low:g} and {high:g}, not '{text}'")
        return values if count > 1 else values[0]
    return parse


def parser():
    result = argparse.ArgumentParser(
        prog="af-convert", allow_abbrev=False,
        description="Converts cameras, poses and studies of other programs to rig.toml, poses and study.toml, and back. A file's "
        "content decides what it is.")
    # This makes -10.5,20,30 a value even after a blank.
    result._negative_number_matcher = re.compile("-[0-9.]")
    result.add_argument("files", nargs="+", metavar="FILE", help="camera files to make one rig of, each of any of the formats; or a "
                        "file of poses; or a study.toml, for its rig")
    names = list(dict.fromkeys(one.name for one in formats.CAMERAS + formats.POSES))
    targets = list(dict.fromkeys(formats.written(formats.CAMERAS) + formats.written(formats.POSES) + ["study"]))
    result.add_argument("--from", dest="source_format", choices=names, metavar="FORMAT",
                        help="format of the files (docs/cameras.md, docs/poses.md), when their content does not tell: " + ", ".join(names))
    result.add_argument("--to", dest="target_format", choices=targets, metavar="FORMAT",
                        help="format to write; without it rig for cameras, and for poses what -o ends in, else toml; study: "
                        "study.toml and rig.toml, of cameras and --ct")
    result.add_argument("-o", "--output", metavar="OUT", help="file to write; of formats that hold one camera, one file per camera: "
                        "OUT-NAME. Without it texts are printed")
    rig = result.add_argument_group("Settings that camera files leave open")
    rig.add_argument("--rig-names", type=lambda text: text.split(","), metavar="NAME,...",
                     help="names of the cameras, in the files' order; without it from the files' names")
    rig.add_argument("--rig-size-px", type=_numbers(2, 1, 32768, int), metavar="COLUMNS,ROWS", help="size of the images")
    rig.add_argument("--rig-pixel-spacing-mm", type=_numbers(2, 0.01, 100), metavar="COLUMN,ROW",
                     help="spacing of columns and rows on the detector; without it the detector is put at 1.5 times the isocentre's "
                     "distance from the source")
    rig.add_argument("--rig-isocenter-point", type=_numbers(3, -1e6, 1e6), metavar="X,Y,Z",
                     help="the rig's isocentre in its room; without it the point nearest to the cameras' central rays")
    rig.add_argument("--rig-unit-mm", type=_numbers(1, 1e-3, 1e4), metavar="MM",
                     help="length of the files' unit, when they may mean another than mm")
    rig.add_argument("--rig-detector-origin-mm", type=_numbers(2, -1e6, 1e6), metavar="U,V",
                     help="where the centre of pixel (0, 0) lies on the detector, for formats that state the detector in mm only; "
                     "without it the image is centred")
    rig.add_argument("--rig-source-detector-mm", type=_numbers(1, 1, 1e6), metavar="MM",
                     help="distance from source to detector, when a DICOM file does not state it")
    rig.add_argument("--rig-source-isocenter-mm", type=_numbers(1, 1, 1e6), metavar="MM",
                     help="distance from source to isocentre (DICOM: to patient), when a DICOM file does not state it")
    rig.add_argument("--rig-positioner-deg", type=_numbers(2, -180, 180), metavar="PRIMARY,SECONDARY",
                     help="primary (LAO is positive) and secondary (cranial is positive) positioner angle, when a DICOM file does "
                     "not state them")
    rig.add_argument("--rig-flip", choices=("rows", "columns"), metavar="AXIS", help="rows or columns: the X-rays are stored with "
                     "them in the other order than the files' convention has it")
    of_pose = result.add_argument_group("CT and cameras of a pose")
    of_pose.add_argument("--study", metavar="STUDY.toml", help="study with the CT, cameras and nominal pose")
    of_pose.add_argument("--case", metavar="NAME", help="its case; without it the only one")
    of_pose.add_argument("--ct", metavar="CT", help="the CT, for Autoscoper, DiffDRR and DICOM, read by af-inspect")
    of_pose.add_argument("--rig", metavar="RIG", help="the cameras, for DiffDRR: any camera files, with commas between them")
    of_pose.add_argument("--camera", metavar="NAME", help="the camera of the rig or study, for DiffDRR")
    add_common_options(result)
    return result


def main(arguments=None):
    options = parser().parse_args(arguments)
    # Files are not trusted, and none of them needs more memory than this.
    resource.setrlimit(resource.RLIMIT_DATA, (4 << 30, resource.getrlimit(resource.RLIMIT_DATA)[1]))
    try:
        notes, outputs = converted(options)
        for note in notes:
            print(f"af-convert: warning: {note}", file=sys.stderr)
        for path, content in outputs:
            write(path, content)
    except ProgramError as error:
        print(f"af-convert: error: {error}", file=sys.stderr)
        return error.exit_code
    except MemoryError:
        print("af-convert: error: " + ", ".join(options.files) + ": more memory is wanted than files of this kind need",
              file=sys.stderr)
        return FileError.exit_code
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0


def rig_options(options):
    return RigOptions(*(getattr(options, "rig_" + name) for name in (
        "names", "size_px", "pixel_spacing_mm", "isocenter_point", "unit_mm", "detector_origin_mm", "source_detector_mm",
        "source_isocenter_mm", "positioner_deg", "flip")))


def rig_paths(name):
    """A rig's files, from one name or from several with commas between them."""
    if name in SHIPPED_RIGS and not os.path.exists(name):
        raise InputError(f"{name}: is a shipped rig: af-inspect --template prints its form, a study's folder holds its rig.toml")
    return [name] if os.path.exists(name) else [part for part in name.split(",") if part]


def context_of(options):
    require(options.study is None or (options.ct is None and options.rig is None), "--study: gives CT and rig; not with --ct or --rig")
    require(options.case is None or options.study is not None, "--case: needs --study")
    study = Study(options.study, options.case) if options.study else None
    paths = study.rig_files() if study else rig_paths(options.rig) if options.rig else None
    return Context(options.ct, study, (lambda: formats.read_rig(paths, RigOptions())[0]) if paths else None, options.camera)


def kinds_of(options):
    """The files by their kind: cameras, poses, studies."""
    cameras, poses, studies = [], [], []
    name = options.source_format
    for path in options.files:
        source = Source(path)
        if source.has_line("[[case]]"):
            studies.append(path)
        elif formats.recognised(source, formats.CAMERAS, name) is not None and not (
                name and name not in [one.name for one in formats.CAMERAS]):
            cameras.append(path)
        elif formats.recognised(source, formats.POSES, name) is not None:
            poses.append(path)
        else:
            raise FileError(f"{path}: holds neither cameras nor poses in a known format; tried: " + ", ".join(
                one.name for one in formats.CAMERAS + formats.POSES))
    return cameras, poses, studies


def converted(options):
    """Warnings, and [(path or None, text or bytes)]."""
    cameras, poses, studies = kinds_of(options)
    for path in studies:
        cameras += Study(path).rig_files()
    target, output = options.target_format, pathlib.Path(options.output) if options.output else None
    if target == "study":
        return study_outputs(options, cameras, poses, output)
    require(not (cameras and poses), f"{poses[0] if poses else ''}: holds a pose, {cameras[0] if cameras else ''} cameras: give them "
            "apart, or with --to study")
    if cameras:
        require(target is None or target in formats.written(formats.CAMERAS),
                f"--to = {target}: is no format of cameras; they are: {', '.join(formats.written(formats.CAMERAS))}")
        rig, notes = formats.read_rig(cameras, rig_options(options), options.source_format)
        return notes, formats.rig_files(rig, target or "rig", output) if output else [
            (None, content) for _, content in formats.rig_files(rig, target or "rig", pathlib.Path("camera"))]
    require(target is None or target in formats.written(formats.POSES),
            f"--to = {target}: is no format of poses; they are: {', '.join(formats.written(formats.POSES))}")
    require(len(poses) == 1, "files of poses: give one at a time")
    target = target or ENDINGS.get(output.suffix if output else "", "toml")
    context = context_of(options)
    found, notes = formats.read_poses(poses[0], context, options.source_format)
    return notes, [(output, formats.pose_file(found, target, context))]


def study_outputs(options, cameras, poses, output):
    require(output is not None and options.ct is not None and cameras, "--to study: needs camera files, --ct and -o")
    require(len(poses) <= 1, "--to study: takes one file of a pose")
    rig, notes = formats.read_rig(cameras, rig_options(options), options.source_format)
    context, pose = context_of(options), None
    if poses:
        found, more = formats.read_poses(poses[0], context)
        require(len(found) == 1, f"{poses[0]}: holds {len(found)} poses; one is expected")
        notes, pose = notes + more, found[0][1]
    text = study_text(output, "rig.toml", rig, cameras, options.ct, context.ct_grid("--to study"), pose)
    return notes, [(output.with_name("rig.toml"), write_rig_toml(rig)), (output, text)]


def write(path, content):
    """Writes a file that appears only when complete. Without a path, writes to standard output."""
    content = content if isinstance(content, bytes) else content.encode("utf-8")
    if path is None:
        sys.stdout.buffer.write(content)
        return
    partial = path.with_name(path.name + ".partial")
    try:
        partial.write_bytes(content)
        os.replace(partial, path)
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror}") from error
