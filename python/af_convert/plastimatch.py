# SPDX-License-Identifier: Apache-2.0
"""Cameras of plastimatch: the text that `plastimatch drr` writes beside each projection, and the command itself. The room
is DICOM's patient frame (LPS, mm). The normal points from the isocentre to the source, at the distance SAD. The detector
stands SID from the source. View-up points to the top row. The help says "row col" but means columns first."""
import re
import shlex

import numpy as np

from af_programs.errors import FileError, InputError, shown

from .geometry import Camera, camera_from_pinhole, pinhole_of, transform
from .rig import StatedRig, StatedCamera, one_camera, require
from .source import is_number, line_numbers, lines_of, number_text, numbers_of, numbers_text, rows_text, size_of

LINES = 16
# Options without effect on the camera: they concern the image's values, its files and how it is computed.
INDIFFERENT = set("-A --threading --autoscale --autoscale-range -e --exponential -G --geometry-only -H --hu-conversion -I "
                  "--input -i --algorithm -O --output -P --preprocess -s --intensity-scale -t --output-format".split())
LONG_NAMES = {"-n": "--nrm", "-r": "--dim", "-z": "--detector-size", "-c": "--image-center", "-o": "--isocenter",
              "-y": "--gantry-angle", "-a": "--num-angles", "-w": "--subwindow"}
KNOWN = {"--nrm", "--vup", "--sad", "--sid", "--dim", "--detector-size", "--image-center", "--isocenter"}


def is_plastimatch(source):
    lines = source.lines
    return len(lines) > 8 and len(lines[0].words) == 2 and is_number(lines[0].words[0]) and lines[7].text == "Extrinsic"


def read_plastimatch(source, options):
    """Pixels are the image centre in line 1 plus (P x) / w. Columns are the first coordinate."""
    lines = source.lines
    if len(lines) < LINES:
        raise FileError(f"{source.name}: truncated: a projection file has {LINES} lines")
    if len(lines) > LINES:
        raise InputError(f"{source.place(lines[LINES])}: line = '{shown(lines[LINES].text)}': must not be there: a projection "
                         f"file has {LINES} lines")
    if lines[7].text != "Extrinsic" or lines[12].text != "Intrinsic":
        raise FileError(f"{source.name}: the lines 'Extrinsic' and 'Intrinsic' are not where they belong")

    def rows(first, count, columns):
        return np.array([line_numbers(source, line, columns) for line in lines[first:first + count]])
    center, matrix, sad = rows(0, 1, 2)[0], rows(1, 3, 4), rows(4, 1, 1)[0, 0]
    rows(5, 1, 1), rows(6, 1, 3)  # SID and normal, which the matrices hold too
    extrinsic, intrinsic = rows(8, 4, 4), rows(13, 3, 4)
    product = intrinsic @ extrinsic
    for i in range(3):
        if not np.linalg.norm(matrix[i] - product[i]) <= 1e-5 * np.linalg.norm(product[i]):
            raise InputError(f"{source.name}: row {i + 1} of the projection matrix is not Intrinsic times Extrinsic")
    require(intrinsic[2, 2] > 0 and intrinsic[0, 0] > 0 and intrinsic[1, 1] > 0 and sad > 0,
            f"{source.name}: SAD and the diagonal of Intrinsic must be above 0")
    k = np.array([[intrinsic[0, 0] / intrinsic[2, 2], 0, center[0]], [0, intrinsic[1, 1] / intrinsic[2, 2], center[1]], [0, 0, 1]])
    camera = camera_from_pinhole(source.name, k, extrinsic[:3, :3], extrinsic[:3, 3], 1 / intrinsic[0, 0], [1, 1])
    stated = one_camera(source, camera, has_size=False)
    stated.isocenter_point = camera.source_point + sad * camera.beam_direction
    return stated


def write_plastimatch(rig):
    camera = rig.cameras[0]
    require(not camera.is_mirrored, f"camera '{camera.name}': plastimatch cannot state a mirrored camera")
    sad = camera.depth_mm(rig.isocenter_point)
    off_mm = np.linalg.norm(camera.source_point + sad * camera.beam_direction - rig.isocenter_point)
    require(off_mm <= 1e-6, f"camera '{camera.name}': plastimatch has the isocentre on the detector's normal through the "
            f"source; the rig's is {number_text(off_mm)} mm off")
    k, rotation, translation = pinhole_of(camera)
    distance = camera.source_detector_mm
    extrinsic = transform(rotation, translation)
    intrinsic = np.zeros((3, 4))
    intrinsic[[0, 1, 2], [0, 1, 2]] = 1 / camera.pixel_spacing_mm[0], 1 / camera.pixel_spacing_mm[1], 1 / distance
    return (numbers_text(k[:2, 2]) + "\n" + rows_text(intrinsic @ extrinsic) + f"{number_text(sad)}\n{number_text(distance)}\n" +
            numbers_text(camera.beam_direction) + "\nExtrinsic\n" + rows_text(extrinsic) + "Intrinsic\n" + rows_text(intrinsic))


def is_plastimatch_command(source):
    return re.search(r"(?:^|[\s;,])plastimatch[ \t]+drr(?=[\s;,]|$)", source.text) is not None


def _words_of_drr(source):
    """The words from "drr" on, in the only command that has it."""
    lexer = shlex.shlex(source.limited_text(1 << 20).replace("\\\r\n", " ").replace("\\\n", " "), posix=True, punctuation_chars=";&\n")
    lexer.whitespace = " \t\r"
    lexer.whitespace_split = True
    lexer.commenters = "#"
    commands = [[]]
    try:
        for word in lexer:
            if word and set(word) <= set(";&\n"):
                commands.append([])
            else:
                commands[-1].append(word)
    except ValueError as error:
        raise FileError(f"{source.name}: no shell command: {error}") from error
    found = [words[words.index("drr"):] for words in commands if "drr" in words]
    if not found:
        raise FileError(f"{source.name}: no plastimatch drr command")
    require(len(found) == 1, f"{source.name}: holds {len(found)} plastimatch drr commands; give a file with one")
    return found[0]


def read_plastimatch_command(source, options):
    words, values = _words_of_drr(source), {}
    for word, following in zip(words, words[1:] + [""]):
        if word.startswith("-") and not is_number(word):
            name, equals, value = word.partition("=")
            values[LONG_NAMES.get(name, name)] = value if equals else following
    for name in sorted(values):
        require(name in KNOWN or name in INDIFFERENT,
                f"{source.name}: {shown(name, 40)} is not read: the projection files that plastimatch drr -G writes are")

    def numbers(name, count, otherwise=None):
        if name not in values:
            require(otherwise is not None, f"{source.name}: the command has no {name}")
            return np.array(otherwise, dtype=float)
        found = numbers_of([word for line in lines_of(values[name]) for word in line.words], f"{source.name}: {name}")
        if len(found) != count:
            raise FileError(f"{source.name}: {name}: expected {count} numbers, found '{shown(values[name], 40)}'")
        return found
    normal, up = numbers("--nrm", 3), numbers("--vup", 3, [0, 0, 1])
    sad, sid = numbers("--sad", 1, [1000])[0], numbers("--sid", 1, [1500])[0]
    size, detector_mm = numbers("--dim", 2), numbers("--detector-size", 2)
    center, isocenter = numbers("--image-center", 2, 0.5 * (size - 1)), numbers("--isocenter", 3, [0, 0, 0])
    require(np.linalg.norm(np.cross(normal, up)) > 1e-6 * np.linalg.norm(normal) * np.linalg.norm(up),
            f"{source.name}: --nrm and --vup must not be parallel")
    require(detector_mm.min() > 0 and sad > 0 and sid > 0, f"{source.name}: --detector-size, --sad and --sid must be above 0")
    size = size_of(size, f"{source.name}: --dim")
    beam = -normal / np.linalg.norm(normal)
    # Seen along the beam with the top row up, columns run to the right.
    column = np.cross(beam, up) / np.linalg.norm(np.cross(beam, up))
    row = np.cross(beam, column)
    spacing = detector_mm / size
    at = isocenter - sad * beam
    origin = at + sid * beam - center[0] * spacing[0] * column - center[1] * spacing[1] * row
    return StatedRig([StatedCamera(Camera("", at, origin, column, row, spacing, size))], isocenter, file=source.name)
