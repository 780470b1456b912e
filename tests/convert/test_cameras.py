# SPDX-License-Identifier: Apache-2.0
"""The worked examples of docs/cameras.md: where cameras from other programs' files see a point, by hand or by that program."""
import copy
import unittest

import numpy as np

from examples import *  # noqa: F403
from af_convert import rtk as rtk_format
from af_convert.geometry import about

MATRIX_OPTIONS = dict(size_px=[512, 400], isocenter_point=[0, 0, 0])
RTK_OPTIONS = dict(size_px=[512, 400], pixel_spacing_mm=[0.8, 0.8])


class MayaCam(FileTest):
    def test_mayacam2(self):
        camera = self.camera(MAYACAM2)
        np.testing.assert_allclose(camera.source_point, [1000, 0, 0], atol=1e-9)
        np.testing.assert_allclose(camera.beam_direction, [-1, 0, 0], atol=1e-12)
        self.assertFalse(camera.is_mirrored)
        # R (10, 20, 30) + t = (20, -30, 990).
        self.assert_seen(camera, [10, 20, 30], [511.5 + 5000 * 20 / 990, 383.5 - 5000 * 30 / 990])

    def test_line_ends_and_a_byte_order_mark_change_nothing(self):
        for text in (MAYACAM2, MAYACAM1):
            for other in (text.replace("\n", "\r\n"), "\ufeff" + text):
                np.testing.assert_array_equal(self.camera(other).source_point, self.camera(text).source_point)

    def test_mayacam2_refusals(self):
        for kind, pattern, text in (
                (FileError, "'rotation' is missing", MAYACAM2.replace("rotation\n", "turn\n")),
                (FileError, "truncated: 'translation'", MAYACAM2[:-5]),
                (FileError, "camera.txt:5: expected 3 numbers", MAYACAM2.replace("5000,0,511.5", "5000,0")),
                (FileError, "'one' is no number", MAYACAM2.replace("0,1,0", "0,one,0")),
                (InputError, "finite", MAYACAM2.replace("1000\n", "nan\n")),
                (InputError, "32768", MAYACAM2.replace("1024,768", "1e18,768")),
                (InputError, "rotation", MAYACAM2.replace("-1,0,0", "1,0,0")),
                (InputError, "1e6 mm", MAYACAM2.replace("1000\n", "1e9\n")),
                (InputError, "camera.txt:18: line = 'skew': is not known", MAYACAM2 + "skew\n0\n"),
                (InputError, "camera.txt:18", MAYACAM2 + "rotation\n1,0,0\n")):
            self.assert_refused(kind, pattern, text)

    def test_mayacam1(self):
        # Turned by 90 deg about x, the camera's z axis, behind it, points to -y and its y axis up, to +z. The point is 1020 mm
        # in front of it, 10 to the right, 30 up.
        camera = self.camera(MAYACAM1)
        np.testing.assert_allclose(camera.beam_direction, [0, 1, 0], atol=1e-12)
        self.assert_seen(camera, [10, 20, 30], [512 + 4000 * 10 / 1020, 767 - (300 + 4000 * 30 / 1020)])

    def test_mayacam1_turns_about_z_then_y_then_x(self):
        camera = self.camera("0,0,900\n0,0,90\n0,0,-1\n513,385,-4000\n1,1024,768\n")
        # Turned by 90 deg about z, columns run along +y and rows, downwards, along +x.
        np.testing.assert_allclose([camera.column_direction, camera.row_direction], [[0, 1, 0], [1, 0, 0]], atol=1e-12)
        oblique = self.camera("0,0,900\n10,20,90\n0,0,-1\n513,385,4000\n1,0,0\n")
        # x axis of Rz(90) Ry(20) Rx(10).
        angle = np.radians(20)
        np.testing.assert_allclose(oblique.column_direction, [0, np.cos(angle), -np.sin(angle)], atol=1e-12)
        np.testing.assert_array_equal(oblique.size_px, [1024, 1024])

    def test_mayacam1_refusals(self):
        self.assert_refused(FileError, "known format", MAYACAM1.replace("513,301,-4000\n", ""))
        self.assert_refused(InputError, "finite", MAYACAM1.replace("90,0,0", "nan,0,0"))
        self.assert_refused(InputError, "32768", MAYACAM1.replace("1024,768", "1e300,768"))
        self.assert_refused(InputError, "focal lengths", MAYACAM1.replace("-4000", "0"))


class OpenCv(FileTest):
    def assert_opencv_pixels(self, camera):
        """By cv2.projectPoints of OpenCV 4.6: rvec = (0.3, -0.2, 0.5), t = (10, -20, 900)."""
        self.assert_seen(camera, [0, 0, 0], [268.8333333333333, 175.80555555555554])
        self.assert_seen(camera, [30, -40, 55], [317.8796075813862, 132.68262579521775])
        self.assert_seen(camera, [-25, 60, -70], [208.00093808321148, 255.39893002595946])

    def assert_lens(self, camera):
        """cv2.projectPoints of OpenCV 4.6 with these coefficients."""
        stored = camera.stored_from_ideal(camera.project([30, -40, 55]))
        np.testing.assert_allclose(stored, [317.6651288, 132.91818315], atol=1e-5)

    def test_matrix_and_vector(self):
        self.assert_opencv_pixels(self.camera(OPENCV))
        begin, end = OPENCV.index("rvec:"), OPENCV.index("tvec:")
        self.assert_opencv_pixels(self.camera(OPENCV[:begin] + OPENCV_ROTATION + OPENCV[end:]))

    def test_several_cameras_in_plain_yaml(self):
        first, second = self.rig(OPENCV_PAIR).cameras
        self.assert_seen(first, [10, 20, 0], [319.5 + 1000 * 10 / 500, 239.5 + 1000 * 20 / 500])
        self.assert_seen(second, [0, 20, 30], [319.5 - 1000 * 30 / 600, 239.5 + 1000 * 20 / 600])

    def test_lists(self):
        for matrix in OPENCV_MATRICES:
            camera = self.camera(OPENCV_LISTS.format(matrix))
            self.assert_opencv_pixels(camera)
            self.assert_lens(camera)
        good = OPENCV_LISTS.format(OPENCV_MATRICES[0])
        self.assert_refused(FileError, "4, 5, 8, 12 or 14 numbers", good.replace("  - 0.05\n", "  - 0.05\n  - 1\n"))
        self.assert_refused(FileError, "is no number", good.replace("  - 4e-3\n", "  - four\n"))
        self.assert_refused(FileError, "broken YAML", good.replace("- [900]\n", "- [900\n"))

    def test_refusals(self):
        stereo = ("K1: [1000, 0, 320, 0, 1000, 240, 0, 0, 1]\nK2: [1000, 0, 320, 0, 1000, 240, 0, 0, 1]\n"
                  "R: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nt: [0, 0, 500]\n")
        nothing = "[ 0., 0., 0., 0., 0. ]"
        for kind, pattern, text in (
                (InputError, "x_camera = R x_room", OPENCV[:OPENCV.index("rvec:")]),
                (FileError, "broken YAML", OPENCV[:OPENCV.index("2.0025")]),
                (FileError, "'rows'", OPENCV.replace("   rows: 3\n", "   rows: 99999999999999\n", 1)),
                (FileError, "12 numbers", OPENCV.replace("   cols: 3\n", "   cols: 4\n", 1)),
                (InputError, "finite", OPENCV.replace("900.", "nan")),
                (InputError, "32768", OPENCV.replace("image_width: 512", "image_width: 5e9")),
                (InputError, "must not fold the image", OPENCV.replace("[ 0., 0., 0.", "[ -9.1, 0., 0.")),
                (FileError, "4, 5, 8, 12 or 14", OPENCV.replace("rows: 5", "rows: 3").replace(nothing, "[ 0.1, 0., 0. ]")),
                (InputError, "thin prisms", OPENCV.replace("rows: 5", "rows: 12").replace(
                    nothing, "[ 0, 0, 0, 0, 0, 0, 0, 0, 0.1, 0, 0, 0 ]")),
                (InputError, "relative to the first camera", stereo),
                (InputError, "distortion_model = 'equidistant'", OPENCV + "distortion_model: equidistant\n"),
                (FileError, "camera.txt:2[78]: broken YAML", OPENCV + "distortion_model equidistant\n"),
                (FileError, "there twice", OPENCV + "image_width: 512\n"),
                (FileError, "aliases", OPENCV + "a: &a [1]\nb: *a\n"),
                (FileError, "broken YAML: lists are nested too deeply", "K: " + "[" * 51),
                (FileError, "broken YAML: while|broken YAML: expected", "K: " + "[" * 50)):
            self.assert_refused(kind, pattern, text)

    def test_what_is_not_read_is_named(self):
        self.rig(OPENCV + "reprojection_error: 0.3\n")
        self.assert_noted("not read: reprojection_error")
        self.rig(OPENCV_PAIR + "T: [1, 0, 0]\n")
        self.assert_noted("not read: T")

    def test_the_only_camera_may_have_a_number(self):
        camera = self.camera("K1: [1000, 0, 320, 0, 1000, 240, 0, 0, 1]\nimage_width: 640\nimage_height: 480\n"
                             "pixel_spacing_mm: [0.5, 0.5]\nisocenter_point: [0, 0, 0]\nR: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nt: [0, 0, 500]\n")
        self.assert_seen(camera, [10, 20, 0], [320 + 1000 * 10 / 500, 240 + 1000 * 20 / 500])

    def test_names_are_utf8(self):
        self.assertEqual(self.camera(OPENCV + 'camera_name: "\u00e4"\n').name, "\u00e4")
        self.assert_refused((InputError, FileError), "UTF-8|YAML", OPENCV + 'camera_name: "\udcc3"\n')

    def test_distortion_is_kept_and_flipped_with_rows(self):
        camera = self.camera(OPENCV_LENS)
        self.assert_opencv_pixels(camera)
        self.assert_lens(camera)
        for flip in ("rows", "columns"):
            def mirror(px):
                return np.array([px[0], 399 - px[1]] if flip == "rows" else [511 - px[0], px[1]])
            flipped = self.camera(OPENCV_LENS, flip=flip)
            stored = camera.stored_from_ideal([100, 50])
            np.testing.assert_allclose(flipped.stored_from_ideal(mirror([100, 50])), mirror(stored), atol=1e-9)


class Matrices(FileTest):
    def test_matrices(self):
        # K (R | t) with K of focal length 1000 and (255.5, 199.5), R = (e_x, -e_z, e_y), t = (0, 0, 800).
        for text in (MATRIX, "-1000 -255.5 0 -204400\n0 -199.5 1000 -159600\n0 -1 0 -800\n",
                     "[[2000, 511, 0, 408800],\n[0, 399, -2000, 319200],\n[0, 2, 0, 1600]]",
                     "1000,255.5,0,204400,0,199.5,-1000,159600,0,1,0,800\n"):
            camera = self.camera(text, **MATRIX_OPTIONS)
            np.testing.assert_allclose(camera.source_point, [0, -800, 0], atol=1e-9)
            self.assert_seen(camera, [10, 20, 30], [255.5 + 1000 * 10 / 820, 199.5 - 1000 * 30 / 820])
            self.assertFalse(camera.is_mirrored)

    def test_refusals(self):
        self.assert_refused(InputError, "--rig-size-px", MATRIX)
        for kind, pattern, text in (
                (FileError, "known format", MATRIX[:60]), (InputError, "finite", MATRIX.replace("800\n", "nan\n")),
                (InputError, "singular", "0 0 0 1\n0 0 0 1\n0 0 0 1\n"),
                (InputError, "skew", MATRIX.replace("1000 255.5 0", "1000 255.5 700")),
                (InputError, "32768", "# size_px 1e30 4\n" + MATRIX)):
            self.assert_refused(kind, pattern, text, **MATRIX_OPTIONS)


class Rtk(FileTest):
    def test_the_product_of_matrices_of_its_documentation(self):
        rig = self.rig(RTK, **RTK_OPTIONS)
        np.testing.assert_array_equal(rig.isocenter_point, [0, 0, 0])
        # Gantry angle 90: the source has turned from +z to +x, u runs along -z, v along +y.
        first, second = rig.cameras
        np.testing.assert_allclose(first.source_point, [1000, 0, 0], atol=1e-9)
        self.assertTrue(first.is_mirrored)
        scale = 1536 / (1000 - 10) / 0.8
        self.assert_seen(first, [10, 20, 30], [255.5 - 30 * scale, 199.5 + 20 * scale])
        # MTransl2D M(SDD, SID) MTransl3D MR.
        shift_uv = np.array([[1, 0, 2 + 117], [0, 1, -4 - 6], [0, 0, 1]])
        magnification = np.array([[-1536, 0, 0, 0], [0, -1536, 0, 0], [0, 0, 1, -1000]])
        turn = about(2, np.radians(3)) @ about(0, np.radians(-5)) @ about(1, np.radians(-30))
        uv = shift_uv @ magnification @ transform(np.eye(3), [-2, 4, 0]) @ transform(turn, [0, 0, 0]) @ [10, 20, 30, 1]
        self.assert_seen(second, [10, 20, 30], [255.5 + uv[0] / uv[2] / 0.8, 199.5 + uv[1] / uv[2] / 0.8])

    def test_cameras_that_look_along_the_gantrys_axis_are_written(self):
        for side in (1.0, -1.0):
            for angle in (0.0, 0.3, 3.1, -2.0):
                turn = about(1, angle)
                column, row = turn @ [1, 0, 0], turn @ [0, 0, side]
                camera = Camera("AP", np.array([0, -650 * side, 0]), [0, 370 * side, 0] - 25.2 * column - 18.8 * row, column, row,
                                np.array([0.8, 0.8]), np.array([64, 48]))
                back = self.camera(rtk_format.write_rtk(Rig(np.zeros(3), [camera])), size_px=[64, 48], pixel_spacing_mm=[0.8, 0.8])
                for point in ([10, 20, 30], [-40, 5, 12]):
                    self.assert_seen(back, point, camera.project(point), 1e-6)

    def test_origin_of_the_projections_and_their_matrix(self):
        options = RTK_OPTIONS | dict(detector_origin_mm=[-100, -80])
        scale = 1536 / (1000 - 10)
        camera = self.camera(RTK, **options)
        self.assert_seen(camera, [10, 20, 30], [(100 - 30 * scale) / 0.8, (80 + 20 * scale) / 0.8])
        # At angle 90, R takes x to z, so that w = x - SID, u = SDD z / w and v = -SDD y / w.
        text = RTK.replace("90</GantryAngle>", "90</GantryAngle><Matrix>\n0 0 1536 0\n0 -1536 0 0\n1 0 0 -1000</Matrix>")
        np.testing.assert_array_equal(self.camera(text, **options).source_point, camera.source_point)
        self.assert_refused(InputError, "does not agree", text.replace("0 0 1536 0", "0 0 1536 50"), **options)

    def test_names_and_values_are_taken_as_rtk_does(self):
        angle, moved = "<GantryAngle>119.4</GantryAngle>", "<ProjectionOffsetX>30</ProjectionOffsetX>"
        for written, meant in (
                ("<Projection><Angle>119.4</Angle></Projection>", f"<Projection>{angle}</Projection>"),
                (f"<projection>{angle}<OutofPlaneAngle>25</OutofPlaneAngle></projection>",
                 f"<Projection>{angle}<OutOfPlaneAngle>25</OutOfPlaneAngle></Projection>"),
                (f"<Projection>{moved}</Projection><Projection>{angle}</Projection>",
                 f"<Projection>{moved}</Projection><Projection>{angle}{moved}</Projection>")):
            found, expected = self.rig(rtk(written), **RTK_OPTIONS), self.rig(rtk(meant, "2"), **RTK_OPTIONS)
            self.assertEqual(len(found.cameras), len(expected.cameras))
            for one, other in zip(found.cameras, expected.cameras):
                np.testing.assert_array_equal(one.source_point, other.source_point)
                np.testing.assert_array_equal(one.project([10, 20, 30]), other.project([10, 20, 30]))
        # RTK has its source there at the angle 119.4, as a user expects.
        np.testing.assert_allclose(self.camera(rtk(written), **RTK_OPTIONS).source_point, [0, 0, 742.46], atol=1e-9)

    def test_refusals(self):
        projection = "<Projection></Projection>"
        for version in ("1", "4", ""):
            self.assert_refused(InputError, "version", rtk(projection, version))
        self.assert_refused(InputError, "--rig-pixel-spacing-mm", RTK, size_px=[512, 400])
        for kind, pattern, text in (
                (InputError, "camera.txt:2: element = <Tilt>", rtk("<Projection>\n<Tilt>3</Tilt></Projection>")),
                (InputError, "<Scan>", rtk(f"<Scan>{projection}</Scan>")), (InputError, "--rig-size-px", RTK),
                (FileError, "broken XML", RTK[:-40]), (FileError, "GantryAngle", RTK.replace(">90<", ">ninety<")),
                (InputError, "finite", RTK.replace(">90<", ">nan<")), (InputError, "parallel", RTK.replace(">1536<", ">0<")),
                (InputError, "curved", RTK.replace("<GantryAngle>", "<RadiusCylindricalDetector>9</RadiusCylindricalDetector><GantryAngle>")),
                (FileError, "no <Projection>", rtk("")),
                (FileError, "nested too deeply", "<RTKThreeDCircularGeometry>" + "<a>" * 100),
                (FileError, "entities", RTK.replace("RTKGEOMETRY>", 'RTKGEOMETRY [<!ENTITY a "aaaa">]>'))):
            self.assert_refused(kind, pattern, text)


class Plastimatch(FileTest):
    def test_the_file_and_the_command(self):
        # Where plastimatch draws a ball of 12 mm, at (103.000, 70.070) by its centre of mass. The file's numbers have 9 digits.
        for rig in (self.rig(PLASTIMATCH, size_px=[240, 200]), self.rig(PLASTIMATCH_COMMAND)):
            camera = rig.cameras[0]
            self.assert_seen(camera, [30, -40, 55], [102.99675021, 70.09949423], 1e-5)
            np.testing.assert_allclose(rig.isocenter_point, [5, -7, 11], atol=1e-5)
            np.testing.assert_allclose(camera.pixel_spacing_mm, [2.0, 2.1], atol=1e-8)
            np.testing.assert_allclose(camera.source_detector_mm, 1200, atol=1e-5)
            np.testing.assert_array_equal(camera.size_px, [240, 200])
            self.assertFalse(camera.is_mirrored)
        with_another = PLASTIMATCH_COMMAND + "\nplastimatch convert --input a -o b.mha\n"
        np.testing.assert_array_equal(self.camera(with_another).source_point, self.camera(PLASTIMATCH_COMMAND).source_point)

    def test_refusals(self):
        command = PLASTIMATCH_COMMAND
        for kind, pattern, text in (
                (InputError, "--rig-size-px", PLASTIMATCH), (FileError, "truncated", PLASTIMATCH[:-90]),
                (InputError, "Intrinsic times Extrinsic", PLASTIMATCH.replace("1.27708152e+00", "1.37708152e+00")),
                (InputError, "finite", PLASTIMATCH.replace("8.00000000e+02", "inf")),
                (InputError, "SAD", PLASTIMATCH.replace("8.00000000e+02", "-8e+02")),
                (InputError, "camera.txt:17: line = 'Tilt 3'", PLASTIMATCH + "Tilt 3\n"),
                (InputError, "--nrm", command.replace('--nrm "0.6 -0.7 0.2"', "")),
                (InputError, "--tilt", command.replace("--sad", "--tilt")),
                (InputError, "--gantry-angle", command.replace("-o ", "-y ")),
                (InputError, "parallel", command.replace("0.1 0.2 1'", "0.6 -0.7 0.2'")),
                (FileError, "no number", command.replace("--sad 800", "--sad far")),
                (InputError, "32768", command.replace("240 200", "1e12 200")),
                (InputError, "2 plastimatch drr commands", command + "\n" + command)):
            self.assert_refused(kind, pattern, text)


class Elastix(FileTest):
    def test_the_ball_that_it_draws(self):
        camera = self.camera(ELASTIX)
        np.testing.assert_array_equal(camera.source_point, [5, -800, 11])
        # Along y, the ball is 760 mm from the focal point, and the detector 1100 mm.
        scale = 1100 / 760
        self.assert_seen(camera, [30, -40, 55], [(200 + 5 + 25 * scale) / 2.0, (180 - (11 + 44 * scale)) / 2.1])

    def test_refusals_and_notes(self):
        for kind, pattern, text in (
                (FileError, "not closed", ELASTIX[:ELASTIX.index("11.0)") + 2]),
                (InputError, r"\(Origin ...\)", ELASTIX.replace("(Origin", "(Orient")),
                (FileError, "3 numbers", ELASTIX.replace("-800.0 11.0", "-800.0")),
                (InputError, "finite", ELASTIX.replace("-800.0 11.0", "nan 11.0")),
                (InputError, "single slice", ELASTIX.replace("200 1)", "200 2)")),
                (InputError, "32768", ELASTIX.replace("240 200", "4e9 200")),
                (InputError, "PreParameters", ELASTIX.replace("(PreParameters 0.0", "(PreParameters 0.1")),
                (InputError, "column_direction", ELASTIX.replace("(Direction 1.0", "(Direction 2.0")),
                (InputError, "UseDirectionCosines", ELASTIX + '(UseDirectionCosines "false")\n'),
                (InputError, "there twice", ELASTIX + "(FocalPoint 5.0 -900.0 11.0)\n"),
                (FileError, "camera.txt:12: 'Tilt 3'", ELASTIX + "Tilt 3\n")):
            self.assert_refused(kind, pattern, text)
        self.rig(ELASTIX.replace("(TransformParameters 0", "(TransformParameters 0.1") + "(Tilt 3)\n")
        self.assert_noted("not read: Tilt")
        self.assert_noted("TransformParameters are a pose")


class XReg(FileTest):
    def test_deep_fluoro(self):
        camera = self.camera(deep_fluoro())
        np.testing.assert_allclose(camera.source_point, [700, -5, 8], atol=1e-9)  # -R' t
        self.assertAlmostEqual(camera.source_detector_mm, 1000, 9)
        self.assertTrue(camera.is_mirrored)  # columns x rows points to the source
        # The extrinsic matrix takes (10, 20, 30) to (25, 22, -690).
        self.assert_seen(camera, [10, 20, 30], [767.5 + 5000 * 25 / 690, 599.5 + 5000 * 22 / 690])

    def test_frames(self):
        at = {mm: [767.5 + 5000 * 25 / mm, 599.5 + 5000 * 22 / mm] for mm in (690, 710)}
        plus = self.camera(xreg_camera(focal_px=5000, translation=(5, -8, 700), frame="origin-at-focal-pt-det-pos-z"))
        self.assertFalse(plus.is_mirrored)
        self.assert_seen(plus, [10, 20, 30], at[710])
        minus = self.camera(xreg_camera(frame="origin-at-focal-pt-det-neg-z"))
        self.assert_seen(minus, [10, 20, 30], at[690])
        # 310 mm of 1000 mm in front of the detector.
        on_detector = self.camera(xreg_camera(focal_px=5000, translation=(5, -8, 300), frame="origin-on-det"))
        self.assert_seen(on_detector, [10, 20, 30], at[690])
        np.testing.assert_allclose(on_detector.source_point, [700, -5, 8], atol=1e-9)

    def test_several_projections(self):
        def fill(file):
            file["num-projs"] = 2
            for i in range(2):
                xreg_group(file, f"/proj-00{i}/cam", focal_px=5000, translation=(5, -8, 700 + 100 * i),
                           frame="origin-at-focal-pt-det-pos-z")
        rig = self.rig(hdf5_bytes(fill), isocenter_point=[0, 0, 0])
        self.assertEqual([camera.name for camera in rig.cameras], ["camera-1", "camera-2"])
        self.assert_seen(rig.cameras[1], [10, 20, 30], [767.5 + 5000 * 25 / 810, 599.5 + 5000 * 22 / 810])

    def test_refusals_and_notes(self):
        for kind, pattern, content in (
                (InputError, "pixel-row-spacing = 0.3: must agree with the intrinsic", deep_fluoro(row_spacing=0.3)),
                (InputError, "cam-coord-frame-type = 'sideways': must be one of", xreg_camera(frame="sideways")),
                (InputError, "focal lengths", deep_fluoro(focal_px=0.0)),
                (FileError, "has no /proj-params/intrinsic", hdf5_bytes(lambda file: file.create_group("proj-params"))),
                (FileError, "is no matrix of 3 x 3",
                 hdf5_bytes(lambda file: file.create_dataset("proj-params/intrinsic", data=np.ones(9)))),
                (InputError, "between 1 and 10000", hdf5_bytes(lambda file: file.create_dataset("num-projs", data=1e300)))):
            self.assert_refused(kind, pattern, content)

        def tilted(file):
            xreg_group(file, "/proj-params", "pixel-")
            file["proj-params/tilt"] = 3.0
        self.rig(hdf5_bytes(tilted))
        self.assert_noted("/proj-params/tilt: not read")


class Rad(FileTest):
    def test_by_hand(self):
        camera = self.camera(RAD)
        self.assertTrue(camera.is_mirrored)  # columns x rows points to the source
        # 710 of the 1000 mm from the source to the detector.
        self.assert_seen(camera, [10, 20, 30], [(100 + 5 + 15 * 1000 / 710) / 0.4, (80 + 8 - 38 * 1000 / 710) / 0.5])

    def test_refusals_and_notes(self):
        for kind, pattern, text in (
                (FileError, r"'Step\[mm\]:' is missing", RAD.replace("Step[mm]: ", "Steps: ")),
                (FileError, r"'Step\[mm\]:' is there twice", "Step[mm]: 1 1\n" + RAD),
                (FileError, "truncated: TPosition", RAD[:RAD.index("0 -1 0 80")]),
                (FileError, "camera.txt:4: expected 3 numbers", RAD.replace("-700 5 -8", "-700 5")),
                (InputError, "from the detector to the source", RAD.replace("-700 5 -8", "700 5 -8")),
                (InputError, "TPosition", RAD.replace("0 0 -1 300", "0 0 -2 300"))):
            self.assert_refused(kind, pattern, text)
        self.rig("Tilt[deg]: 3\n" + RAD)
        self.assert_noted("not read: Tilt[deg]")


class DiffDrr(FileTest):
    magnification = 1020 / 870

    def test_the_view_from_the_front(self):
        camera = self.camera(DIFFDRR)
        np.testing.assert_allclose([camera.source_point, camera.column_direction, camera.row_direction],
                                   [[0, -850, 0], [1, 0, 0], [0, 0, -1]], atol=1e-9)
        self.assertFalse(camera.is_mirrored)
        self.assert_seen(camera, [10, 20, 30], [119.5 + (12 + 10 * self.magnification) / 2, 99.5 + (-9 - 30 * self.magnification) / 1.5])

    def test_the_cts_frame_and_unreversed_columns(self):
        text = "volume_middle_ct_mm = [5.0, -7.0, 11.0]\n" + DIFFDRR
        row = 99.5 + (-9 - 30 * self.magnification) / 1.5
        self.assert_seen(self.camera(text), [15, 13, 41], [119.5 + (12 + 10 * self.magnification) / 2, row])
        np.testing.assert_array_equal(self.rig(text).isocenter_point, [5, -7, 11])
        text += "reverse_x_axis = false\n"
        self.assertTrue(self.camera(text).is_mirrored)
        self.assert_seen(self.camera(text), [15, 13, 41], [119.5 - (12 + 10 * self.magnification) / 2, row])

    def test_turned_pixels(self):
        # DRR() and Detector() of DiffDRR 0.4, written out: a pixel's point is (x, y, sdd) in the camera's frame, turned to the
        # orientation PA, moved by t and turned by Rx Ry Rz.
        camera = self.camera(DIFFDRR.replace("[0.0, 0.0, 0.0]", "[0.3, -0.2, 0.1]").replace("[0.0, 850.0, 0.0]", "[10.0, -800.0, 30.0]") +
                             'convention = "XYZ"\norientation = "PA"\n')
        turn = about(0, 0.3) @ about(1, -0.2) @ about(2, 0.1)

        def lps(of_camera):
            return np.array([-1, -1, 1]) * (turn @ (np.array([[-1, 0, 0], [0, 0, 1], [0, 1, 0]]) @ of_camera + [10, -800, 30]))
        np.testing.assert_allclose(camera.source_point, lps(np.zeros(3)), atol=1e-9)
        for column, row in ((0, 0), (239, 0), (17, 199)):
            np.testing.assert_allclose(camera.detector_point(column, row),
                                       lps(np.array([12 - 2.0 * (column - 119.5), -9 - 1.5 * (row - 99.5), 1020])), atol=1e-9)

    def test_refusals(self):
        for pattern, text in (
                ("sdd", DIFFDRR.replace("sdd = 1020.0\n", "")), ("must be above 0", DIFFDRR.replace("delx = 2.0", "delx = -2.0")),
                ("between 1 and 32768", DIFFDRR.replace("height = 200", "height = 0")),
                ("neighbours different", DIFFDRR + 'convention = "ZZX"\n'), ("rotation", DIFFDRR + 'parameterization = "quaternion"\n'),
                ("sid", DIFFDRR + "sid = 3\n")):
            self.assert_refused(InputError, pattern, text)


class DicomCameras(FileTest):
    scale = 1200 / (800 - 20)

    def test_at_angles_0_the_patient_faces_the_detector(self):
        camera = self.camera(xa())
        np.testing.assert_allclose(camera.source_point, [0, 800, 0], atol=1e-9)  # behind the back
        self.assertTrue(camera.is_mirrored)  # seen from the detector, against the beam
        self.assert_seen(camera, [10, 20, 30], [199.5 + 10 * self.scale / 0.3, 255.5 - 30 * self.scale / 0.4])
        self.assertEqual(len(self.notes), 1, self.notes)
        self.assert_noted("mirrored")

    def test_angles_are_longitude_and_latitude_of_the_detector(self):
        camera = self.camera(xa(PositionerPrimaryAngle="30", PositionerSecondaryAngle="-20"))  # LAO, caudal
        a, b = np.radians([30, -20])
        to_detector = np.array([np.sin(a) * np.cos(b), -np.cos(a) * np.cos(b), np.sin(b)])  # left, front, foot
        np.testing.assert_allclose(camera.beam_direction, to_detector, atol=1e-12)
        np.testing.assert_allclose(camera.source_point, -800 * to_detector, atol=1e-9)
        self.assert_seen(camera, [0, 0, 0], [199.5, 255.5])
        np.testing.assert_allclose(camera.column_direction, [np.cos(a), np.sin(a), 0], atol=1e-12)
        self.assertLess(camera.row_direction[2], 0)

    def test_patient_orientation_turns_the_image_around(self):
        camera = self.camera(xa(PatientOrientation=["R", "F"]))
        self.assertFalse(camera.is_mirrored)
        self.assert_seen(camera, [10, 20, 30], [199.5 - 10 * self.scale / 0.3, 255.5 - 30 * self.scale / 0.4])
        self.assertTrue(self.camera(xa(["PatientOrientation"])).is_mirrored)
        self.assert_noted("PatientOrientation (0020,0020)")
        self.assertFalse(self.camera(xa(["PatientOrientation"]), flip="columns").is_mirrored)

    def test_angles_of_the_detector_and_the_table_are_said_not_to_count(self):
        self.rig(xa(TableAngle="0", DetectorPrimaryAngle="5"))
        self.assertEqual(len(self.notes), 2, self.notes)
        self.assert_noted("DetectorPrimaryAngle (0018,1530) = 5")

    def test_moving_positioners_have_a_camera_per_frame(self):
        moving = dict(PositionerMotion="DYNAMIC", NumberOfFrames="3", PositionerPrimaryAngle="10", PositionerPrimaryAngleIncrement="40")
        rig = self.rig(xa(**moving, PositionerSecondaryAngleIncrement=["0", "0.5", "2"]))
        self.assertEqual(len(rig.cameras), 3)
        a, b = np.radians([90, 2])
        np.testing.assert_allclose(rig.cameras[2].beam_direction, [np.sin(a) * np.cos(b), -np.cos(a) * np.cos(b), np.sin(b)], atol=1e-12)
        self.assert_refused(InputError, "one per frame: 3", xa(**moving, PositionerSecondaryAngleIncrement=["0", "0.5"]))
        self.assert_refused(InputError, "100000", xa(**(moving | dict(NumberOfFrames="999999999"))))

    def test_enhanced_files_have_a_camera_per_frame(self):
        first, second = self.rig(enhanced_xa("90")).cameras
        self.assert_seen(first, [10, 20, 30], [199.5 + 10 * self.scale / 0.3, 255.5 - 30 * self.scale / 0.4])
        np.testing.assert_allclose(second.source_point, [-800, 0, 0], atol=1e-9)  # LAO 90
        self.assertEqual(len(self.rig(enhanced_xa("0")).cameras), 1)  # nothing moves
        # The frame's own spacing counts.
        np.testing.assert_array_equal(self.camera(enhanced_xa("90", ImagerPixelSpacing=["0.8", "0.6"])).pixel_spacing_mm, [0.3, 0.4])

    def test_angles_of_the_equipment_are_not_those_of_the_patient(self):
        frame = dataset(IsocenterReferenceSystemSequence=Sequence(
            [dataset(PositionerIsocenterPrimaryAngle=30.0, PositionerIsocenterDetectorRotationAngle=5.0)]))
        content = enhanced_xa("90", [frame, copy.deepcopy(frame)])
        self.assert_refused(InputError, "are of the equipment, not of the patient", content)
        self.assertEqual(len(self.rig(content, positioner_deg=[0.0, 0.0]).cameras), 1)
        self.assert_noted("= 5 degrees is not applied")

    field_of_view = dict(DetectorElementSpacing=["0.2", "0.2"], DetectorActiveDimensions=["300", "400"],
                         DetectorActiveOrigin=["0", "0"], FieldOfViewOrigin=["200", "900"])

    def test_the_field_of_view_moves_the_image_on_the_detector(self):
        # A detector of 300 x 400 mm in elements of 0.2 mm; the image begins 200 rows and 900 columns in. The detector's middle,
        # where the isocentre is seen, is (200, 150) mm in; the image begins at (180, 40) mm, its first pixel half a pixel later.
        self.assert_seen(self.camera(xa(**self.field_of_view)), [0, 0, 0], [20 / 0.3 - 0.5, 110 / 0.4 - 0.5])
        # The image's middle lies 40 mm to the right of and 7.6 above the detector's, which is seen the other way round in a
        # flipped or turned image.
        x, y = 40 / 0.3, -7.6 / 0.4
        flipped = self.field_of_view | dict(FieldOfViewHorizontalFlip="YES")
        self.assert_seen(self.camera(xa(**flipped)), [0, 0, 0], [199.5 + x, 255.5 - y])
        self.assert_seen(self.camera(xa(**flipped, FieldOfViewRotation="180")), [0, 0, 0], [199.5 - x, 255.5 + y])
        self.assert_refused(InputError, r"FieldOfViewRotation \(0018,7032\)", xa(**flipped, FieldOfViewRotation="90"))

    def test_the_field_of_view_of_a_frame_is_that_of_its_functional_groups(self):
        frames = [dataset(PositionerPositionSequence=Sequence([dataset(PositionerPrimaryAngle=primary, PositionerSecondaryAngle="0")]))
                  for primary in ("0", "90")]
        frames[1].FieldOfViewSequence = Sequence([dataset(FieldOfViewOrigin=[200.0, 900.0])])
        of_detector = {key: value for key, value in self.field_of_view.items() if key != "FieldOfViewOrigin"}
        first, second = self.rig(enhanced_xa("90", frames, **of_detector)).cameras
        self.assert_seen(first, [0, 0, 0], [199.5, 255.5])
        self.assert_seen(second, [0, 0, 0], [20 / 0.3 - 0.5, 110 / 0.4 - 0.5])

    def test_what_is_missing_is_asked_for_by_name(self):
        for keyword, option in (("DistanceSourceToDetector", "--rig-source-detector-mm"),
                                ("DistanceSourceToPatient", "--rig-source-isocenter-mm"),
                                ("ImagerPixelSpacing", "--rig-pixel-spacing-mm"), ("PositionerPrimaryAngle", "--rig-positioner-deg"),
                                ("Rows", r"Rows \(0028,0010\)")):
            self.assert_refused(InputError, option, xa([keyword]))
        bare = xa(["DistanceSourceToDetector", "DistanceSourceToPatient", "ImagerPixelSpacing", "PositionerPrimaryAngle",
                   "PositionerSecondaryAngle"])
        camera = self.camera(bare, source_detector_mm=1200.0, source_isocenter_mm=800.0, pixel_spacing_mm=[0.3, 0.4],
                             positioner_deg=[0.0, 0.0])
        self.assert_seen(camera, [10, 20, 30], self.camera(xa()).project([10, 20, 30]))

    def test_refusals(self):
        self.assert_refused(InputError, "must agree", xa(), source_detector_mm=1000.0)
        self.assert_refused(InputError, "must be two positive", xa(ImagerPixelSpacing=["0.4", "-1"]))
        self.assert_refused(InputError, "360", xa(PositionerPrimaryAngle="1e9"))
        self.assert_refused(InputError, "1e6 mm", xa(DistanceSourceToPatient="1e300"))
        content = xa()
        self.assert_refused(FileError, "truncated", content[:content.index(b"\xe0\x7f\x10\x00") - 3])


if __name__ == "__main__":
    unittest.main()
