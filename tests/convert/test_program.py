# SPDX-License-Identifier: Apache-2.0
"""af-convert as a user starts it. AF_PROGRAMS names the folder of the programs: af-inspect reads CTs."""
import os
import pathlib
import subprocess
import sys
import tomllib
import unittest

import numpy as np

from examples import *  # noqa: F403

PROGRAM = pathlib.Path(__file__).resolve().parents[2] / "python/af-convert"
PROGRAMS = os.environ.get("AF_PROGRAMS", "")


def mha(grid):
    """A CT with this grid."""
    direction = " ".join(repr(float(value)) for value in grid.direction.T.ravel())
    header = (f"ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nTransformMatrix = {direction}\n"
              f"Offset = {' '.join(map(str, grid.origin_mm))}\nElementSpacing = {' '.join(map(str, grid.spacing_mm))}\n"
              f"DimSize = {' '.join(map(str, grid.size))}\nElementType = MET_SHORT\nElementDataFile = LOCAL\n")
    return header.encode() + np.zeros(grid.size.prod(), "<i2").tobytes()


class Program(FileTest):
    def run_of(self, *command):
        environment = os.environ | {"PATH": f"{PROGRAMS}:{os.environ['PATH']}"}
        return subprocess.run([*map(str, command)], cwd=self.folder, capture_output=True, text=True, env=environment, check=False)

    def run_program(self, *arguments):
        return self.run_of(sys.executable, "-B", PROGRAM, *arguments)

    def convert(self, *arguments):
        run = self.run_program(*arguments)
        self.assertEqual(run.returncode, 0, run.stderr)
        return run

    def assert_ends(self, code, text, *arguments):
        run = self.run_program(*arguments)
        self.assertEqual(run.returncode, code, run.stderr)
        self.assertIn(text, run.stderr)
        self.assertNotIn("Traceback", run.stderr)


class Cameras(Program):
    def test_a_rig_is_printed_or_written_and_goes_out_again(self):
        self.file(OPENCV_LENS, "cam.yml")
        printed = self.convert("cam.yml")
        self.assertIn("warning: the isocentre is not in the file", printed.stderr)
        self.convert("cam.yml", "-o", "rig.toml")
        self.assertEqual((self.folder / "rig.toml").read_text(), printed.stdout)
        self.convert("rig.toml", "--to", "opencv", "-o", "again.yml")
        self.convert("again.yml", "-o", "again.toml")
        first, again = (tomllib.loads((self.folder / name).read_text()) for name in ("rig.toml", "again.toml"))
        np.testing.assert_allclose(again["camera"][0]["source_point"], first["camera"][0]["source_point"], atol=1e-9)
        self.assertEqual(again["camera"][0]["distortion"], first["camera"][0]["distortion"])

    def test_a_file_per_camera_where_the_format_holds_one(self):
        self.file(OPENCV_PAIR, "pair.yml")
        self.convert("pair.yml", "--rig-names", "A,B", "--to", "mayacam2", "-o", "cam.txt")
        self.convert("cam-A.txt", "cam-B.txt", "-o", "rig.toml")
        rig = tomllib.loads((self.folder / "rig.toml").read_text())
        self.assertEqual([camera["name"] for camera in rig["camera"]], ["cam-A", "cam-B"])

    def test_the_isocentre_begins_with_a_minus_in_every_form(self):
        self.file(MAYACAM2, "cam.txt")
        for words in (["cam.txt", "--rig-isocenter-point=-10.5,20,30"], ["cam.txt", "--rig-isocenter-point", "-10.5,20,30"],
                      ["--rig-isocenter-point", "-10.5,20,30", "cam.txt"]):
            self.convert(*words, "-o", "rig.toml")
            self.assertEqual(tomllib.loads((self.folder / "rig.toml").read_text())["isocenter_point"], [-10.5, 20.0, 30.0])

    def test_exit_codes(self):
        self.file(MAYACAM2, "cam.txt")
        self.file("prose", "prose.txt")
        self.assert_ends(2, "--rig-size-px", "cam.txt", "--rig-size-px", "1")
        self.assert_ends(3, "must agree with the file", "cam.txt", "--rig-size-px", "1,2")
        self.assert_ends(3, "is no format of cameras", "cam.txt", "--to", "itk")
        self.assert_ends(4, "neither cameras nor poses", "prose.txt")
        self.assert_ends(4, "No such file", "none.txt")
        self.assert_ends(4, "cannot be written", "cam.txt", "-o", "no-folder/rig.toml")

    def test_help_is_there_as_pages(self):
        for kind, part in (("man", ".SH OPTIONS"), ("bash", "complete -o default"), ("zsh", "_arguments"), ("markdown", "| `--to` |")):
            self.assertIn(part, self.convert("--help-as", kind).stdout)

    @unittest.skipUnless(PROGRAMS, "AF_PROGRAMS names no programs")
    def test_programs_in_python_are_of_the_same_version(self):
        inspect, *others = (self.run_of(PROGRAMS + "/" + name, "--version").stdout.split() for name in ("af-inspect", "af-convert", "af-report"))
        self.assertEqual(others, [["af-convert", *inspect[1:]], ["af-report", *inspect[1:]]])


@unittest.skipUnless(PROGRAMS, "AF_PROGRAMS names no programs")
class Poses(Program):
    def setUp(self):
        super().setUp()
        self.file(mha(uneven_grid()), "ct.mha")
        self.file(formats.pose_file([(1, UNEVEN_POSE)], "toml", None), "pose.toml")
        self.file(formats.rig_files(Rig(np.zeros(3), [frontal_camera()]), "rig", pathlib.Path("rig.toml"))[0][1], "rig.toml")

    def pose(self, name):
        return np.array(tomllib.loads((self.folder / name).read_text())["room_from_ct"])

    def test_the_grid_of_the_ct_comes_from_af_inspect(self):
        for target, options in (("autoscoper", []), ("diffdrr", ["--rig", "rig.toml"]), ("dicom", [])):
            self.convert("pose.toml", "--to", target, "--ct", "ct.mha", *options, "-o", "out.tra")
            self.convert("out.tra", "--ct", "ct.mha", *options, "-o", "back.toml")
            np.testing.assert_allclose(self.pose("back.toml"), UNEVEN_POSE, rtol=0, atol=1e-5)
        self.convert("pose.toml", "--to", "autoscoper", "--ct", "ct.mha", "-o", "out.tra")
        self.assertEqual((self.folder / "out.tra").read_text(), formats.pose_file([(1, UNEVEN_POSE)], "autoscoper", KnownContext()))

    def test_what_a_pose_is_of_is_asked_for(self):
        self.assert_ends(3, "give --ct, or --study", "pose.toml", "--to", "autoscoper", "-o", "out.tra")
        self.assert_ends(3, "give its rig", "pose.toml", "--to", "diffdrr", "--ct", "ct.mha", "-o", "out.toml")
        self.assert_ends(4, "af-inspect ended with exit code 4", "pose.toml", "--to", "autoscoper", "--ct", "none.mha", "-o", "out.tra")

    def test_of_a_registration_to_a_dicom_ct_the_rooms_matrix_is_inverted(self):
        (self.folder / "ct").mkdir()
        for k in range(6):
            image = dataset(Modality="CT", PatientPosition="HFS", StudyInstanceUID="1.2.1", SeriesInstanceUID="1.2.2", InstanceNumber=k + 1,
                            FrameOfReferenceUID="1.2.3.4", ImagePositionPatient=[-12, -10, 2 * k],
                            ImageOrientationPatient=[1, 0, 0, 0, 1, 0], PixelSpacing=[1, 1], SliceThickness=2, Rows=20, Columns=24,
                            SamplesPerPixel=1, PhotometricInterpretation="MONOCHROME2", BitsAllocated=16, BitsStored=16, HighBit=15,
                            PixelRepresentation=0, RescaleSlope=1, RescaleIntercept=-1024, RescaleType="HU",
                            PixelData=np.full(480, 1024 + k, "<u2").tobytes())
            content = dicom_bytes(image, "1.2.840.10008.5.1.4.1.1.2").replace(b"1.2.3\0", f"1.2.{k}\0".encode())
            self.file(content, f"ct/{k}.dcm")
        inverse = np.linalg.inv(UNEVEN_POSE)
        for own, frames in (("9.9", [("9.9", "RIGID", np.eye(4)), ("1.2.3.4", "RIGID", UNEVEN_POSE)]),
                            ("1.2.3.4", [("1.2.3.4", "RIGID", np.eye(4)), ("9.9", "RIGID", inverse)])):
            self.file(registration(own, frames), "own.dcm")
            run = self.convert("own.dcm", "--ct", "ct", "-o", "back.toml")
            np.testing.assert_allclose(self.pose("back.toml"), UNEVEN_POSE, rtol=0, atol=1e-6)
            self.assertEqual(run.stderr, "")

    def test_films_become_tables_that_keep_their_frames(self):
        line = formats.pose_file([(1, UNEVEN_POSE)], "autoscoper", KnownContext())
        self.file(line + ",".join(["NaN"] * 16) + "\n" + line, "film.tra")
        run = self.convert("film.tra", "--ct", "ct.mha", "-o", "poses.csv")
        self.assertIn("1 of 3 frames were not tracked", run.stderr)
        self.assertEqual([line.split(",")[0] for line in (self.folder / "poses.csv").read_text().split()], ["start_index", "0", "2"])

    def test_a_study_is_made_and_read(self):
        self.convert("rig.toml", "pose.toml", "--to", "study", "--ct", "ct.mha", "-o", "made.toml")
        study = tomllib.loads((self.folder / "made.toml").read_text())
        np.testing.assert_array_equal(study["case"][0]["nominal_room_from_ct"], UNEVEN_POSE)
        self.assertEqual((study["rig"], study["case"][0]["ct"], study["case"][0]["view"][0]["camera"]), ("rig.toml", "ct.mha", "A"))
        self.convert("pose.toml", "--to", "diffdrr", "--study", "made.toml", "-o", "drr.toml")
        self.convert("made.toml", "--to", "matrix", "-o", "matrix.txt")
        self.file("rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm\n0,0,0,0,0,0\n", "moves.csv")
        self.convert("moves.csv", "--study", "made.toml", "-o", "back.toml")
        np.testing.assert_allclose(self.pose("back.toml"), UNEVEN_POSE, rtol=0, atol=1e-12)


if __name__ == "__main__":
    unittest.main()
