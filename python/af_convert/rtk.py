# SPDX-License-Identifier: Apache-2.0
"""RTK's ThreeDCircularProjectionGeometry (IEC 61217). The room is RTK's fixed frame in mm. Its origin is the isocentre, y
is the axis of rotation, and at gantry angle 0 the source is at z = +SID. With R = Rz(-InPlaneAngle) Rx(-OutOfPlaneAngle)
Ry(-GantryAngle) the source is at (SourceOffsetX, SourceOffsetY, SID) in the rotated frame, and the detector's point (u, v)
mm is at (u + ProjectionOffsetX, v + ProjectionOffsetY, SID - SDD). Columns run along u and rows along v, so RTK's images
are mirrored."""
import math
import xml.parsers.expat
from dataclasses import dataclass, field

import numpy as np

from af_programs.errors import FileError, InputError, shown

from .geometry import Camera, about
from .rig import StatedCamera, StatedRig, require
from .source import lines_of, number_of, number_text, numbers_of

ROOT = "RTKThreeDCircularGeometry"
MOST_PROJECTIONS = 100000
MOST_ELEMENTS = 1000000
DEEPEST = 32
# Collimators do not change the rays of pixels, so their elements are known but not used.
KNOWN = {name.lower(): name for name in """SourceToIsocenterDistance SourceToDetectorDistance GantryAngle OutOfPlaneAngle
InPlaneAngle SourceOffsetX SourceOffsetY ProjectionOffsetX ProjectionOffsetY RadiusCylindricalDetector CollimationUInf
CollimationUSup CollimationVInf CollimationVSup""".split()} | {"angle": "GantryAngle"}


@dataclass
class Element:
    name: str
    line: int
    attributes: dict
    texts: list = field(default_factory=list)
    children: list = field(default_factory=list)

    @property
    def text(self):
        return "".join(self.texts).strip(" \t\r\n")


def parse_xml(source):
    """The root element. Declarations of entities are refused, so that they cannot expand."""
    parser = xml.parsers.expat.ParserCreate()
    document = Element("", 0, {})
    stack, count = [document], 0

    def fail(what):
        raise FileError(f"{source.name}:{parser.CurrentLineNumber}: broken XML: {what}")

    def begin(name, attributes):
        nonlocal count
        count += 1
        if count > MOST_ELEMENTS:
            fail("more than a million elements")
        if len(stack) > DEEPEST:
            fail("elements are nested too deeply")
        stack.append(Element(name, parser.CurrentLineNumber, attributes))
        stack[-2].children.append(stack[-1])
    parser.StartElementHandler = begin
    parser.EndElementHandler = lambda name: stack.pop()
    parser.CharacterDataHandler = lambda text: stack[-1].texts.append(text)
    parser.EntityDeclHandler = lambda *_: fail("it declares entities")
    try:
        parser.Parse(source.bytes, True)
    except xml.parsers.expat.ExpatError as error:
        fail(xml.parsers.expat.ErrorString(error.code))
    except (ValueError, LookupError) as error:
        fail(str(error))
    return document.children[0]


def is_rtk(source):
    return f"<{ROOT}" in source.text


def read_rtk(source, options):
    root = parse_xml(source)
    if root.name != ROOT:
        raise FileError(f"{source.name}: root element: expected {ROOT}, found {shown(root.name)}")
    version = root.attributes.get("version", "")
    require(version in ("2", "3"), f"{source.name}:{root.line}: version = '{shown(version, 20)}': must be 2 or 3")
    stated = StatedRig(isocenter_point=np.zeros(3), file=source.name)
    values = {}  # a value holds for all later projections until another replaces it
    for element in root.children:
        if element.name.lower() == "projection":
            stated.cameras.append(_projection(source, element, values))
        else:
            _take_number(source, element, values)
        require(len(stated.cameras) <= MOST_PROJECTIONS,
                f"{source.name}: more than {MOST_PROJECTIONS} projections are too many cameras")
    if not stated.cameras:
        raise FileError(f"{source.name}: has no <Projection>")
    return stated


def _refuse(source, element):
    raise InputError(f"{source.name}:{element.line}: element = <{shown(element.name, 100)}>: is not known at this place of RTK's "
                     "geometry")


def _take_number(source, element, values):
    """Takes an element's number. Like RTK, it ignores the case of names."""
    name = KNOWN.get(element.name.lower())
    if name is None:
        _refuse(source, element)
    if element.children:
        _refuse(source, element.children[0])
    values[name] = number_of(element.text, f"{source.name}:{element.line}: {element.name}")


def _projection(source, projection, values):
    matrix = None
    for element in projection.children:
        if element.name.lower() == "matrix":
            matrix = element
        else:
            _take_number(source, element, values)
    camera = _camera(values, f"{source.name}:{projection.line}")
    if matrix is not None:
        _check_matrix(source, matrix, camera)
    return StatedCamera(camera, has_size=False, has_pixel_grid=False)


def _camera(values, place):
    def value(name):
        return values.get(name, 0.0)
    sid, sdd = value("SourceToIsocenterDistance"), value("SourceToDetectorDistance")
    require(sdd > 0, f"{place}: SourceToDetectorDistance = {sdd}: must be above 0: parallel beams are no cameras")
    radius = value("RadiusCylindricalDetector")
    require(radius == 0, f"{place}: RadiusCylindricalDetector = {radius}: must be 0: curved detectors are not supported")
    axes = (about(2, -math.radians(value("InPlaneAngle"))) @ about(0, -math.radians(value("OutOfPlaneAngle"))) @
            about(1, -math.radians(value("GantryAngle"))))
    return Camera("", axes.T @ [value("SourceOffsetX"), value("SourceOffsetY"), sid],
                  axes.T @ [value("ProjectionOffsetX"), value("ProjectionOffsetY"), sid - sdd], axes[0], axes[1])


def _check_matrix(source, element, camera):
    """Checks that the matrix that RTK stores beside the parameters, from fixed mm to detector mm, follows from them."""
    place = f"{source.name}:{element.line}: Matrix"
    numbers = numbers_of([word for line in lines_of(element.text) for word in line.words], place)
    if len(numbers) != 12:
        raise FileError(f"{place}: numbers: expected 12, found {len(numbers)}")
    with np.errstate(all="ignore"):
        for offset in ([0, 0, 0], [50, 30, -20], [-10, 60, 40]):
            seen = numbers.reshape(3, 4) @ np.append(offset, 1)
            require(np.linalg.norm(seen[:2] / seen[2] - camera.project(offset)) <= 1e-2,
                    f"{place}: does not agree with the parameters of its projection, to 0.01 mm")


def _angles_deg(axes):
    """The angles gantry, out of plane, in plane. A beam along y leaves one of them free."""
    out_of_plane = -math.asin(np.clip(axes[2, 1], -1, 1))
    if math.hypot(axes[2, 0], axes[2, 2]) < 1e-9:
        return 0.0, math.degrees(out_of_plane), -math.degrees(math.atan2(axes[1, 0], axes[0, 0]))
    return (-math.degrees(math.atan2(-axes[2, 0], axes[2, 2])), math.degrees(out_of_plane),
            -math.degrees(math.atan2(-axes[0, 1], axes[1, 1])))


def write_rtk(rig):
    require(np.linalg.norm(rig.isocenter_point) <= 1e-9, "the rig's isocenter_point must be (0, 0, 0): RTK has it at the origin")
    text = f'<?xml version="1.0"?>\n<!DOCTYPE RTKGEOMETRY>\n<{ROOT} version="3">\n'
    for camera in rig.cameras:
        require(camera.is_mirrored, f"camera '{camera.name}': RTK's images are mirrored, row 0 at the lowest v: --rig-flip rows "
                "gives the camera of the images with their rows in the other order")
        axes = np.array([camera.column_direction, camera.row_direction, -camera.beam_direction])
        source, center = axes @ camera.source_point, axes @ camera.detector_point(*camera.middle_px())
        gantry, out_of_plane, in_plane = _angles_deg(axes)
        text += "  <Projection>\n" + "".join(f"    <{name}>{number_text(value)}</{name}>\n" for name, value in (
            ("SourceToIsocenterDistance", source[2]), ("SourceToDetectorDistance", camera.source_detector_mm),
            ("GantryAngle", gantry), ("OutOfPlaneAngle", out_of_plane), ("InPlaneAngle", in_plane),
            ("SourceOffsetX", source[0]), ("SourceOffsetY", source[1]), ("ProjectionOffsetX", center[0]),
            ("ProjectionOffsetY", center[1]))) + "  </Projection>\n"
    return text + f"</{ROOT}>\n"
