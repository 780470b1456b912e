# SPDX-License-Identifier: Apache-2.0
"""Poses in the formats of other programs, compared with what each convention says of points. Has every example of docs/poses.md."""
import pathlib
import re
import unittest

import numpy as np
from pydicom import dcmread
from pydicom.uid import ImplicitVRLittleEndian

from examples import *  # noqa: F403
from af_convert import autoscoper, diffdrr
from af_convert.geometry import about, inverse
from af_convert.source import Source

ROUNDING_MM = 1e-10  # products and inverses of rotations, of translations up to 1000 mm
# Decimal strings of DICOM have 16 characters: 13 digits behind the point of a rotation's element, taken to points 1000 mm away.
DICOM_MM = 1e-6
WRITTEN = [one for one in formats.POSES if one.write]
NANS = ",".join(["NaN"] * 16) + "\n"
IDENTITY = np.eye(4)
MOVED = transform(np.eye(3), [5, 0, 0])
TURNED = transform(about(2, np.pi / 2).round(), [0, 7, 0])  # a quarter turn about z, then 7 mm along y


class Poses(FileTest):
    def read(self, content, name="pose", context=None):
        poses, self.notes = formats.read_poses(self.file(content, name), context or KnownContext())
        return poses

    def pose(self, content, name="pose", context=None):
        poses = self.read(content, name, context)
        self.assertEqual(len(poses), 1)
        return poses[0][1]

    def assert_refused(self, kind, pattern, content, name="pose", context=None):
        with self.assertRaisesRegex(kind, pattern):
            self.read(content, name, context)

    def written(self, name, poses=(UNEVEN_POSE,), context=None):
        return formats.pose_file(list(enumerate(poses, 1)), name, context or KnownContext())


class EveryPoseFormat(Poses):
    def test_reads_back_and_is_told_by_content(self):
        for one in WRITTEN:
            with self.subTest(one.name):
                content = self.written(one.name)
                # Only its name tells one line of 16 numbers from a plain matrix.
                name = "a.tra" if one.name == "autoscoper" else "pose"
                np.testing.assert_allclose(self.pose(content, name), UNEVEN_POSE, rtol=0, atol=DICOM_MM)
                self.assertEqual(formats.recognised(Source(self.file(content, name)), formats.POSES).name, one.name)
                self.assertEqual(content, self.written(one.name), "the same bytes again")

    def test_texts_keep_every_bit(self):
        for name in ("toml", "matrix", "csv"):
            np.testing.assert_array_equal(self.pose(self.written(name)), UNEVEN_POSE)

    def test_several_poses_keep_their_order_or_are_refused(self):
        poses = [UNEVEN_POSE, inverse(UNEVEN_POSE), UNEVEN_POSE @ UNEVEN_POSE]
        for one in WRITTEN:
            with self.subTest(one.name):
                if one.holds_one:
                    with self.assert_input_error("number of poses = 3"):
                        self.written(one.name, poses)
                    continue
                for (number, found), (expected, pose) in zip(self.read(self.written(one.name, poses)), enumerate(poses, 1)):
                    self.assertEqual(number, expected)
                    np.testing.assert_allclose(found, pose, rtol=0, atol=ROUNDING_MM)

    def test_poses_that_are_not_rigid_are_refused(self):
        scaled = UNEVEN_POSE * [[1.01], [1.01], [1.01], [1]]
        rows = ", ".join("[" + ", ".join(map(repr, map(float, row))) + "]" for row in scaled)
        for content in (f"room_from_ct = [{rows}]\n", f'{{"room_from_ct": [{rows}]}}', " ".join(map(repr, map(float, scaled.ravel())))):
            self.assert_refused(InputError, "not rigid", content)

    def test_what_is_not_read_is_named(self):
        rows = "[[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]"
        for pattern, content in (
                ("not read: case", "case,rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\nA,1,2,3,4,5,6\n"),
                ("not read: similarity", f'{{"similarity": 1.5, "room_from_ct": {rows}}}'),
                ("not read: unit", f'room_from_ct = {rows}\nunit = "m"\n')):
            self.read(content)
            self.assert_noted(pattern)
        self.assert_refused(InputError, "'Unit'", self.written("itk") + "Unit: m\n")

    def test_a_byte_order_mark_is_no_part_of_the_text(self):
        for name in ("toml", "matrix", "csv", "itk"):
            np.testing.assert_array_equal(self.pose("\ufeff" + self.written(name)), self.pose(self.written(name)))

    def test_malformed_files_are_refused(self):
        for kind, pattern, content in (
                (FileError, "is empty", ""), (FileError, "16 numbers", "1 2 3"), (FileError, "'x'", "1 0 0 x" + " 0" * 12),
                (FileError, "is not JSON", '{"room_from_ct": [['), (InputError, "room_from_ct", "{}"),
                (InputError, "4 rows of 4", '{"room_from_ct": [1, 2]}'), (FileError, "no pose", "prose"),
                (FileError, "is not JSON", '{"a": ' + "[" * 200000), (FileError, "not valid TOML", "room_from_ct = " + "[" * 200000)):
            self.assert_refused(kind, pattern, content)


class Tables(Poses):
    header = "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\n"

    def test_six_numbers_are_relative_to_the_frame(self):
        class Framed(KnownContext):
            def frame(self, why):
                return Frame(UNEVEN_POSE, [1.0, 2.0, 3.0])
        (_, first), (_, second) = self.read("pose_index,tz_mm,ty_mm,tx_mm,rz_deg,ry_deg,rx_deg,psnr_db\n0,0,0,0,0,0,0,43\n"
                                            "1,6,5,4,3,2,1,44\n", context=Framed())
        np.testing.assert_allclose(first, UNEVEN_POSE, atol=ROUNDING_MM)
        # The centre moves by (4, 5, 6) and the rest turns about it.
        center = np.array([1, 2, 3, 1])
        np.testing.assert_allclose((second @ center - UNEVEN_POSE @ center)[:3], [4, 5, 6], atol=ROUNDING_MM)
        np.testing.assert_allclose(second[:3, :3], rotation_zyx(np.radians([1, 2, 3])) @ UNEVEN_POSE[:3, :3], atol=1e-14)

    def test_semicolons_and_decimal_commas(self):
        text = self.header.replace(",", ";") + "1,5;0;0;4,25;0;0\r\n"
        np.testing.assert_array_equal(self.pose(text), self.pose(self.header + "1.5,0,0,4.25,0,0\n"))

    def test_rows_without_a_pose_leave_a_gap(self):
        text = formats.pose_file([(1, IDENTITY), (3, MOVED)], "csv", KnownContext())
        self.assertEqual([number for number, _ in self.read(text)], [1, 3])
        self.assertTrue(text.startswith("start_index,m00"))
        self.assertEqual(self.notes, [])

    def test_errors_name_file_line_column_and_value(self):
        for kind, pattern, text in (
                (FileError, "p.csv:3: rz_deg: 'x'", self.header + "1,2,3,4,5,6\n1,2,x,4,5,6\n"),
                (FileError, "finite", self.header + "1,2,inf,4,5,6\n"), (InputError, "no poses", self.header),
                (InputError, "p.csv:1: has no column rz_deg, tz_mm", "rx_deg,ry_deg,tx_mm,ty_mm\n1,2,3,4\n"),
                (FileError, "p.csv:2: fields: expected 6, found 5", self.header + "1,2,3,4,5\n"),
                (InputError, "p.csv:2: .*not rigid", "m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23\n2,0,0,0,0,1,0,0,0,0,1,0\n")):
            self.assert_refused(kind, pattern, text, "p.csv")


class Itk(Poses):
    @staticmethod
    def text(kind, parameters, fixed):
        return f"#Insight Transform File V1.0\r\nTransform: {kind}_double_3_3\r\nParameters: {parameters}\r\nFixedParameters: {fixed}\r\n"

    def ct_from_room(self, *arguments):
        return inverse(self.pose(self.text(*arguments)))

    def test_the_text_holds_ct_from_room(self):
        text = self.written("itk")
        numbers = np.array(text.split("Parameters: ")[1].split("\n")[0].split(), dtype=float)
        point = np.array([1.0, 20.0, 300.0])
        np.testing.assert_allclose(numbers[:9].reshape(3, 3) @ (UNEVEN_POSE @ [*point, 1])[:3] + numbers[9:], point, atol=1e-11)

    def test_the_centre_is_honoured(self):
        # A quarter turn about z through (10, 0, 0), then 5 mm along x.
        matrix = self.ct_from_room("MatrixOffsetTransformBase", "0 -1 0 1 0 0 0 0 1 5 0 0", "10 0 0")
        np.testing.assert_allclose(matrix @ [11, 0, 7, 1], [15, 1, 7, 1], atol=1e-11)

    def test_euler_angles_turn_in_itks_order(self):
        # itk::Euler3DTransform: R = Rz Rx Ry, or Rz Ry Rx; all about the centre.
        x, y, z = about(0, 0.1), about(1, 0.2), about(2, 0.3)
        center, point = np.array([10.0, 20, 30]), np.array([-7.0, 80, 9])
        for fixed, rotation in (("10 20 30", z @ x @ y), ("10 20 30 0", z @ x @ y), ("10 20 30 1", z @ y @ x)):
            found = self.ct_from_room("Euler3DTransform", "0.1 0.2 0.3 4 5 6", fixed) @ [*point, 1]
            np.testing.assert_allclose(found[:3], rotation @ (point - center) + center + [4, 5, 6], atol=ROUNDING_MM)

    def test_versors_quaternions_and_translations(self):
        turn = about(2, np.radians(60))
        for kind, parameters in (("VersorRigid3DTransform", "0 0 0.5 1 2 3"),
                                 ("QuaternionRigidTransform", "0 0 0.5 0.86602540378443864676 1 2 3")):
            np.testing.assert_allclose(self.ct_from_room(kind, parameters, "0 0 0"), transform(turn, [1, 2, 3]), atol=1e-12)
        np.testing.assert_allclose(self.ct_from_room("TranslationTransform", "1 2 3", ""), transform(np.eye(3), [1, 2, 3]))

    def test_what_is_not_one_plain_rigid_transform_is_refused(self):
        good = self.written("itk")
        for kind, pattern, text in (
                (InputError, "BSplineTransform", good.replace("Affine", "BSpline")), (InputError, "_double_3_3", good.replace("_3_3", "_2_2")),
                (FileError, "number of Parameters", good.replace("\nParameters: ", "\nParameters: 1 ")),
                (FileError, "number of FixedParameters", good.replace("FixedParameters: 0 0 0", "FixedParameters: 0 0")),
                (FileError, "has no 'FixedParameters:'", good.replace("FixedParameters: 0 0 0\n", "")),
                (FileError, "finite", good.replace("FixedParameters: 0", "FixedParameters: nan")),
                (FileError, "repeated", good + good), (FileError, "has no", "#Insight Transform File V1.0\n"),
                (InputError, "not rigid", self.text("AffineTransform", "2 0 0 0 1 0 0 0 1 0 0 0", "0 0 0")),
                (InputError, "versor", self.text("VersorRigid3DTransform", "0.9 0.9 0 0 0 0", "0 0 0"))):
            self.assert_refused(kind, pattern, text)

    def test_hdf5_of_itk_5_and_4(self):
        ct_from_room = inverse(UNEVEN_POSE)
        parameters = np.concatenate([ct_from_room[:3, :3].ravel(), ct_from_room[:3, 3]])
        for word in ("Transform", "Tranform"):
            def fill(file):
                group = file.create_group("TransformGroup/0")
                group.create_dataset("TransformType", data=["AffineTransform_double_3_3"], dtype=h5py.string_dtype("ascii"))
                group[word + "Parameters"], group[word + "FixedParameters"] = parameters, np.zeros(3)
            np.testing.assert_allclose(self.pose(hdf5_bytes(fill)), UNEVEN_POSE, atol=1e-12)
        np.testing.assert_array_equal(h5py.File(self.file(self.written("itk-hdf5")))["TransformGroup/0/TransformParameters"][:], parameters)

        def gigabyte(file):
            fill(file)
            del file["TransformGroup/0/TransformType"]
            file["TransformGroup/0"].create_dataset("TransformType", shape=(1,), dtype="S1000000000")

        def composite(file):
            fill(file)
            file.create_group("TransformGroup/1")

        def tilted(file):
            fill(file)
            file["TransformGroup/0/Tilt"] = 3.0
        self.assert_refused(FileError, "TransformType", hdf5_bytes(gigabyte))
        self.assert_refused(InputError, "several transforms", hdf5_bytes(composite))
        self.assert_refused(InputError, "Tilt", hdf5_bytes(tilted))
        self.assert_refused(FileError, "damaged HDF5|no pose|not an ITK", hdf5_bytes(fill)[:900])


class Autoscoper(Poses):
    def test_the_frame_stands_at_the_lower_left_corner_of_the_first_picture(self):
        # By hand: the centres of the corner voxels in Autoscoper's frame, as its ray caster has it.
        grid = uneven_grid()
        ct_from_volume = autoscoper.ct_from_volume(grid)
        for at, index in (([0.25, 30 * 0.75 - 0.375, -1, 1], [0, 0, 0]), ([20 * 0.5 - 0.25, 0.375, -79, 1], [19, 29, 39])):
            np.testing.assert_allclose((ct_from_volume @ at)[:3], grid.point_mm(np.array(index)), atol=ROUNDING_MM)
        grid.direction = grid.direction * [-1, 1, 1]
        with self.assert_input_error("right-handed"):
            autoscoper.ct_from_volume(grid)

    def test_frames_that_were_not_tracked_are_left_out_and_said(self):
        found = self.read(NANS + self.written("autoscoper") + NANS, "a.tra")
        self.assertEqual([number for number, _ in found], [2])
        self.assert_noted("2 of 3 frames were not tracked (NaN) and are left out: 1, 3")
        self.assert_refused(InputError, "holds no pose", NANS, "a.tra")
        self.assert_refused(FileError, "some of its numbers are NaN", "NaN 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n", "a.tra")
        self.assert_refused(InputError, "frame 1", "2 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n" + NANS, "a.tra")


class DiffDrrPoses(Poses):
    def test_the_ap_view_looks_at_the_patient_from_the_front(self):
        frame = diffdrr.Frame()
        pose = frame.world_from_camera(np.zeros(3), np.array([0.0, 850, 0]), "")
        # Anterior is +y, right +x, head +z: the beam, columns and rows.
        np.testing.assert_allclose(pose[:3], np.column_stack([[1, 0, 0], [0, 0, 1], [0, -1, 0], [0, 850, 0]]), atol=1e-13)
        # The translation turns with the camera: a quarter about z puts the source to the patient's left.
        np.testing.assert_allclose(frame.world_from_camera(np.array([np.pi / 2, 0, 0]), np.array([0.0, 850, 0]), "")[:3, 3], [-850, 0, 0],
                                   atol=ROUNDING_MM)

    def test_the_cts_middle_is_projected_where_the_camera_does(self):
        pose = self.pose(DIFFDRR_POSE)
        # The source is 650 mm before the room's origin; the CT's middle is 10 mm to the left of the beam and 20 mm above it.
        np.testing.assert_allclose((pose @ [*uneven_grid().middle_mm, 1])[:3], [10, 0, 20], atol=ROUNDING_MM)
        np.testing.assert_allclose(pose[:3, :3], np.eye(3), atol=1e-14)

    def test_angles_of_every_order_come_back(self):
        for convention in ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"):
            frame = diffdrr.Frame(convention=convention, orientation="none")

            def turn(angles):
                return frame.world_from_camera(np.array(angles), np.zeros(3), "")[:3, :3]
            angles = [0.3, -0.4, 0.5]
            np.testing.assert_allclose(diffdrr.angles_of_convention(turn(angles), convention), angles, atol=1e-13)
            # At and beside gimbal lock the angles are not unique, or poorly known; the rotation is both.
            for beside in (0.0, 1e-15, 1e-13, 1e-9, 1e-5):
                for quarter in (-np.pi / 2, np.pi / 2):
                    locked = turn([0.3, quarter - beside, 0.5])
                    np.testing.assert_allclose(turn(diffdrr.angles_of_convention(locked, convention)), locked, atol=1e-14)

    def test_a_camera_along_the_body_keeps_the_turn_about_the_beam(self):
        camera = frontal_camera()  # from the feet to the head: gimbal lock of ZXY and AP
        camera.source_point, camera.detector_origin_point = np.array([0.0, 0, -650]), np.array([-100.0, -90, 370])
        camera.row_direction = np.array([0.0, 1, 0])
        turned, context = transform(about(2, np.radians(30)), [0, 0, 0]), KnownContext([camera])
        np.testing.assert_allclose(self.pose(self.written("diffdrr", [turned], context), context=context), turned, atol=ROUNDING_MM)

    def test_refusals(self):
        with self.assert_input_error("--camera"):
            self.written("diffdrr", context=KnownContext([frontal_camera("A"), frontal_camera("B")]))
        for old, new in (('"ZXY"', '"ZZY"'), ('"ZXY"', '"zxy"'), ('"euler_angles"', '"se3"'), ("650.0, -20.0]]", "650.0]]"),
                         ("[[10.0", "[[1.0, 2.0, 3.0], [10.0"), ("convention", "conventoin")):
            self.assert_refused(InputError, "", DIFFDRR_POSE.replace(old, new))
        self.assert_refused(InputError, "norm 1", 'diffdrr_parameterization = "quaternion"\nrotation = [[1.0, 1.0, 0, 0]]\n'
                            "translation_mm = [[1.0, 2.0, 3.0]]\n")
        mirrored = frontal_camera()
        mirrored.column_direction = -mirrored.column_direction
        self.assert_refused(InputError, "must not be mirrored", DIFFDRR_POSE, context=KnownContext([mirrored]))


class Registrations(Poses):
    def test_a_written_object_has_the_rooms_frame_and_the_cts(self):
        ours = dcmread(self.file(self.written("dicom")))
        self.assertEqual((ours.Modality, ours.file_meta.MediaStorageSOPClassUID), ("REG", "1.2.840.10008.5.1.4.1.1.66.1"))
        room, ct = ours.RegistrationSequence
        self.assertEqual((room.FrameOfReferenceUID, ct.FrameOfReferenceUID), (ours.FrameOfReferenceUID, "1.2.3.4"))
        for item, matrix in ((room, IDENTITY), (ct, UNEVEN_POSE)):
            stored = item.MatrixRegistrationSequence[0].MatrixSequence[0]
            self.assertEqual(stored.FrameOfReferenceTransformationMatrixType, "RIGID")
            np.testing.assert_allclose(np.array(stored.FrameOfReferenceTransformationMatrix, dtype=float), matrix.ravel(), atol=1e-9)

    def test_other_syntaxes_and_open_sequences(self):
        for syntax in (ExplicitVRLittleEndian, ImplicitVRLittleEndian):
            for undefined in (False, True):
                content = registration("1.1", [("1.1", "RIGID", IDENTITY), ("1.2.3.4", "RIGID", UNEVEN_POSE)], undefined, syntax=syntax)
                np.testing.assert_allclose(self.pose(content), UNEVEN_POSE, atol=1e-6)

    def test_the_rooms_own_matrix_is_taken_off(self):
        pose = self.pose(registration("1.1", [("1.2.3.4", "RIGID", TURNED), ("1.1", "RIGID", MOVED)]))
        np.testing.assert_allclose(pose @ [1, 0, 0, 1], [-5, 8, 0, 1], atol=ROUNDING_MM)

    def test_of_a_registration_to_the_ct_the_rooms_matrix_is_inverted(self):
        for frames in ([("1.2.3.4", "RIGID", IDENTITY), ("9.9", "RIGID", TURNED)], [("9.9", "RIGID", TURNED)]):
            pose = self.pose(registration("1.2.3.4", frames))
            np.testing.assert_allclose(pose @ [0, 8, 0, 1], [1, 0, 0, 1], atol=ROUNDING_MM)
            self.assertEqual(self.notes, [])

    def test_the_frame_that_is_taken_for_the_cts_is_named(self):
        content = registration("1.1", [("9.9", "RIGID", IDENTITY), ("1.1", "RIGID", IDENTITY)])
        self.read(content, context=KnownContext(ct_uid=""))
        self.assert_noted("9.9 is taken as the CT's, whose own is not known (--ct")
        self.read(content)
        self.assert_noted("which is 1.2.3.4")

    def test_a_frame_that_is_neither_the_cts_nor_the_rooms_is_named(self):
        self.read(registration("1.1", [("1.2.3.4", "RIGID", IDENTITY), ("9.9", "RIGID", MOVED)]))
        self.assert_noted("9.9 is not read")

    def test_what_is_not_one_rigid_pose_is_refused(self):
        for kind, pattern, content in (
                (InputError, "7.1, 7.2", registration("1.1", [("7.1", "RIGID", IDENTITY), ("7.2", "RIGID", IDENTITY)])),
                (InputError, "must be RIGID", registration("1.1", [("1.2.3.4", "AFFINE", IDENTITY)])),
                (FileError, "expected 16, found 2", registration("1.1", [("1.2.3.4", "RIGID", [1, 2])])),
                (InputError, "not rigid", registration("1.1", [("1.2.3.4", "RIGID", np.diag([2, 1, 1, 1]))])),
                (FileError, "has no registration", registration("1.1", [])),
                (FileError, "no matrix of the frame of reference 1.2.3.4", registration(
                    "1.1", [("1.2.3.4", "RIGID", None), ("1.1", "RIGID", None)])),
                (InputError, "1.2.3.4.*9.8, 9.9", registration("1.2.3.4", [("9.8", "RIGID", IDENTITY), ("9.9", "RIGID", IDENTITY)])),
                (InputError, "twice", registration("1.1", [("1.2.3.4", "RIGID", IDENTITY), ("1.2.3.4", "RIGID", IDENTITY)])),
                (FileError, "truncated", registration("1.1", [("1.2.3.4", "RIGID", IDENTITY)])[:-9])):
            self.assert_refused(kind, pattern, content)


class Page(Poses):
    def test_every_example_is_the_pose_that_it_describes(self):
        page = (pathlib.Path(__file__).parents[2] / "docs/poses.md").read_text(encoding="utf-8")
        examples = re.findall(r"<!-- example: (\S+) -->\n```\w*\n(.*?)```", page, re.DOTALL)
        self.assertEqual(len(examples), 6)
        grid = Grid(np.array([20, 30, 40]), np.array([0.5, 0.75, 2.0]), np.array([-4.75, -10.875, -39.0]), np.eye(3))
        for name, text in examples:
            pose = self.pose(text, name, KnownContext(grid=grid))
            for point, at in (([1, 2, 3], [8, 21, 33]), ([0, 0, 0], [10, 20, 30]), ([5, 0, 0], [10, 25, 30])):
                np.testing.assert_allclose((pose @ [*point, 1])[:3], at, atol=1e-12, err_msg=name)


if __name__ == "__main__":
    unittest.main()
