# SPDX-License-Identifier: Apache-2.0
"""The camera of a C-arm, from the header of its DICOM image (PS3.3, C.8.7.5: XA positioner). The room has the patient's
axes (LPS, mm) and its origin at the isocentre. The patient lies on the back, head first. At angles 0 the detector is in
front of the chest. A positive primary angle moves it to the patient's left (LAO), a positive secondary angle to the
head."""
import math

import numpy as np

from af_programs.errors import FileError, InputError

from .dicom_header import is_dicom, items_of, numbers_of, read_header, text_of
from .geometry import Camera, about
from .rig import StatedCamera, StatedRig, require
from .source import size_of

MODALITIES = ("XA", "RF", "CR", "DX")
LETTERS = {"L": (1, 0, 0), "R": (-1, 0, 0), "P": (0, 1, 0), "A": (0, -1, 0), "H": (0, 0, 1), "F": (0, 0, -1)}
UNAPPLIED = {"TableAngle": "(0018,1138)", "ColumnAngulation": "(0018,1450)", "DetectorPrimaryAngle": "(0018,1530)",
             "DetectorSecondaryAngle": "(0018,1531)"}


def is_dicom_camera(source):
    if not is_dicom(source):
        return False
    try:
        return text_of(read_header(source, False), "Modality") in MODALITIES
    except (FileError, InputError):
        return True  # broken DICOM: reading it says why


def read_dicom_camera(source, options):
    return _Reader(source, options).run()


class _Reader:
    def __init__(self, source, options):
        self.source, self.file, self.options = source, source.name, options
        self.header = read_header(source, True)
        self.stated = StatedRig(isocenter_point=np.zeros(3), file=source.name)

    def run(self):
        modality = text_of(self.header, "Modality")
        require(modality in MODALITIES, f"{self.file}: Modality (0008,0060) = '{modality}': must be XA, RF, CR or DX")
        sides = []
        for keyword, tag in (("Columns", "(0028,0011)"), ("Rows", "(0028,0010)")):
            sides.append(self.number(None, None, keyword))
            require(sides[-1] is not None, f"{self.file}: {keyword} {tag} is missing")
        self.size_px = size_of(sides, f"{self.file}: Columns, Rows")
        if "SharedFunctionalGroupsSequence" in self.header or "PerFrameFunctionalGroupsSequence" in self.header:
            self.add_enhanced()
        else:
            self.read_detector(1)
            for angles in self.all_angles():
                self.add_camera(angles, 1)
        for keyword, tag in UNAPPLIED.items():
            if angle := self.number(None, None, keyword):
                self.stated.notes.append(f"{self.file}: {keyword} {tag} = {angle:g} degrees is not applied")
        return self.stated

    def group(self, frame, macro):
        """An element of one frame (from 1), taken from its functional groups or else from the shared ones; None without it."""
        frames = items_of(self.header, "PerFrameFunctionalGroupsSequence")
        own = items_of(frames[frame - 1], macro) if 1 <= frame <= len(frames) else []
        shared = items_of(self.header, "SharedFunctionalGroupsSequence")
        found = own or (items_of(shared[0], macro) if shared else [])
        return found[0] if found else None

    def number(self, frame, macro, keyword):
        """The first number in a frame's functional group, or else at the top level; None without one."""
        group = self.group(frame, macro) if macro else None
        numbers = (numbers_of(group, keyword, self.file) if group is not None else []) or numbers_of(self.header, keyword, self.file)
        return numbers[0] if numbers else None

    def distance(self, found, name, given, option):
        """A distance from the header, or else from the option. The option must not contradict the header."""
        if found is not None and found > 0:
            require(given is None or abs(given - found) <= 1e-3,
                    f"{self.file}: {option} = {given}: must agree with {name} = {found:g}")
            return found
        require(given is not None, f"{self.file}: {name} is missing: state it with {option}")
        return given

    def read_detector(self, frame):
        geometry = "XRayGeometrySequence"
        self.source_detector_mm = self.distance(
            self.number(frame, geometry, "DistanceSourceToDetector"), "DistanceSourceToDetector (0018,1110)",
            self.options.source_detector_mm, "--rig-source-detector-mm")
        to_isocenter = self.number(frame, geometry, "DistanceSourceToIsocenter")
        if to_isocenter is None:
            to_isocenter = self.number(None, None, "DistanceSourceToPatient")
        self.source_isocenter_mm = self.distance(to_isocenter, "DistanceSourceToPatient (0018,1111)",
                                                 self.options.source_isocenter_mm, "--rig-source-isocenter-mm")
        self.spacing_mm = self.imager_spacing(frame)

    def imager_spacing(self, frame):
        for place in (self.group(frame, "FramePixelDataPropertiesSequence"), self.header):
            spacing = numbers_of(place, "ImagerPixelSpacing", self.file) if place is not None else []
            if spacing:
                require(len(spacing) == 2 and min(spacing) > 0, f"{self.file}: ImagerPixelSpacing (0018,1164) = "
                        "'{}': must be two positive numbers (mm)".format("\\".join(f"{value:g}" for value in spacing)))
                return np.array(spacing[::-1])
        require(self.options.pixel_spacing_mm is not None,
                f"{self.file}: ImagerPixelSpacing (0018,1164) is missing: state it with --rig-pixel-spacing-mm COLUMN,ROW; "
                "PixelSpacing (0028,0030) is not used, because it may be the spacing at the patient")
        return np.array(self.options.pixel_spacing_mm)

    def add_enhanced(self):
        """One camera per frame, or one when no frame moves."""
        for frame in range(1, self.frame_count() + 1):
            self.read_detector(frame)
            self.add_camera(self.angles_of(frame), frame)
        first = self.stated.cameras[0].camera

        def is_first(other):
            return all(np.array_equal(getattr(other, key), getattr(first, key)) for key in
                       ("source_point", "detector_origin_point", "column_direction", "row_direction", "pixel_spacing_mm"))
        if all(is_first(stated.camera) for stated in self.stated.cameras):
            del self.stated.cameras[1:]
        pixels = self.group(1, "FramePixelDataPropertiesSequence")
        keyword = "PixelDataAreaOriginRelativeToFOV"
        if pixels is not None and any(numbers_of(pixels, keyword, self.file)):
            self.stated.notes.append(f"{self.file}: {keyword} (0018,7036) is not 0 and is not applied: the images are a part of "
                                     "the field of view, of which the middle is taken for theirs")
        keyword = "PositionerIsocenterDetectorRotationAngle"
        if rotation := self.number(1, "IsocenterReferenceSystemSequence", keyword):
            self.stated.notes.append(f"{self.file}: {keyword} (0018,9465) = {rotation:g} degrees is not applied: the images may "
                                     "be turned in their plane")

    def frame_count(self):
        frames = self.number(None, None, "NumberOfFrames")
        frames = 1 if frames is None else frames
        require(1 <= frames <= 100000 and frames == math.floor(frames),
                f"{self.file}: NumberOfFrames (0028,0008) = {frames:g}: must be a whole number between 1 and 100000")
        return int(frames)

    def angles_of(self, frame):
        found = [self.number(frame, "PositionerPositionSequence", keyword)
                 for keyword in ("PositionerPrimaryAngle", "PositionerSecondaryAngle")]
        given = self.options.positioner_deg
        of_equipment = self.group(frame, "IsocenterReferenceSystemSequence") is not None
        require(None not in found or given is not None,
                f"{self.file}: PositionerPrimaryAngle (0018,1510) or PositionerSecondaryAngle (0018,1511) is missing: state both "
                "with --rig-positioner-deg PRIMARY,SECONDARY" +
                ("; the file's PositionerIsocenter angles are of the equipment, not of the patient" if of_equipment else ""))
        for i in range(2):
            if found[i] is None:
                found[i] = given[i]
            require(given is None or abs(found[i] - given[i]) <= 1e-3,
                    f"{self.file}: --rig-positioner-deg = {given}: must agree with the file's angles")
        require(abs(found[0]) <= 360 and abs(found[1]) <= 180, f"{self.file}: positioner angles = {found[0]:g}, {found[1]:g}: the "
                "first must be within +-360 degrees, the second within +-180")
        return found

    def all_angles(self):
        """The angles of every frame; a single entry unless the positioner moves. By PS3.3, C.8.7.5.1.3, there is one
        increment per frame, or one offset from the first angles for each."""
        first = self.angles_of(1)
        if text_of(self.header, "PositionerMotion") != "DYNAMIC":
            return [first]
        count = self.frame_count()

        def offsets(keyword, tag):
            values = numbers_of(self.header, keyword, self.file) or [0.0]
            require(len(values) in (1, count), f"{self.file}: {keyword} {tag} = {len(values)} values: must be one, or one per "
                    f"frame: {count}")
            return values if len(values) == count > 1 else [i * values[0] for i in range(count)]
        return [[first[0] + a, first[1] + b] for a, b in zip(offsets("PositionerPrimaryAngleIncrement", "(0018,1520)"),
                                                              offsets("PositionerSecondaryAngleIncrement", "(0018,1521)"))]

    def field_of_view_offset_mm(self, frame):
        """Where the image's middle lies from the middle of the active detector: (column, row) mm. 0 unless all are stated."""
        own = self.group(frame, "FieldOfViewSequence")
        view = own if own is not None and text_of(own, "FieldOfViewOrigin") else self.header
        pairs = []
        for place, keyword in ((self.header, "DetectorElementSpacing"), (self.header, "DetectorActiveDimensions"),
                               (self.header, "DetectorActiveOrigin"), (view, "FieldOfViewOrigin")):
            numbers = numbers_of(place, keyword, self.file)
            if len(numbers) != 2:
                return np.zeros(2)
            pairs.append(np.array(numbers[::-1]))  # rows come first in DICOM
        spacing, active, active_origin, origin = pairs
        offset = (origin - active_origin) * spacing + 0.5 * (self.size_px * self.spacing_mm - active)
        if not offset.any():
            return offset
        # FieldOfViewOrigin refers to the detector's own rows and columns, before the image was turned and flipped.
        turn = (numbers_of(view, "FieldOfViewRotation", self.file) or [0.0])[0]
        require(turn in (0, 180), f"{self.file}: FieldOfViewRotation (0018,7032) = {turn:g}: must be 0 or 180 where "
                "FieldOfViewOrigin is not the detector's middle")
        offset = -offset if turn == 180 else offset
        return offset * [-1, 1] if text_of(view, "FieldOfViewHorizontalFlip") == "YES" else offset

    def oriented(self, column, row):
        """Reverses the axes that PatientOrientation says are reversed in the stored image."""
        letters = self.header.get("PatientOrientation") or []
        letters = [letters] if isinstance(letters, str) else list(letters)
        stated = [LETTERS.get(str(letter)[:1]) for letter in letters] + [None, None]
        fits = [direction is not None and abs(direction @ axis) >= 0.3 for direction, axis in
                zip([None if one is None else np.array(one) for one in stated[:2]], (column, row))]
        if not all(fits):
            if not self.stated.cameras:
                self.stated.notes.append(
                    f"{self.file}: PatientOrientation (0020,0020) is missing or does not fit the angles; the images are taken as "
                    "seen from the detector, head on top (L\\F at angles 0); --rig-flip columns or rows turns them around")
            return column, row
        return (column if np.dot(stated[0], column) > 0 else -column), (row if np.dot(stated[1], row) > 0 else -row)

    def add_camera(self, angles_deg, frame):
        turn = about(2, math.radians(angles_deg[0])) @ about(0, -math.radians(angles_deg[1]))
        to_detector = turn @ [0, -1, 0]
        column, row = self.oriented(turn @ [1, 0, 0], turn @ [0, 0, -1])
        source = -self.source_isocenter_mm * to_detector
        first = self.field_of_view_offset_mm(frame) - 0.5 * (self.size_px - 1) * self.spacing_mm
        origin = source + self.source_detector_mm * to_detector + first[0] * column + first[1] * row
        self.stated.cameras.append(StatedCamera(Camera("", source, origin, column, row, self.spacing_mm, self.size_px)))
