# SPDX-License-Identifier: Apache-2.0
"""The Python module against what the programs make of a small study (make_library_study).

AF_LIBRARY_STUDY names the study's folder. Bits are compared, not values.
"""

import ast
import copy
import gc
import inspect
import multiprocessing
import os
import pickle
import re
import subprocess
import tempfile
import threading
import unittest
import warnings
from pathlib import Path

import numpy as np

import attenuation_fields as af

STUDY = Path(os.environ["AF_LIBRARY_STUDY"])
ROTATION_DEG = (2.0, -1.5, 3.0)
TRANSLATION_MM = (4.0, -5.0, 6.0)
PARAMETERS = np.array([*ROTATION_DEG, *TRANSLATION_MM])
PIVOT_ROOM_MM = (3.0, -2.0, 1.0)


def last_floats(name, shape):
    """The pixels of an image file: its last bytes."""
    values = np.frombuffer((STUDY / name).read_bytes()[-4 * int(np.prod(shape)) :], dtype="<f4")
    return values.reshape(shape)


def run_program(name, *arguments):
    program = Path(os.environ["AF_PROGRAMS"], name)
    subprocess.run([program, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)


def open_field(camera="AP", **options):
    return af.Field.open(STUDY / f"{camera}.af.h5", **options)


class FieldTest(unittest.TestCase):
    def assert_same_bits(self, first, second):
        self.assertEqual(first.dtype, second.dtype)
        self.assertEqual(first.shape, second.shape)
        self.assertEqual(first.tobytes(), second.tobytes())

    def test_drr_of_an_atlas_and_of_a_beam_are_those_of_the_program(self):
        atlas = af.Field.open(STUDY / "AP.atlas.af.h5")
        self.assertGreater(atlas.members, 1)
        self.assert_same_bits(
            atlas.drr((2.0, -1.5, 7.0), TRANSLATION_MM), last_floats("atlas.mha", atlas.shape)
        )
        beam = {"tube_kvp": 80.0, "aluminium_mm": 2.0, "scatter_to_primary": 0.2}
        field = open_field(**beam)
        self.assert_same_bits(
            field.drr(ROTATION_DEG, TRANSLATION_MM), last_floats("field-beam.mha", field.shape)
        )
        rig = af.Rig.read(str(STUDY / "rig.toml"))
        caster = af.RayCaster(
            af.Ct.read(STUDY / "ct.nii.gz"),
            rig.camera("LAT"),
            isocenter_point=rig.isocenter_point,
            **beam,
        )
        self.assert_same_bits(
            caster.drr(ROTATION_DEG, TRANSLATION_MM), last_floats("cast-beam.mha", caster.shape)
        )

    def test_drr_is_that_of_the_program(self):
        field = open_field()
        expected = last_floats("field.mha", field.shape)
        self.assertGreater(expected.max(), 0.5)
        drr = field.drr(rotation_deg=ROTATION_DEG, translation_mm=TRANSLATION_MM)
        self.assert_same_bits(drr, expected)
        self.assert_same_bits(
            field.drr(pose=field.frame.pose(ROTATION_DEG, TRANSLATION_MM)), expected
        )
        self.assert_same_bits(
            open_field(look_up="cubic").drr(ROTATION_DEG, TRANSLATION_MM),
            last_floats("cubic.mha", field.shape),
        )

    def test_gradient_is_that_of_the_optimisers(self):
        field = open_field()
        pose = field.frame.pose(ROTATION_DEG, TRANSLATION_MM)
        drr, gradient = field.drr_and_motion_gradient(pose, PIVOT_ROOM_MM)
        expected = last_floats("motion-gradient.f32", (7, *field.shape))
        self.assert_same_bits(drr, expected[0].copy())
        self.assert_same_bits(gradient, expected[1:].copy())

    def test_gradient_by_parameters_is_the_motions_gradient_turned(self):
        field = open_field()
        drr, gradient = field.drr_and_gradient(ROTATION_DEG, TRANSLATION_MM)
        self.assert_same_bits(drr, field.drr(ROTATION_DEG, TRANSLATION_MM))
        pivot = field.frame.center_room_mm + TRANSLATION_MM
        pose = field.frame.pose(ROTATION_DEG, TRANSLATION_MM)
        _, motion = field.drr_and_motion_gradient(pose, pivot)
        self.assert_same_bits(gradient[3:], motion[3:])
        rx, ry, rz = np.radians(ROTATION_DEG)
        about_z = np.array([[np.cos(rz), -np.sin(rz), 0], [np.sin(rz), np.cos(rz), 0], [0, 0, 1]])
        about_y = np.array([[np.cos(ry), 0, np.sin(ry)], [0, 1, 0], [-np.sin(ry), 0, np.cos(ry)]])
        axes = np.stack([about_z @ about_y @ [1, 0, 0], about_z @ [0, 1, 0], [0, 0, 1]])
        expected = np.radians(np.einsum("ka,ahw->khw", axes, motion[:3].astype(np.float64)))
        np.testing.assert_allclose(gradient[:3], expected, atol=1e-6)

    def test_batches_have_the_bits_of_single_calls_on_any_threads(self):
        parameters = PARAMETERS * np.linspace(-1.0, 1.0, 7)[:, None]
        single = open_field()
        expected = np.stack([single.drr(p[:3], p[3:]) for p in parameters])
        for threads in (1, 3):
            field = open_field(threads=threads)
            self.assertEqual(field.threads, threads)
            self.assert_same_bits(field.drrs(parameters), expected)
            poses = np.stack([field.frame.pose(p[:3], p[3:]) for p in parameters])
            self.assert_same_bits(field.drrs(poses=poses), expected)
            drrs, gradients = field.drrs_and_gradients(parameters)
            self.assert_same_bits(drrs, expected)
            self.assert_same_bits(
                gradients[2], single.drr_and_gradient(parameters[2, :3], parameters[2, 3:])[1]
            )

    def test_outputs_are_written_into_where_they_are_given(self):
        field = open_field()
        out = np.full(field.shape, np.nan, dtype=np.float32)
        self.assertIs(field.drr(ROTATION_DEG, TRANSLATION_MM, out=out), out)
        self.assert_same_bits(out, field.drr(ROTATION_DEG, TRANSLATION_MM))
        stack = np.empty((3, *field.shape), dtype=np.float32)
        self.assertEqual(field.drr(out=stack[1]).ctypes.data, stack[1].ctypes.data)
        gradient = np.empty((6, *field.shape), dtype=np.float32)
        self.assertIs(field.drr_and_gradient(out=out, gradient_out=gradient)[1], gradient)
        read_only = np.empty(field.shape, dtype=np.float32)
        read_only.flags.writeable = False
        for wrong in (
            np.empty(field.shape),
            np.empty(field.shape[::-1] + (1,), dtype=np.float32),
            np.empty((field.shape[0], 2 * field.shape[1]), dtype=np.float32)[:, ::2],
            read_only,
            self.unaligned(field.shape, np.float32),
            [[0.0]],
        ):
            with self.assertRaises(af.InputError):
                field.drr(out=wrong)
        both = np.empty((6, *field.shape), dtype=np.float32)
        for shared in (both[0], both[5]):
            with self.assertRaisesRegex(af.InputError, "overlap"):
                field.drr_and_gradient(out=shared, gradient_out=both)
        stack = np.empty((7, *field.shape), dtype=np.float32)
        for image, planes in ((stack[0], stack[1:]), (stack[6], stack[:6])):
            self.assertIs(field.drr_and_gradient(out=image, gradient_out=planes)[0], image)

    @staticmethod
    def unaligned(shape, dtype):
        count = int(np.prod(shape)) * np.dtype(dtype).itemsize
        return np.zeros(count + 1, dtype=np.uint8)[1:].view(dtype).reshape(shape)

    def test_outputs_outlive_their_field(self):
        drr = open_field().drr(ROTATION_DEG, TRANSLATION_MM)
        copy = drr.copy()
        gc.collect()
        self.assertTrue(drr.flags.owndata)
        self.assert_same_bits(drr, copy)

    def test_other_threads_of_python_run_during_a_call(self):
        caster = af.RayCaster(
            af.Ct.read(STUDY / "ct.nii.gz"), open_field().camera, frame=open_field().frame, step_mm=0.01
        )
        parameters = np.tile(PARAMETERS, (24, 1))  # a second or so
        begun = threading.Event()
        ended = threading.Event()

        def work():
            begun.set()
            caster.drrs(parameters)
            ended.set()

        caller = threading.Thread(target=work)
        caller.start()
        begun.wait()
        rounds = 0
        while not ended.wait(0.001):
            rounds += 1
        caller.join()
        # If the call kept the interpreter to itself, there would be time for only a round or two before it.
        self.assertGreater(rounds, 10)

    def test_threads_of_python_get_the_same_bits(self):
        field = open_field()
        expected = field.drr(ROTATION_DEG, TRANSLATION_MM)
        found = [None] * 4

        def work(index):
            for _ in range(20):
                found[index] = field.drr(ROTATION_DEG, TRANSLATION_MM)

        callers = [threading.Thread(target=work, args=(i,)) for i in range(len(found))]
        for caller in callers:
            caller.start()
        for caller in callers:
            caller.join()
        for drr in found:
            self.assert_same_bits(drr, expected)

    def test_poses_outside_are_refused_or_zero(self):
        with self.assertRaisesRegex(af.InputError, "pose 0 = outside the field: ") as caught:
            open_field().drr(translation_mm=(300.0, 0.0, 0.0))
        self.assertEqual(caught.exception.exit_code, 3)
        self.assertIsInstance(caught.exception, ValueError)
        drr = open_field(outside="zero").drr(translation_mm=(300.0, 0.0, 0.0))
        self.assertEqual(drr.shape, open_field().shape)
        with self.assertRaisesRegex(af.InputError, "raise or zero"):
            open_field(outside="guess")

    def test_a_field_tells_what_it_is(self):
        field = open_field()
        self.assertEqual((field.look_up, field.max_translation_mm), ("linear", 12.0))
        self.assertEqual(field.camera.name, "AP")
        ct = af.Ct.read(STUDY / "ct.nii.gz")
        self.assertEqual(field.ct_content_sha256, ct.content_sha256)
        self.assertTrue(field.is_of(ct))
        moved = af.Ct(ct.hu, ct.spacing_mm, ct.origin_mm + (7.0, 0.0, 0.0), ct.direction)
        self.assertFalse(field.is_of(moved))

    def test_pose_parameters_come_back(self):
        frame = open_field().frame
        np.testing.assert_allclose(
            frame.parameters(frame.pose(ROTATION_DEG, TRANSLATION_MM)), PARAMETERS, atol=1e-12
        )
        about = af.PoseFrame.about(frame.pose(ROTATION_DEG, TRANSLATION_MM), (1.0, 2.0, 3.0))
        np.testing.assert_allclose(about.center_ct_mm, (1.0, 2.0, 3.0))


class ErrorsTest(unittest.TestCase):
    def test_files_that_are_none_are_file_errors_with_the_programs_text(self):
        with self.assertRaisesRegex(af.FileError, "rig.toml: is not an HDF5 file") as caught:
            af.Field.open(STUDY / "rig.toml")
        self.assertEqual(caught.exception.exit_code, 4)
        self.assertIsInstance(caught.exception, OSError)
        with self.assertRaisesRegex(af.FileError, "none.nii"):
            af.Ct.read("none.nii")

    def test_shapes_and_values_are_named(self):
        field = open_field()
        for call, text in (
            (lambda: field.drr(pose=np.eye(3)), r"pose: shape = \(3, 3\): must be \(4, 4\)"),
            (lambda: field.drr(pose=2.0 * np.eye(4)), "pose: "),
            (lambda: field.drr((1, 0, 0), pose=np.eye(4)), "several ways"),
            (lambda: field.drrs(np.zeros((2, 5))), r"must be \(n, 6\)"),
            (lambda: field.drrs(), "use one of parameters and poses"),
            (lambda: field.drr(rotation_deg=(float("nan"), 0, 0)), "rotation_deg"),
            (
                lambda: field.drr_and_motion_gradient(np.eye(4), (float("nan"), 0, 0)),
                "pivot_room_mm",
            ),
            (lambda: field.drr_and_motion_gradient(np.eye(4), (0, 2e6, 0)), "pivot_room_mm"),
            (lambda: open_field(threads=-1), "threads = -1"),
            (lambda: af.psnr_db(np.ones((2, 3)), np.ones((3, 2))), r"drr: shape = \(2, 3\)"),
            (
                lambda: af.mean_tre_mm(np.eye(4), np.eye(4), ((0, 0, 0), (1e9, 1e9, 1e9))),
                "target_box_ct_mm",
            ),
            (lambda: open_field(look_up="psychic"), "linear"),
        ):
            with self.assertRaisesRegex(af.InputError, text):
                call()

    def test_every_argument_of_numbers_is_named_with_what_is_expected_and_found(self):
        field = open_field()
        frame = field.frame
        camera = field.camera
        rest = ((0, 0, 0), (0, 500, 0), (1, 0, 0), (0, 0, 1), (1, 1), (64, 64))
        names = (
            "source_point", "detector_origin_point", "column_direction", "row_direction",
            "pixel_spacing_mm", "size_px",
        )

        def camera_with(name, value):
            given = dict(zip(names, rest))
            given[name] = value
            return af.Camera("A", **given)

        voxels = np.zeros((2, 3, 4), np.int16)
        calls = {
            "rotation_deg": (3, lambda x: field.drr(x)),
            "translation_mm": (3, lambda x: field.drr_and_gradient((0, 0, 0), x)),
            "pose": ((4, 4), lambda x: field.drr(pose=x)),
            "pivot_room_mm": (3, lambda x: field.drr_and_motion_gradient(np.eye(4), x)),
            "parameters": ((-1, 6), field.drrs),
            "poses": ((-1, 4, 4), lambda x: field.drrs(poses=x)),
            "nominal": ((4, 4), lambda x: af.PoseFrame.about(x, (0, 0, 0))),
            "center_ct_mm": (3, lambda x: af.PoseFrame.about(np.eye(4), x)),
            "room_point": (3, camera.project),
            "isocenter_point": (3, lambda x: af.Rig([camera], x)),
            "pixels_from_room": (
                (3, 4), lambda x: af.Camera.from_projection_matrix("A", x, (1, 1), (8, 8))
            ),
            "hu": ((-1, -1, -1), lambda x: af.Ct(x, (1, 1, 1))),
            "spacing_mm": (3, lambda x: af.Ct(voxels, x)),
            "origin_mm": (3, lambda x: af.Ct(voxels, (1, 1, 1), x)),
            "direction": ((3, 3), lambda x: af.Ct(voxels, (1, 1, 1), (0, 0, 0), x)),
            "gold": ((4, 4), lambda x: af.mean_tre_mm(np.eye(4), x, ((0, 0, 0), (1, 1, 1)))),
            "target_box_ct_mm": ((2, 3), lambda x: af.mean_tre_mm(np.eye(4), np.eye(4), x)),
            "tre_mm": ((-1,), af.success_rate),
            "drr": ((2, 3), lambda x: af.psnr_db(x, np.ones((2, 3)))),
        }
        for name, size in zip(names, (3, 3, 3, 3, 2, 2)):
            calls[name] = (size, lambda x, name=name: camera_with(name, x))
        for name, (shape, call) in calls.items():
            shape = shape if isinstance(shape, tuple) else (shape,)
            expected = str(shape).replace("-1", "n")
            right = tuple(2 if extent < 0 else extent for extent in shape)
            for wrong, found in (
                (np.zeros(right + (5,)), f"shape = {right + (5,)}: must be {expected}"),
                (7.0, f"shape = (): must be {expected}"),
                (np.zeros(right, complex), "complex128: must be an array of real numbers"),
                ("text", "str of "),
                ([[1.0], [2.0, 3.0]], "list: must be an array of real numbers"),
                (np.full(right, "x", object), "of other objects than numbers"),
            ):
                with self.subTest(name, wrong=found):
                    with self.assertRaisesRegex(af.InputError, rf"^{name}(:| =) ") as caught:
                        call(wrong)
                    self.assertIn(found, str(caught.exception))
        with self.assertRaisesRegex(af.InputError, r"^size_px = 64.5: must be whole numbers"):
            camera_with("size_px", (64.5, 64))
        with self.assertRaisesRegex(af.InputError, r"^out = float64 \(2, 2\): must be float32 in C order"):
            field.drr(out=np.zeros((2, 2)))

    def test_cameras_that_cannot_be_are_refused(self):
        good = {
            "name": "A",
            "source_point": (0, -700, 0),
            "detector_origin_point": (-126, 400, 126),
            "column_direction": (1, 0, 0),
            "row_direction": (0, 0, -1),
            "pixel_spacing_mm": (4, 4),
            "size_px": (64, 64),
        }
        for name, value, text in (
            ("column_direction", (2, 0, 0), "column_direction = .*: must have length 1"),
            ("row_direction", (0.6, 0, 0.8), "must be orthogonal to column_direction"),
            ("pixel_spacing_mm", (0, 1), "pixel_spacing_mm = "),
            ("pixel_spacing_mm", (float("nan"), 1), "pixel_spacing_mm = "),
            ("size_px", (0, 64), "size_px = "),
            ("source_point", (0, float("inf"), 0), "source_point = "),
            ("source_point", (0, 400, 0), "must not lie on the detector plane"),
            ("name", "", "name = "),
        ):
            with self.assertRaisesRegex(af.InputError, text):
                af.Camera(**{**good, name: value})
            camera = af.Camera(**good)
            if "orthogonal" in text:
                camera.row_direction = value
                with self.assertRaisesRegex(af.InputError, text):
                    camera.project((0, 0, 0))
                continue
            with self.assertRaisesRegex(af.InputError, text):
                setattr(camera, name, value)
            np.testing.assert_array_equal(getattr(camera, name), good[name])
        camera = af.Camera(**good)
        with self.assertRaisesRegex(af.InputError, "unique"):
            af.Rig([camera, camera])

    def test_errors_name_arguments_of_python(self):
        with self.assertRaises(af.InputError) as caught:
            af.register(STUDY / "study.toml")
        self.assertIn('give fields={"AP": "FIELD.h5"}', str(caught.exception))
        self.assertIn("or renderer=raycast", str(caught.exception))
        self.assertNotIn("--", str(caught.exception))
        with self.assertRaises(af.InputError) as caught:
            af.register(STUDY / "study.toml", renderer="raycast", correct=True)
        self.assertIn("correct = set: must not be given with renderer raycast", str(caught.exception))

    def test_fields_of_swapped_cameras_are_told(self):
        swapped = {"AP": STUDY / "LAT.af.h5", "LAT": STUDY / "AP.af.h5"}
        with self.assertRaisesRegex(
            af.FileError, r"LAT\.af\.h5: this is the field of camera 'LAT', not of camera 'AP'"
        ):
            af.register(STUDY / "study.toml", fields=swapped)

    def test_texts_that_are_not_utf8_are_still_errors_warnings_and_cells(self):
        with tempfile.TemporaryDirectory() as folder:
            name = os.fsencode(folder) + b"/caf\xe9.csv"
            with self.assertRaisesRegex(af.FileError, r"caf\\xe9\.csv"):
                af.Table.read(os.fsdecode(name))
            Path(os.fsdecode(name)).write_bytes(b"name\nn\xe9e\n")
            table = af.Table.read(os.fsdecode(name))
            self.assertEqual(os.fsencode(table.texts("name")[0]), b"n\xe9e")
            ct = os.fsencode(folder) + b"/caf\xe9.nrrd"
            Path(os.fsdecode(ct)).write_bytes(
                b"NRRD0004\ntype: short\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n"
                b"endian: little\nspacings: 1 1 1\n\n" + np.arange(8, dtype="<i2").tobytes()
            )
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                af.Ct.read(os.fsdecode(ct))
            self.assertIn(r"caf\xe9.nrrd", str(caught[0].message))


class CtTest(unittest.TestCase):
    def test_ray_casting_is_that_of_the_program(self):
        ct = af.Ct.read(STUDY / "ct.nii.gz")
        rig = af.Rig.read(STUDY / "rig.toml")
        camera = rig.camera("LAT")
        drr = af.ray_cast(
            ct, camera, ROTATION_DEG, TRANSLATION_MM, isocenter_point=rig.isocenter_point
        )
        self.assertEqual(drr.tobytes(), last_floats("cast.mha", drr.shape).tobytes())

    def test_voxels_are_shared_both_ways(self):
        ct = af.Ct.read(STUDY / "ct.nii.gz")
        self.assertEqual(ct.hu.shape, tuple(ct.size)[::-1])
        first, second = ct.hu, ct.hu  # both are held, because copies might get the same memory in turn
        self.assertEqual(first.ctypes.data, second.ctypes.data)
        self.assertFalse(ct.hu.flags.writeable)
        voxels = ct.hu.copy()
        again = af.Ct(voxels, ct.spacing_mm, ct.origin_mm, ct.direction)
        self.assertEqual(again.hu.ctypes.data, voxels.ctypes.data)
        self.assertEqual(again.content_sha256, ct.content_sha256)
        rig = af.Rig.read(STUDY / "rig.toml")
        drr = af.ray_cast(
            again, rig.camera("LAT"), ROTATION_DEG, TRANSLATION_MM,
            isocenter_point=rig.isocenter_point,
        )
        self.assertEqual(drr.tobytes(), last_floats("cast.mha", drr.shape).tobytes())

    def test_voxels_outlive_the_names_of_their_owners(self):
        hu = af.Ct.read(STUDY / "ct.nii.gz").hu
        copy = hu.copy()
        gc.collect()
        self.assertTrue((hu == copy).all())
        ct = af.Ct(copy, (3.0, 3.0, 3.0))
        expected = int(copy.sum(dtype=np.int64))
        del copy
        gc.collect()
        self.assertEqual(int(ct.hu.sum(dtype=np.int64)), expected)

    def test_arrays_that_are_no_ct_are_refused(self):
        voxels = np.zeros((4, 5, 6), dtype=np.int16)
        with self.assertRaisesRegex(af.InputError, "spacing"):
            af.Ct(voxels, (1.0, -1.0, 1.0))
        with self.assertRaisesRegex(af.InputError, "hu: shape"):
            af.Ct(voxels[0], (1.0, 1.0, 1.0))
        with self.assertRaisesRegex(af.InputError, "orthonormal"):
            af.Ct(voxels, (1.0, 1.0, 1.0), direction=2.0 * np.eye(3))

    def test_voxels_that_int16_holds_exactly_are_converted(self):
        voxels = np.arange(-60, 60, dtype=np.int16).reshape(4, 5, 6)
        expected = af.Ct(voxels, (1, 1, 1)).content_sha256
        unaligned = FieldTest.unaligned(voxels.shape, np.int16)
        unaligned[...] = voxels
        wide = np.repeat(voxels, 2, axis=2)
        for given in (
            *(voxels.astype(kind) for kind in (">i2", "i1", "i4", ">i4", "i8", "f2", "f4", ">f8", "O")),
            np.asfortranarray(voxels),
            wide[:, :, ::2],
            voxels[::-1, ::-1, ::-1][::-1, ::-1, ::-1],
            unaligned,
            voxels.tolist(),
        ):
            self.assertEqual(af.Ct(given, (1, 1, 1)).content_sha256, expected)
        for dtype, value, found in (
            (np.float32, 0.5, "0.5"),
            (np.float64, np.nan, "nan"),
            (np.float64, -np.inf, "-inf"),
            (np.float64, 1e300, "1e\\+300"),
            (np.uint16, 32768, "32768.0"),
            (np.uint64, 2**64 - 1, "1.8"),
            (np.int32, -32769, "-32769.0"),
        ):
            wrong = np.zeros((4, 5, 6), dtype)
            wrong[1, 2, 3] = value
            with self.assertRaisesRegex(
                af.InputError, rf"^hu = {found}.* at \(k, j, i\) = \(1, 2, 3\): .* int16"
            ):
                af.Ct(wrong, (1, 1, 1))

    def test_cameras_go_through_their_matrix(self):
        camera = af.Rig.read("c-arm-12in").camera("LAT")
        points = np.array([[0, 0, 0], [30, 0, 0], [0, 40, 0], [0, 0, 50], [11, -7, 5], [-9, 3, 21.0]])
        rows = []
        for point in points:
            column, row = camera.project(point)
            x = np.append(point, 1.0)
            rows.append(np.concatenate([x, np.zeros(4), -column * x]))
            rows.append(np.concatenate([np.zeros(4), x, -row * x]))
        matrix = np.linalg.svd(np.array(rows))[2][-1].reshape(3, 4)
        # Rounding gives the linear estimate some skew, and its scale is free.
        again = af.Camera.from_projection_matrix(
            "again", matrix / np.linalg.norm(matrix), camera.pixel_spacing_mm, camera.size_px
        )
        np.testing.assert_allclose(again.source_point, camera.source_point, atol=1e-4)
        rig = af.Rig([camera, again])
        with tempfile.NamedTemporaryFile("w", suffix=".toml") as file:
            file.write(rig.to_toml())
            file.flush()
            read = af.Rig.read(file.name)
        self.assertEqual(read.camera("again").source_point.tobytes(), again.source_point.tobytes())


class RegistrationTest(unittest.TestCase):
    fields = {"AP": STUDY / "AP.af.h5", "LAT": STUDY / "LAT.af.h5"}
    start = {"rotation_deg": (-1.0, 0.5, 2.5), "translation_mm": (0.5, 1.0, 4.0)}

    def test_every_preset_ends_where_the_program_ends(self):
        self.assertEqual(sorted(af.preset_names()), ["bone", "fast", "paper", "robust"])
        for preset in af.preset_names():
            with self.subTest(preset):
                found = af.register(
                    STUDY / "study.toml", preset=preset, fields=self.fields, **self.start
                )
                expected = af.read_result(STUDY / preset)
                self.assertEqual(found.verdict, expected.verdict)
                self.assertEqual(found.reason, expected.reason)
                self.assertEqual(found.tre_mm, expected.tre_mm)
                # Preset bone finds no bone's silhouette in ellipsoids, and both the module and the program say so.
                self.assertEqual(expected.room_from_ct is None, preset == "bone")
                if preset == "bone":
                    continue
                self.assertEqual(found.pose.tobytes(), expected.room_from_ct.tobytes())
                self.assertEqual(found.similarity, expected.similarity)

    def test_several_starts_and_their_errors(self):
        table = af.Table.read(STUDY / "starts.csv")
        self.assertEqual(len(table), 2)
        case = af.RegistrationCase.load(
            STUDY / "study.toml", preset="fast", fields=self.fields, threads=2
        )
        names = ("rx_deg", "ry_deg", "rz_deg", "tx_mm", "ty_mm", "tz_mm")
        starts = np.stack([table.numbers(name) for name in names], axis=1)
        found = case.run_all([case.frame.pose(start[:3], start[3:]) for start in starts])
        written = af.read_registrations(STUDY / "several" / "registrations.csv")
        for i, registration in enumerate(found):
            self.assertEqual(registration.start_index, i)
            for k, name in enumerate(names):
                self.assertAlmostEqual(registration.parameters[k], written["final_" + name][i], 6)
            self.assertAlmostEqual(registration.tre_mm, written["tre_mm"][i], 6)
            self.assertEqual(registration.stop_reason, written["stop_reason"][i])
            self.assertEqual(registration.verdict, written["verdict"][i])
            uncertainty = registration.uncertainty
            self.assertEqual(uncertainty.covariance.shape, (6, 6))
            self.assertTrue((np.linalg.eigvalsh(uncertainty.covariance) > 0.0).all())
            self.assertAlmostEqual(uncertainty.covariance[3, 5], written["cov_tx_tz"][i], 9)
            self.assertAlmostEqual(uncertainty.tre_95_mm, written["predicted_tre_95_mm"][i], 6)
            self.assertAlmostEqual(uncertainty.confidence, written["confidence"][i], 6)
        view = case.views[1]
        self.assertEqual(view.camera.name, "LAT")
        self.assertEqual(view.xray.tobytes(), last_floats("LAT.mha", view.xray.shape).tobytes())
        self.assertFalse(view.xray.flags.writeable)
        self.assertEqual(len(view.roi_px), 4)
        self.assertIsNone(view.mask)
        self.assertAlmostEqual(case.tre_mm(case.gold), 0.0)
        self.assertGreater(case.similarity(case.gold), case.similarity(case.frame.pose()))

    def test_without_a_start_the_landmarks_give_it_as_for_the_program(self):
        plain = af.RegistrationCase.load(STUDY / "study.toml", preset="fast", fields=self.fields)
        self.assertIsNone(plain.landmark_start())
        points_ct = np.array([[0, 0, 0], [30, 5, 0], [-8, 25, 3], [2, -6, 20], [-20, -9, -15.0]])
        points_room = points_ct @ plain.gold[:3, :3].T + plain.gold[:3, 3]
        lines = []
        for line in (STUDY / "study.toml").read_text().splitlines():
            lines.append(line)
            if line.startswith("target_box_ct_mm"):
                lines.append(f"landmarks_ct_mm = {points_ct.tolist()}")
            if line.startswith("camera = "):
                camera = af.Rig.read(STUDY / "rig.toml").camera(line.split('"')[1])
                seen = [list(camera.project(point)) for point in points_room]
                lines.append(f"landmarks_px = {seen}")
        with tempfile.TemporaryDirectory() as folder:
            for path in STUDY.iterdir():
                if path.name != "study.toml":
                    os.symlink(path, Path(folder, path.name))
            study = Path(folder, "study.toml")
            study.write_text("\n".join(lines) + "\n")
            case = af.RegistrationCase.load(study, preset="fast", fields=self.fields)
            start = case.landmark_start()
            self.assertLess(case.tre_mm(start), 1e-3)
            self.assertEqual(case.usual_start().tobytes(), start.tobytes())
            found = af.register(study, preset="fast", fields=self.fields)
            self.assertEqual(found.start.tobytes(), start.tobytes())
            given = af.register(study, rotation_deg=(1, 0, 0), preset="fast", fields=self.fields)
            np.testing.assert_allclose(given.start_parameters, (1, 0, 0, 0, 0, 0), atol=1e-9)
            from_arrays = af.register(
                study,
                rotation_deg=np.array([1, 0, 0]),
                translation_mm=np.array([0, 0, 0]),
                preset="fast",
                fields=self.fields,
            )
            self.assertEqual(from_arrays.start.tobytes(), given.start.tobytes())
            run_program(
                "af-register", "--study", study, "--preset", "fast", "-o", Path(folder, "out"),
                *(f"--field={name}={path}" for name, path in self.fields.items()),
            )
            expected = af.read_result(Path(folder, "out"))
            self.assertEqual(found.pose.tobytes(), expected.room_from_ct.tobytes())

    def test_a_search_finds_the_starts_of_the_program(self):
        study = STUDY / "study.toml"
        cast = af.RegistrationCase.load(study, preset="fast", renderer="raycast")
        looked_up = af.RegistrationCase.load(study, preset="fast", fields=self.fields)
        everywhere = {"modes": 3, "orientations": "any", "translation_mm": (20, 20, 20)}
        for folder, case, options in (
            ("searched", cast, everywhere), ("searched-fields", looked_up, {}),
        ):
            with self.subTest(folder):
                modes = case.search(**options)
                expected = af.read_result(STUDY / folder)
                self.assertEqual(
                    [mode.likeness for mode in modes],
                    expected.contents["start_search"]["likeness_per_start"],
                )
                index = expected.contents["start_index"]
                start = modes[index].pose
                np.testing.assert_array_equal(start, expected.contents["start_room_from_ct"])
                end = case.run(start, index)
                self.assertEqual(end.pose.tobytes(), expected.room_from_ct.tobytes())
        for options, text in (
            ({"modes": 0}, "modes = 0: must be at least 1"),
            ({"orientations": "upright"}, "orientations = upright: must be one of field"),
            ({"rotation_deg": (1, -2, 1)}, "rotation_deg = -2"),
            ({"translation_mm": (1, 2)}, r"translation_mm: shape = \(2,\): must be \(3,\)"),
            ({"orientations": "any"}, "; renderer raycast searches everywhere"),
        ):
            with self.assertRaisesRegex(af.InputError, text):
                looked_up.search(**options)

    def test_uncertainty_may_be_left_out(self):
        case = af.RegistrationCase.load(
            STUDY / "study.toml", preset="fast", fields=self.fields, no_uncertainty=True
        )
        found = case.run(case.frame.pose((-1, 0.5, 2.5), (0.5, 1, 4)))
        self.assertTrue(np.isnan(found.uncertainty.covariance).all())
        self.assertTrue(np.isnan(found.uncertainty.tre_95_mm))
        self.assertTrue(0 < found.uncertainty.confidence <= 1)

    def test_other_xrays_are_registered_and_pickled(self):
        case = af.RegistrationCase.load(STUDY / "study.toml", preset="fast", fields=self.fields)
        start = case.frame.pose((-1, 0.5, 2.5), (0.5, 1, 4))
        own = case.views[0].xray
        first = case.run(start)
        other = 0.9 * own.astype(np.float64) + 0.01 * (np.arange(own.size) % 7).reshape(own.shape)
        case.set_xray("AP", other)
        found = case.run(start)
        self.assertNotEqual(found.pose.tobytes(), first.pose.tobytes())
        self.assertEqual(case.views[0].xray.tobytes(), other.astype(np.float32).tobytes())
        sent = pickle.loads(pickle.dumps(case))
        copied = copy.copy(case)
        case.set_xrays({"AP": own, "LAT": case.views[1].xray})
        self.assertEqual(case.run(start).pose.tobytes(), first.pose.tobytes())
        for again in (sent, copied):
            self.assertEqual(again.run(start).pose.tobytes(), found.pose.tobytes())
        for wrong, message in (
            (own[:-1], "AP"), (own.T[:, :-1], "shape"), (np.full(own.shape, np.nan), "finite"),
        ):
            with self.assertRaisesRegex(af.InputError, message):
                case.set_xray("AP", wrong)
        with self.assertRaisesRegex(af.InputError, "LAT"):
            case.set_xray("PA", own)
        self.assertEqual(case.run(start).pose.tobytes(), first.pose.tobytes())

    def test_cases_share_open_fields(self):
        fields = {"AP": open_field("AP"), "LAT": STUDY / "LAT.af.h5"}
        alone = af.RegistrationCase.load(STUDY / "study.toml", preset="fast", fields=self.fields)
        start = alone.frame.pose((-1, 0.5, 2.5), (0.5, 1, 4))
        expected = alone.run(start).pose.tobytes()
        for _ in range(2):
            case = af.RegistrationCase.load(STUDY / "study.toml", preset="fast", fields=fields)
            self.assertEqual(case.run(start).pose.tobytes(), expected)
        again = pickle.loads(pickle.dumps(case))
        self.assertEqual(again.run(start).pose.tobytes(), expected)

    def test_wrong_options_are_refused_as_by_the_program(self):
        with self.assertRaisesRegex(af.InputError, "robust"):
            af.RegistrationCase.load(STUDY / "study.toml", preset="hasty")
        with self.assertRaisesRegex(af.InputError, "field = none"):
            af.RegistrationCase.load(STUDY / "study.toml", preset="fast")
        with self.assertRaisesRegex(af.InputError, "ellipsoids"):
            af.RegistrationCase.load(STUDY / "study.toml", "knee")


class PickleTest(unittest.TestCase):
    """What a user sends to another process comes back the same."""

    fields = RegistrationTest.fields

    @staticmethod
    def sent(value):
        return pickle.loads(pickle.dumps(value))

    def assert_same(self, first, second, what=""):
        """Every public property, to the bit."""
        self.assertIs(type(first), type(second), what)
        if isinstance(first, np.ndarray):
            self.assertEqual(first.dtype, second.dtype, what)
            self.assertEqual(first.tobytes(), second.tobytes(), what)
        elif isinstance(first, (list, tuple)):
            self.assertEqual(len(first), len(second), what)
            for a, b in zip(first, second):
                self.assert_same(a, b, what)
        elif type(first).__module__ == af._core.__name__:
            for name, member in vars(type(first)).items():
                if isinstance(member, property):
                    self.assert_same(getattr(first, name), getattr(second, name), name)
        else:
            self.assertEqual(repr(first), repr(second), what)

    def test_values_come_back_to_the_bit(self):
        case = af.RegistrationCase.load(STUDY / "study.toml", preset="fast", fields=self.fields)
        found = case.run(case.frame.pose((-1, 0.5, 2.5), (0.5, 1, 4)))
        rig = af.Rig.read(STUDY / "rig.toml")
        for value in (
            rig, rig.cameras[0], case.frame, af.Ct.read(STUDY / "ct.nii.gz"), found, found.uncertainty,
            *found.views, *case.views, *case.search(), af.success_rate([1.0, 3.0]),
            af.Table.read(STUDY / "starts.csv"), open_field(), case, af.read_result(STUDY / "fast"),
        ):
            with self.subTest(type(value).__name__):
                for again in (copy.copy(value), copy.deepcopy(value)):
                    self.assert_same(value, again)
                for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
                    self.assert_same(value, pickle.loads(pickle.dumps(value, protocol)))

    def test_renderers_come_back_with_their_options(self):
        ct = af.Ct.read(STUDY / "ct.nii.gz")
        camera = af.Rig.read(STUDY / "rig.toml").camera("LAT")
        plain = open_field()
        for renderer in (
            af.Field.open(
                STUDY / "AP.af.h5",
                look_up="cubic",
                threads=2,
                outside="zero",
                camera=plain.camera,
                tube_kvp=80,
            ),
            af.RayCaster(ct, camera, frame=plain.frame, step_mm=2.5, scatter_to_primary=0.1),
        ):
            again = self.sent(renderer)
            self.assertEqual(again.threads, renderer.threads)
            self.assertEqual(
                again.drr(ROTATION_DEG, (0, 90, 0)).tobytes(), renderer.drr(ROTATION_DEG, (0, 90, 0)).tobytes()
            )
            self.assertIs(copy.deepcopy(renderer), renderer)

    def test_a_field_is_found_from_another_folder_and_must_be_the_same(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "A.af.h5")
            path.write_bytes((STUDY / "AP.af.h5").read_bytes())
            before = os.getcwd()
            os.chdir(folder)
            try:
                sent = pickle.dumps(af.Field.open("A.af.h5"))
            finally:
                os.chdir(before)
            self.assertEqual(pickle.loads(sent).camera.name, "AP")
            path.write_bytes((STUDY / "LAT.af.h5").read_bytes())
            with self.assertRaisesRegex(af.FileError, "payload_sha256: expected .*, found "):
                pickle.loads(sent)

    def test_errors_come_back(self):
        for kind, code in ((af.InputError, 3), (af.FileError, 4), (af.NumericError, 5)):
            again = self.sent(kind("text"))
            self.assertEqual((type(again), str(again), again.exit_code), (kind, "text", code))
        with self.assertRaises(af.FileError) as caught:
            af.Field.open("nowhere.af.h5")
        again = self.sent(caught.exception)
        self.assertEqual((str(again), again.exit_code), (str(caught.exception), 4))

    def test_processes_share_a_batch(self):
        parameters = PARAMETERS * np.linspace(-1.0, 1.0, 4)[:, None]
        field = open_field()
        for way in ("fork", "spawn"):
            with multiprocessing.get_context(way).Pool(2) as pool:
                parts = pool.map(field.drrs, np.split(parameters, 2))
            self.assertEqual(np.concatenate(parts).tobytes(), field.drrs(parameters).tobytes())


class ResultsTest(unittest.TestCase):
    def test_columns_are_arrays(self):
        columns = af.read_registrations(STUDY / "several" / "registrations.csv")
        self.assertEqual(columns["tre_mm"].dtype, np.float64)
        self.assertEqual(list(columns["case"]), ["ellipsoids"] * 2)
        self.assertEqual(list(columns["start_index"]), [0.0, 1.0])
        self.assertEqual(list(columns["chain"]), ["fast"] * 2)

    def test_rows_of_af_evaluate_are_read(self):
        folder = Path(__file__).resolve().parent / "report_runs" / "registration"
        columns = af.read_registrations(folder / "registrations.csv")
        count = len(columns["case"])
        self.assertGreater(count, 1)
        for name, column in columns.items():
            self.assertEqual(column.shape, (count,), name)
        self.assertTrue(np.issubdtype(columns["stop_reason"].dtype, np.str_))

    def test_image_quality_is_read(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "image-quality.csv")
            path.write_text("pose_index,rx_deg,psnr_db\n0,1.5,43.25\n1,-2,nan\n")
            columns = af.read_image_quality(path)
            np.testing.assert_array_equal(columns["psnr_db"], [43.25, np.nan])
            path.write_text("pose_index,psnr_db\n0,loud\n")
            with self.assertRaisesRegex(af.FileError, r"image-quality\.csv:2"):
                af.read_image_quality(path)

    def test_results_that_are_none_are_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "result.json")
            for text, expected in (
                ("{", "is not JSON"),
                ("[1]", "is not a result.json"),
                ("[" * 100000, "is not JSON"),
                ('{"verdict": "found", "room_from_ct": [[1]]}', "room_from_ct: expected a 4x4"),
                ('{"verdict": "found", "room_from_ct": "x"}', "room_from_ct: expected a 4x4"),
                ('{"verdict": "found", "tre_mm": "far"}', "tre_mm: expected a number"),
            ):
                path.write_text(text)
                with self.assertRaisesRegex(af.FileError, expected):
                    af.read_result(folder)
            path.write_text('{"verdict": "not found", "tre_mm": null}')
            result = af.read_result(path)
            self.assertIsNone(result.room_from_ct)
            self.assertTrue(np.isnan(result.tre_mm))
        with self.assertRaisesRegex(af.FileError, "nowhere.json"):
            af.read_result("nowhere.json")

    def test_measures(self):
        moved = np.eye(4)
        moved[:3, 3] = (3.0, 4.0, 0.0)
        box = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
        self.assertAlmostEqual(af.mean_tre_mm(moved, np.eye(4), box), 5.0)
        drr = np.array([0.9, 0.6, 7.0], dtype=np.float32)
        reference = np.array([1.0, 0.5, 0.0], dtype=np.float32)
        self.assertAlmostEqual(af.psnr_db(drr, reference), 20.0, 4)
        rate = af.success_rate([0.5, 2.4, 2.6, np.nan])
        self.assertEqual((rate.trials, rate.successes, rate.rate), (4, 2, 0.5))
        self.assertTrue(0.1 < rate.low < 0.5 < rate.high < 0.9)


class StubTest(unittest.TestCase):
    """_core.pyi names what is there, with its parameters, and nothing else."""

    def setUp(self):
        self.core = af._core
        folder = Path(inspect.getfile(af)).parent
        self.assertTrue((folder / "py.typed").exists())
        self.tree = ast.parse((folder / "_core.pyi").read_text())

    def parameters_at_run_time(self, function):
        """Names in the signature that pybind11 writes into the documentation."""
        signature = function.__doc__.splitlines()[0]
        inside = signature[signature.index("(") + 1 : signature.rindex(") ->")]
        depth = 0
        names = [""]
        for character in inside:
            depth += character in "[(<{"
            depth -= character in "])>}"
            if character == "," and depth == 0:
                names.append("")
            else:
                names[-1] += character
        return [re.split("[:=]", name)[0].strip() for name in names if name.strip()]

    def check_function(self, stub, function):
        arguments = stub.args
        expected = [a.arg for a in arguments.posonlyargs + arguments.args]
        if arguments.kwonlyargs:
            expected += ["*"] + [a.arg for a in arguments.kwonlyargs]
        found = ["self" if name == "arg0" else name for name in self.parameters_at_run_time(function)]
        self.assertEqual(found, expected, stub.name)

    def test_names_and_parameters_agree(self):
        stubs = {
            node.name: node
            for node in self.tree.body
            if isinstance(node, (ast.ClassDef, ast.FunctionDef))
        }
        there = {name for name in vars(self.core) if not name.startswith("_")}
        self.assertEqual(set(stubs), there)
        for name, stub in stubs.items():
            if isinstance(stub, ast.FunctionDef):
                self.check_function(stub, getattr(self.core, name))
                continue
            members = {}
            for node in stub.body:
                if isinstance(node, ast.FunctionDef):
                    members[node.name] = node
                elif isinstance(node, ast.AnnAssign):
                    members[node.target.id] = node
            owner = getattr(self.core, name)
            public = {key for key in vars(owner) if not key.startswith("_")}
            self.assertEqual({key for key in members if not key.startswith("_")}, public, name)
            for key, node in members.items():
                member = vars(owner)[key]
                if isinstance(member, property) or not isinstance(node, ast.FunctionDef):
                    continue
                self.check_function(node, getattr(owner, key))

    def test_everything_public_is_documented_or_named(self):
        for name in af.__all__:
            self.assertTrue(hasattr(af, name), name)


if __name__ == "__main__":
    warnings.simplefilter("error")
    unittest.main()
