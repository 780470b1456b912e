# SPDX-License-Identifier: Apache-2.0
"""What holds for every format of cameras, and how rigs are completed."""
import copy
import unittest

import numpy as np

from examples import *  # noqa: F403
from af_convert.rig import StatedCamera, StatedRig, completed_rig
from af_convert.source import Source

# Numbers are written with all their digits; angles and matrices between a camera and its file cost some roundings of 1e-16 of
# 1e3 mm and px, magnified by at most 10.
ROUND_TRIP_PX = 1e-8
WRITTEN = [one for one in formats.CAMERAS if one.write]


def oblique_rig(isocenter):
    """Two oblique cameras whose images are not square, off centre."""
    rig, turn = c_arm_rig(), rotation_zyx([0.2, -0.4, 0.3])
    rig.isocenter_point = np.array(isocenter)
    for camera in rig.cameras:
        camera.source_point = turn @ camera.source_point + isocenter
        camera.detector_origin_point = turn @ (camera.detector_origin_point + [3.0, 4.0, -5.0]) + isocenter
        camera.column_direction, camera.row_direction = turn @ camera.column_direction, turn @ camera.row_direction
        camera.size_px = np.array([251, 240])
    return rig


def mirrored(rig):
    rig = copy.deepcopy(rig)
    for camera in rig.cameras:
        camera.detector_origin_point = camera.detector_point(0, camera.size_px[1] - 1)
        camera.row_direction = -camera.row_direction
    return rig


def files_of(rig, name, folder):
    return formats.rig_files(rig, name, folder / "cameras.txt")


def writable_rig(name, folder):
    """The most general of these rigs that the format can state."""
    for isocenter in ([5.0, -7.0, 11.0], [0.0, 0.0, 0.0]):
        for rig in (oblique_rig(isocenter), mirrored(oblique_rig(isocenter))):
            try:
                files_of(rig, name, folder)
            except InputError:
                continue
            return rig
    raise AssertionError(f"{name}: no rig can be written")


def options_for(rig):
    """The options by which a user states what the format does not."""
    camera = rig.cameras[0]
    return RigOptions([one.name for one in rig.cameras], list(camera.size_px), list(camera.pixel_spacing_mm), rig.isocenter_point)


class EveryCameraFormat(FileTest):
    def written(self, rig, name):
        return [self.file(content, path.name) for path, content in files_of(rig, name, self.folder)]

    def assert_same(self, back, rig):
        self.assertEqual([camera.name for camera in back.cameras], [camera.name for camera in rig.cameras])
        for one, other in zip(back.cameras, rig.cameras):
            np.testing.assert_array_equal(one.size_px, other.size_px)
            np.testing.assert_allclose(one.source_point, other.source_point, atol=ROUND_TRIP_PX)
            for offset in ([0, 0, 0], [40, -50, 60], [-90, 20, 0]):
                self.assert_seen(one, rig.isocenter_point + offset, other.project(rig.isocenter_point + offset), ROUND_TRIP_PX)

    def test_is_read_back_as_it_was_written_and_told_by_its_content(self):
        for one in WRITTEN:
            with self.subTest(one.name):
                rig = writable_rig(one.name, self.folder)
                paths = self.written(rig, one.name)
                self.assertEqual(len(paths), 2 if one.holds_one else 1)
                self.assert_same(formats.read_rig(paths, options_for(rig))[0], rig)
                for path in paths:
                    found = [other.name for other in formats.CAMERAS if other.is_this(Source(path))]
                    self.assertEqual(found, [one.name], "the order of the table must not matter")

    def test_mirrored_cameras_are_kept_or_refused(self):
        for one in WRITTEN:
            with self.subTest(one.name):
                rig = writable_rig(one.name, self.folder)
                rig = rig if rig.cameras[0].is_mirrored else mirrored(rig)
                try:
                    paths = self.written(rig, one.name)
                except InputError as error:
                    self.assertIn("mirrored", str(error))
                    continue
                back, self.notes = formats.read_rig(paths, options_for(rig))
                self.assert_noted("mirrored")
                self.assert_same(back, rig)

    def test_distortion_is_kept_or_refused(self):
        for one in WRITTEN:
            with self.subTest(one.name):
                rig = writable_rig(one.name, self.folder)
                rig.cameras[0].distortion = np.array([-0.35, 0.12, 0.004, -0.003, 0.05, 0, 0, 0])
                rig.cameras[1].distortion = np.array([0.3, -0.1, 0.002, 0.001, 0.02, 0.5, 0.1, -0.05])
                if not one.states_distortion:
                    with self.assert_input_error("cannot state the distortion"):
                        files_of(rig, one.name, self.folder)
                    continue
                back = formats.read_rig(self.written(rig, one.name), options_for(rig))[0]
                for camera, other in zip(back.cameras, rig.cameras):
                    np.testing.assert_array_equal(camera.distortion, other.distortion)

    def test_a_rig_keeps_every_bit(self):
        rig = oblique_rig([5.1, -7.2, 11.3])
        back = formats.read_rig(self.written(rig, "rig"), RigOptions())[0]
        for camera, other in zip(back.cameras, rig.cameras):
            for key in ("source_point", "detector_origin_point", "column_direction", "row_direction", "pixel_spacing_mm"):
                np.testing.assert_array_equal(getattr(camera, key), getattr(other, key))

    def test_unknown_files_are_refused(self):
        self.assert_refused(FileError, "states no camera in a known format; tried: rig, ", "A file of no cameras.\n")
        with self.assertRaises(FileError):
            formats.read_rig([self.file("A file of no cameras.\n")], RigOptions(), "mayacam2")
        self.assert_refused(FileError, "is empty", "  \n")
        self.assert_refused(InputError, "more than 8 MiB", "1 2 3 4\n" * (1 << 20) + "1")


class Completion(unittest.TestCase):
    """How rigs are completed from files that state nothing but rays."""

    def setUp(self):
        self.stated = StatedRig([StatedCamera(camera, has_name=True, has_spacing=False) for camera in c_arm_rig().cameras],
                                file="dir/cam.txt")

    def complete(self, *stated, **options):
        return completed_rig(list(stated) or [self.stated], RigOptions(**options))

    def assert_refused(self, pattern, *stated, **options):
        with self.assertRaisesRegex(InputError, pattern):
            self.complete(*stated, **options)

    def test_the_isocentre_is_the_nearest_point_of_the_central_rays(self):
        rig, notes = self.complete()
        np.testing.assert_allclose(rig.isocenter_point, [0, 0, 0], atol=1e-9)
        self.assertAlmostEqual(rig.cameras[0].source_detector_mm, 975, 9)  # 1.5 times the 650 mm from the source
        self.assertEqual([any(word in note for note in notes) for word in ("isocentre", "pixel spacing", "LAT")], [True] * 3)
        # For skew rays it is the middle of the shortest segment between them.
        lat = self.stated.cameras[1].camera
        lat.source_point, lat.detector_origin_point = lat.source_point + [0, 0, 4], lat.detector_origin_point + [0, 0, 4]
        np.testing.assert_allclose(self.complete()[0].isocenter_point, [0, 0, 2], atol=1e-9)

    def test_options_state_what_files_leave_open(self):
        for stated in self.stated.cameras:
            stated.has_size = False
        rig, notes = self.complete(names=["one", "two"], size_px=[300, 200], pixel_spacing_mm=[1.190625, 1.190625],
                                   isocenter_point=[1, 2, 3])
        self.assertEqual(notes, [])
        self.assertEqual(rig.cameras[1].name, "two")
        np.testing.assert_array_equal(rig.cameras[0].size_px, [300, 200])
        self.assertAlmostEqual(rig.cameras[0].source_detector_mm, 1020, 9)

    def test_units_scale_the_room_not_the_detector(self):
        rig, _ = self.complete(unit_mm=10.0, pixel_spacing_mm=[1.190625, 1.190625])
        np.testing.assert_allclose(rig.cameras[0].source_point, [0, -6500, 0], atol=1e-9)
        self.assertAlmostEqual(rig.cameras[0].source_detector_mm, 1020, 9)

    def test_cameras_are_named_after_their_files(self):
        first, second = self.stated.cameras
        first.has_name = second.has_name = False
        rig, _ = self.complete(StatedRig([first], file="dir/cam 1.txt"), StatedRig([second], file="other/cam 1.txt"))
        self.assertEqual([camera.name for camera in rig.cameras], ["cam_1", "cam_1-2"])

    def test_what_is_missing_is_asked_for_by_name(self):
        lone = copy.deepcopy(self.stated.cameras[0])
        lone.camera.detector_origin_point = lone.camera.detector_origin_point - lone.camera.source_point
        lone.camera.source_point = np.zeros(3)  # its central ray begins at the origin
        self.assert_refused("--rig-isocenter-point", StatedRig([lone]))
        self.assert_refused("no camera", StatedRig([]))
        self.stated.cameras[1].has_size = False
        self.assert_refused("camera 'LAT': the size")

    def test_what_contradicts_the_files_is_refused(self):
        for pattern, options in (
                ("--rig-size-px", dict(size_px=[1, 2])), ("as many as there are cameras: 2", dict(names=["one"])),
                ("file name", dict(names=["one", "a/b"])), ("unique", dict(names=["one", "one"])),
                ("must agree with the file", dict(pixel_spacing_mm=[0.5, 0.6])),
                ("in front of the source", dict(isocenter_point=[0, -2000, 0])),
                ("must not be given", dict(detector_origin_mm=[0, 0]))):
            self.assert_refused(pattern, **options)
        self.stated.isocenter_point = np.zeros(3)
        self.assert_refused("must be that of", isocenter_point=[0, 0, 1])
        for stated in self.stated.cameras:
            stated.has_spacing = True
        self.assert_refused("--rig-pixel-spacing-mm", pixel_spacing_mm=[0.5, 0.5])
        self.assert_refused("lengths are mm", unit_mm=10.0)


if __name__ == "__main__":
    unittest.main()
