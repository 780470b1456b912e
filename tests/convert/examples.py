# SPDX-License-Identifier: Apache-2.0
"""Files of every format as other programs write them, and helpers of the tests."""
import contextlib
import io
import pathlib
import sys
import tempfile
import unittest
import warnings

import h5py
import numpy as np
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.sequence import Sequence
from pydicom.uid import ExplicitVRLittleEndian

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "python"))
from af_convert import formats  # noqa: E402
from af_convert.context import Grid  # noqa: E402
from af_programs.errors import FileError, InputError  # noqa: E402
from af_convert.geometry import Camera, rotation_zyx, transform  # noqa: E402
from af_convert.own_poses import Frame  # noqa: E402
from af_convert.rig import Rig, RigOptions  # noqa: E402

MAYACAM2 = ("image size\n1024,768\n\ncamera matrix\n5000,0,511.5\n0,5000,383.5\n0,0,1\n\nrotation\n0,1,0\n0,0,-1\n-1,0,0\n\n"
            "translation\n0\n0\n1000\n")
MAYACAM1 = "0,-1000,0\n90,0,0\n0,0,-400\n513,301,-4000\n0.1,1024,768\n"
# Written by OpenCV 4.6 (cv2.FileStorage).
OPENCV = """%YAML:1.0
---
image_width: 512
image_height: 400
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 1200., 0., 2.5550000000000000e+02, 0., 1100.,
       2.0025000000000000e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
rvec: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 2.9999999999999999e-01, -2.0000000000000001e-01,
       5.0000000000000000e-01 ]
tvec: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 10., -20., 900. ]
"""
OPENCV_ROTATION = """R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 8.5953389855866325e-01, -4.9799153700292198e-01,
       -1.1491695393636675e-01, 4.3986763295823095e-01,
       8.3531560520670856e-01, -3.2979433769225508e-01,
       2.6022671404809444e-01, 2.3292116428443663e-01,
       9.3703243728491803e-01 ]
"""
OPENCV_LENS = OPENCV.replace("[ 0., 0., 0., 0., 0. ]", "[ -0.35, 0.12, 0.004, -0.003, 0.05 ]")
OPENCV_PAIR = """image_size: [640, 480]
M1:
  rows: 3
  cols: 3
  data: [1000, 0, 319.5, 0, 1000, 239.5, 0, 0, 1]
R1: [1, 0, 0, 0, 1, 0, 0, 0, 1]
T1: [0, 0, 500]
M2:
  rows: 3
  cols: 3
  data: [1000, 0, 319.5, 0, 1000, 239.5, 0, 0, 1]
R2: [0, 0, -1, 0, 1, 0, 1, 0, 0]
T2: [0, 0, 600]
"""
# The same numbers as lists with dashes, as YAML libraries of other languages write them.
OPENCV_LISTS = ("image_size:\n- 512\n- 400\n{}dist:  # k1, k2, p1, p2, k3\n  - -0.35\n  - 0.12   # k2\n  - 4e-3\n  -  -0.003\n"
                "  # nothing\n  - 0.05\nrvec:\n  - 0.3\n  - -0.2\n  - 0.5\ntvec:\n- [10]\n- [-20]\n- [900]\n")
OPENCV_MATRICES = (
    "K:\n- - 1200\n  - 0\n  - 255.5\n- - 0\n  - 1100\n  - 200.25\n-\n  - 0\n  - 0\n  - 1\n",
    "K:\n  - [1200, 0, 255.5]\n  - [0, 1100,\n     200.25]\n  - [0, 0, 1]\n",
    "K: [[1200, 0, 255.5],  # columns\n    [0, 1100, 200.25],\n    [0, 0, 1]]\n",
    "K:\n   rows: 3\n   cols: 3\n   data:\n   - 1200\n   - 0\n   - 255.5\n   - 0\n   - 1100\n   - 200.25\n   - 0\n   - 0\n   - 1\n")
MATRIX = "# source at (0, -800, 0)\n1000 255.5 0 204400\n0 199.5 -1000 159600\n0 1 0 800\n"
RTK = """<?xml version="1.0"?>
<!DOCTYPE RTKGEOMETRY>
<RTKThreeDCircularGeometry version="3">
  <SourceToIsocenterDistance>1000</SourceToIsocenterDistance>
  <SourceToDetectorDistance>1536</SourceToDetectorDistance>
  <Projection>
    <GantryAngle>90</GantryAngle>
  </Projection>
  <Projection>
    <GantryAngle>30</GantryAngle>
    <OutOfPlaneAngle>5</OutOfPlaneAngle>
    <InPlaneAngle>-3</InPlaneAngle>
    <SourceOffsetX>2</SourceOffsetX>
    <SourceOffsetY>-4</SourceOffsetY>
    <ProjectionOffsetX>-117</ProjectionOffsetX>
    <ProjectionOffsetY>6</ProjectionOffsetY>
  </Projection>
</RTKThreeDCircularGeometry>
"""
# Written by plastimatch 1.9.4: plastimatch drr -G --nrm "0.6 -0.7 0.2" --vup "0.1 0.2 1" --sad 800 --sid 1200 -r "240 200"
# -z "480 420" -c "110.5 95.25" -o "5 -7 11" -t pfm -O out_ ct.mha
PLASTIMATCH = """    1.10500000e+02     9.52500000e+01
    3.85730695e-01     3.02329480e-01    -9.90389669e-02     1.27708152e+00
   -8.94575491e-03    -1.37869908e-01    -4.55707397e-01     4.09242078e+00
   -5.29998957e-04     6.18332082e-04    -1.76666315e-04     6.75588315e-01
    8.00000000e+02
    1.20000000e+03
   -6.35998749e-01     7.41998498e-01    -2.11999578e-01
Extrinsic
    7.71461389e-01     6.04658960e-01    -1.98077934e-01     2.55416304e+00
   -1.87860853e-02    -2.89526807e-01    -9.56985533e-01     8.59408365e+00
   -6.35998749e-01     7.41998498e-01    -2.11999578e-01     8.10705979e+02
    0.00000000e+00     0.00000000e+00     0.00000000e+00     1.00000000e+00
Intrinsic
    5.00000000e-01     0.00000000e+00     0.00000000e+00     0.00000000e+00
    0.00000000e+00     4.76190476e-01     0.00000000e+00     0.00000000e+00
    0.00000000e+00     0.00000000e+00     8.33333333e-04     0.00000000e+00
"""
PLASTIMATCH_COMMAND = ("#!/bin/sh\nplastimatch drr --nrm \"0.6 -0.7 0.2\" --vup='0.1 0.2 1' --sad 800 --sid 1200 \\\n"
                       "  -r \"240 200\" -z \"480 420\" -c \"110.5 95.25\" -o \"5 -7 11\" -t pfm -O out_ ct.mha\n")
# What elastix 5.0.1 writes as TransformParameters.0.txt, without the lines that say nothing about the camera.
ELASTIX = """(Transform "EulerTransform")
(TransformParameters 0 0 0 0 0 0)
// a comment
(Size 240 200 1)
(Index 0 0 0)
(Spacing 2.0000000000 2.1000000000 1.0000000000)
(Origin -200.0000000000 300.0000000000 180.0000000000)
(Direction 1.0 0.0 0.0 0.0 0.0 -1.0 0.0 1.0 0.0)
(ResampleInterpolator "FinalRayCastInterpolator")
(FocalPoint 5.0 -800.0 11.0)
(PreParameters 0.0 0.0 0.0 0.0 0.0 0.0)
"""
RAD = ("Size[pixels]: 512 400\nStep[mm]: 0.4 0.5\nDataType: float\nSourcePosition[mm]: -700 5 -8\nTPosition:\n0 0 -1 300\n"
       "1 0 0 -100\n0 -1 0 80\n0 0 0 1\n")
DIFFDRR = ("[[diffdrr_camera]]\nsdd = 1020.0\nheight = 200\nwidth = 240\ndelx = 2.0\ndely = 1.5\nx0 = 12.0\ny0 = -9.0\n"
           "rotation = [0.0, 0.0, 0.0]\ntranslation = [0.0, 850.0, 0.0]\n")
DIFFDRR_POSE = ('diffdrr_parameterization = "euler_angles"\nconvention = "ZXY"\nrotation_rad = [[0.0, 0.0, 0.0]]\n'
                "translation_mm = [[10.0, 650.0, -20.0]]\n")


def rtk(projections, version="3"):
    return (f'<RTKThreeDCircularGeometry version="{version}"><SourceToIsocenterDistance>742.46</SourceToIsocenterDistance>'
            f"<SourceToDetectorDistance>1209.96</SourceToDetectorDistance>{projections}</RTKThreeDCircularGeometry>")


def hdf5_bytes(fill):
    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        fill(file)
    return memory.getvalue()


def xreg_group(file, group, prefix="", focal_px=-5000.0, translation=(5, -8, -700), frame=None, row_spacing=0.2):
    """A camera as xReg states it: 1536 x 1200 pixels of 0.2 mm, 1000 mm from the source."""
    group = file.require_group(group)
    group["intrinsic"] = np.array([[focal_px, 0, 767.5], [0, focal_px, 599.5], [0, 0, 1]])
    group["extrinsic"] = transform(np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]]), translation)
    group["num-cols"], group["num-rows"] = np.uint64(1536), np.uint64(1200)
    group[prefix + "col-spacing"], group[prefix + "row-spacing"] = 0.2, row_spacing
    if frame:
        group["cam-coord-frame-type"] = np.bytes_(frame)


def deep_fluoro(**changes):
    return hdf5_bytes(lambda file: xreg_group(file, "/proj-params", "pixel-", **changes))


def xreg_camera(**changes):
    return hdf5_bytes(lambda file: xreg_group(file, "/", **changes))


def dicom_bytes(dataset, sop_class, **meta):
    dataset.file_meta = FileMetaDataset()
    dataset.file_meta.TransferSyntaxUID = meta.get("syntax", ExplicitVRLittleEndian)
    dataset.file_meta.MediaStorageSOPClassUID = dataset.SOPClassUID = sop_class
    dataset.file_meta.MediaStorageSOPInstanceUID = dataset.SOPInstanceUID = "1.2.3"
    dataset.is_little_endian, dataset.is_implicit_VR = True, dataset.file_meta.TransferSyntaxUID.is_implicit_VR
    memory = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        dataset.save_as(memory, write_like_original=False)
    return memory.getvalue()


def dataset(**elements):
    result = Dataset()
    for keyword, value in elements.items():
        setattr(result, keyword, value)
    return result


XA = dict(Modality="XA", DistanceSourceToDetector="1200", DistanceSourceToPatient="800", ImagerPixelSpacing=["0.4", "0.3"],
          PositionerMotion="STATIC", PositionerPrimaryAngle="0", PositionerSecondaryAngle="0", PatientOrientation=["L", "F"],
          Rows=512, Columns=400, BitsAllocated=16, BitsStored=16, HighBit=15, PixelRepresentation=0, SamplesPerPixel=1,
          PhotometricInterpretation="MONOCHROME2", PixelData=b"\0" * 64)


def xa(without=(), **changes):
    """An XA image of 400 columns and 512 rows, 0.3 and 0.4 mm apart at the detector."""
    elements = {key: value for key, value in (XA | changes).items() if key not in without}
    return dicom_bytes(dataset(**elements), "1.2.840.10008.5.1.4.1.1.12.1")


def enhanced_xa(second_primary, frame_items=None, **changes):
    """An enhanced XA image of two frames. It states once what both share, and the angles per frame."""
    geometry = dataset(DistanceSourceToDetector="1200", DistanceSourceToIsocenter=800.0)
    shared = dataset(XRayGeometrySequence=Sequence([geometry]),
                     FramePixelDataPropertiesSequence=Sequence([dataset(ImagerPixelSpacing=["0.4", "0.3"])]))
    frames = frame_items or [dataset(PositionerPositionSequence=Sequence(
        [dataset(PositionerPrimaryAngle=primary, PositionerSecondaryAngle="0")])) for primary in ("0", second_primary)]
    lacking = {"DistanceSourceToDetector", "DistanceSourceToPatient", "ImagerPixelSpacing", "PositionerMotion",
               "PositionerPrimaryAngle", "PositionerSecondaryAngle"} - set(changes)
    return xa(lacking, NumberOfFrames="2", SharedFunctionalGroupsSequence=Sequence([shared]),
              PerFrameFunctionalGroupsSequence=Sequence(frames), **changes)


def registration(own_uid, frames, undefined=False, **meta):
    """A DICOM registration of [(UID, matrix type, 16 numbers or None)]."""
    items = []
    for uid, kind, numbers in frames:
        matrix = dataset(FrameOfReferenceTransformationMatrixType=kind,
                         FrameOfReferenceTransformationMatrix=[f"{number:.10g}" for number in np.ravel([] if numbers is None else numbers)])
        of_item = Sequence([dataset(MatrixSequence=Sequence([matrix]))] if numbers is not None else [])
        items.append(dataset(FrameOfReferenceUID=uid, MatrixRegistrationSequence=of_item))
    whole = dataset(Modality="REG", FrameOfReferenceUID=own_uid, RegistrationSequence=Sequence(items))
    whole["RegistrationSequence"].is_undefined_length = undefined
    return dicom_bytes(whole, "1.2.840.10008.5.1.4.1.1.66.1", **meta)


def c_arm_rig():
    def camera(name, source, origin, column):
        return Camera(name, np.array(source), np.array(origin), np.array(column), np.array([0.0, 0.0, -1.0]),
                      np.array([1.190625, 1.190625]), np.array([256, 256]))
    return Rig(np.zeros(3), [camera("AP", [0.0, -650.0, 0.0], [-151.8046875, 370.0, 151.8046875], [1.0, 0.0, 0.0]),
                             camera("LAT", [650.0, 0.0, 0.0], [-370.0, -151.8046875, 151.8046875], [0.0, 1.0, 0.0])])


def uneven_grid():
    """An oblique CT, all axes of the grid turned."""
    return Grid(np.array([20, 30, 40]), np.array([0.5, 0.75, 2.0]), np.array([-12.0, 34.0, -56.0]), rotation_zyx([0.1, -0.2, 0.3]))


def frontal_camera(name="A"):
    return Camera(name, np.array([0.0, -650.0, 0.0]), np.array([-100.0, 370.0, 90.0]), np.array([1.0, 0.0, 0.0]),
                  np.array([0.0, 0.0, -1.0]), np.array([1.0, 1.0]), np.array([200, 180]))


UNEVEN_POSE = transform(rotation_zyx(np.radians([11.0, -23.0, 47.0])), [101.0, -202.0, 303.0])


class KnownContext:
    """A context that answers everything a reader of poses may ask."""

    def __init__(self, cameras=None, grid=None, ct_uid="1.2.3.4"):
        self.cameras, self.grid, self.ct_uid = cameras or [frontal_camera()], grid or uneven_grid(), ct_uid

    def rig(self, why):
        return Rig(np.zeros(3), list(self.cameras))

    def ct_grid(self, why):
        return self.grid

    def ct_frame_of_reference(self):
        return self.ct_uid

    def frame(self, why):
        return Frame(np.eye(4), [0.0, 0.0, 0.0])


class FileTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def file(self, content, name="camera.txt"):
        path = self.folder / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8", "surrogateescape"))
        return path

    def rig(self, content, **options):
        rig, self.notes = formats.read_rig([self.file(content)], RigOptions(**options))
        return rig

    def camera(self, content, **options):
        return self.rig(content, **options).cameras[0]

    def assert_refused(self, kind, pattern, content, **options):
        with self.assertRaisesRegex(kind, pattern):
            self.rig(content, **options)

    def assert_seen(self, camera, point, at, within_px=1e-9):
        np.testing.assert_allclose(camera.project(point), at, rtol=0, atol=within_px)

    def assert_noted(self, pattern):
        self.assertTrue(any(pattern in note for note in self.notes), self.notes)

    @contextlib.contextmanager
    def assert_input_error(self, pattern):
        with self.assertRaisesRegex(InputError, pattern):
            yield


__all__ = [name for name in dir() if not name.startswith("_")]
