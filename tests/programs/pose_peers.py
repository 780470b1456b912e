#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Poses of af-inspect against other people's readers and writers: pydicom, h5py, scipy. Exit 77: not installed."""
import json
import pathlib
import resource
import subprocess
import sys
import tempfile

try:
    import h5py
    import numpy as np
    import pydicom
    from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
    from pydicom.sequence import Sequence
    from scipy.spatial.transform import Rotation
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

INSPECT = sys.argv[1]
FOLDER = pathlib.Path(tempfile.mkdtemp())
SPATIAL_REGISTRATION = "1.2.840.10008.5.1.4.1.1.66.1"
# Different about every axis.
POSE = np.eye(4)
POSE[:3, :3] = Rotation.from_euler("ZYX", [47.0, -23.0, 11.0], degrees=True).as_matrix()
POSE[:3, 3] = [101.0, -202.0, 303.0]
FAILURES = []


def inspect(*arguments):
    return subprocess.run([INSPECT, *map(str, arguments)], check=True, capture_output=True, text=True).stdout


def require_close(what, found, expected, tolerance):
    error = np.abs(np.asarray(found) - np.asarray(expected)).max()
    print(f"{what}: largest difference {error:.1e} (allowed {tolerance:.0e})")
    if not error <= tolerance:
        FAILURES.append(what)


def pose_read(path):
    return json.loads(inspect("--json", path))[0]["facts"]["room_from_ct"]


def text_pose(pose):
    path = FOLDER / "pose.txt"
    path.write_text("\n".join(" ".join(repr(float(x)) for x in row) for row in pose))
    return path


def check_dicom():
    def item(uid, matrix):
        inner = Dataset()
        inner.FrameOfReferenceTransformationMatrixType = "RIGID"
        # At most 16 characters, as the standard has it.
        inner.FrameOfReferenceTransformationMatrix = [f"{x:.12g}"[:16] for x in matrix.ravel()]
        outer = Dataset()
        outer.MatrixSequence = Sequence([inner])
        frame = Dataset()
        frame.FrameOfReferenceUID = uid
        frame.MatrixRegistrationSequence = Sequence([outer])
        return frame

    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = SPATIAL_REGISTRATION
    meta.MediaStorageSOPInstanceUID = "1.2.3"
    for syntax in (pydicom.uid.ExplicitVRLittleEndian, pydicom.uid.ImplicitVRLittleEndian):
        for undefined in (False, True):
            meta.TransferSyntaxUID = syntax
            path = FOLDER / "peer.dcm"
            data = FileDataset(str(path), {}, file_meta=meta, preamble=b"\0" * 128)
            data.is_little_endian = True
            data.is_implicit_VR = syntax == pydicom.uid.ImplicitVRLittleEndian
            data.SOPClassUID = SPATIAL_REGISTRATION
            data.SOPInstanceUID = "1.2.3"
            data.FrameOfReferenceUID = "1.1"
            data.RegistrationSequence = Sequence([item("1.1", np.eye(4)), item("1.2", POSE)])
            data["RegistrationSequence"].is_undefined_length = undefined
            data.save_as(path)
            require_close(f"pydicom's registration, {syntax.name}, open {undefined}", pose_read(path), POSE, 1e-8)
    path = FOLDER / "ours.dcm"
    inspect(text_pose(POSE), "--pose-to", "dicom", "-o", path)
    ours = pydicom.dcmread(path)
    require_close("our registration's first item",
                  np.reshape(ours.RegistrationSequence[0].MatrixRegistrationSequence[0].MatrixSequence[0]
                             .FrameOfReferenceTransformationMatrix, (4, 4)).astype(float), np.eye(4), 0)
    require_close("our registration's second item",
                  np.reshape(ours.RegistrationSequence[1].MatrixRegistrationSequence[0].MatrixSequence[0]
                             .FrameOfReferenceTransformationMatrix, (4, 4)).astype(float), POSE, 1e-9)
    if ours.file_meta.MediaStorageSOPClassUID != SPATIAL_REGISTRATION or ours.Modality != "REG":
        FAILURES.append("class of our registration")


def check_hdf5():
    inverse = np.linalg.inv(POSE)
    parameters = np.concatenate([inverse[:3, :3].ravel(), inverse[:3, 3]])
    for letters in ("TransformParameters", "TransformFixedParameters"), ("TranformParameters", "TranformFixedParameters"):
        path = FOLDER / "peer.h5"
        with h5py.File(path, "w") as file:
            group = file.create_group("TransformGroup/0")
            group.create_dataset("TransformType", data=["AffineTransform_double_3_3"], dtype=h5py.string_dtype("ascii"))
            group.create_dataset(letters[0], data=parameters)
            group.create_dataset(letters[1], data=np.zeros(3))
        require_close(f"h5py's {letters[0]}", pose_read(path), POSE, 1e-12)
    # A text that claims a gigabyte is refused before there is memory for it.
    with h5py.File(path, "w") as file:
        group = file.create_group("TransformGroup/0")
        group.create_dataset("TransformType", shape=(1,), dtype="S1000000000")
        group.create_dataset("TransformParameters", data=parameters)
        group.create_dataset("TransformFixedParameters", data=np.zeros(3))
    if subprocess.run([INSPECT, path], capture_output=True).returncode != 4:
        FAILURES.append("a text of a gigabyte")
    megabytes = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024
    print(f"most memory of af-inspect: {megabytes} MB")
    if megabytes > 500:
        FAILURES.append("memory for a text of a gigabyte")
    path = FOLDER / "ours.h5"
    inspect(text_pose(POSE), "--pose-to", "itk-hdf5", "-o", path)
    with h5py.File(path) as file:
        group = file["TransformGroup/0"]
        require_close("our HDF5 parameters", group["TransformParameters"][:], parameters, 1e-12)
        if group["TransformType"][0] != b"AffineTransform_double_3_3":
            FAILURES.append("type of our HDF5 transform")


def check_itk_text():
    center = np.array([10.0, 20.0, 30.0])
    translation = np.array([4.0, 5.0, 6.0])
    angles = [0.1, 0.2, 0.3]  # x, y, z
    versor = Rotation.from_euler("zyx", [0.3, -0.2, 0.1]).as_quat()
    # ITK's Rz Rx Ry turns about fixed axes y first: scipy's capital letters turn with the body, in product order.
    for name, rotation, parameters in (
            ("Euler3DTransform", Rotation.from_euler("ZXY", [angles[2], angles[0], angles[1]]), angles),
            ("VersorRigid3DTransform", Rotation.from_quat(versor), list(versor[:3] * np.sign(versor[3]))),
            ("QuaternionRigidTransform", Rotation.from_quat(versor), list(versor))):
        path = FOLDER / "peer.tfm"
        path.write_text("#Insight Transform File V1.0\n#Transform 0\nTransform: " + name + "_double_3_3\nParameters: " +
                        " ".join(repr(float(x)) for x in [*parameters, *translation]) + "\nFixedParameters: 10 20 30\n")
        ct_from_room = np.eye(4)
        ct_from_room[:3, :3] = rotation.as_matrix()
        ct_from_room[:3, 3] = translation + center - rotation.apply(center)
        require_close(f"scipy's {name}", pose_read(path), np.linalg.inv(ct_from_room), 1e-12)


def check_diffdrr():
    rig = FOLDER / "rig.toml"
    rig.write_text('isocenter_point = [0.0, 0.0, 0.0]\n[[camera]]\nname = "A"\nsource_point = [0.0, -650.0, 0.0]\n'
                   "detector_origin_point = [-100.0, 370.0, 100.0]\ncolumn_direction = [1.0, 0.0, 0.0]\n"
                   "row_direction = [0.0, 0.0, -1.0]\npixel_spacing_mm = [1.0, 1.0]\nsize_px = [200, 200]\n")
    middle = np.array([3.0, -4.0, 5.0])
    angles, translation = [0.3, -0.2, 0.5], np.array([12.0, 640.0, -9.0])
    ras_from_lps = np.diag([-1.0, -1.0, 1.0, 1.0])
    to_middle = np.eye(4)
    to_middle[:3, 3] = -middle
    room_from_camera = np.eye(4)
    room_from_camera[:3, :3] = np.array([[-1, 0, 0], [0, 0, 1], [0, 1, 0]])  # columns: -columns, -rows, beam
    room_from_camera[:3, 3] = [0.0, -650.0, 0.0]
    turns = {"AP": np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), "PA": np.array([[-1, 0, 0], [0, 0, 1], [0, 1, 0]]),
             "none": np.eye(3)}
    for orientation, turn in turns.items():
        for convention in ("ZXY", "ZYX", "XYZ", "ZXZ"):
            rotation = Rotation.from_euler(convention, angles).as_matrix()
            world_from_camera = np.eye(4)
            world_from_camera[:3, :3] = rotation @ turn
            world_from_camera[:3, 3] = rotation @ translation
            expected = room_from_camera @ np.linalg.inv(world_from_camera) @ ras_from_lps @ to_middle
            path, out = FOLDER / "diffdrr.toml", FOLDER / "out.txt"
            path.write_text(f'diffdrr_parameterization = "euler_angles"\nconvention = "{convention}"\n'
                            f'orientation = "{orientation}"\nvolume_middle_ct_mm = {middle.tolist()}\n'
                            f"rotation_rad = [{angles}]\ntranslation_mm = [{translation.tolist()}]\n")
            inspect(path, "--pose-to", "matrix", "--rig", rig, "-o", out)
            require_close(f"DiffDRR {orientation} {convention}", np.loadtxt(out), expected, 1e-9)


check_dicom()
check_hdf5()
check_itk_text()
check_diffdrr()
for failure in FAILURES:
    print(f"FAILED: {failure}")
sys.exit(1 if FAILURES else 0)
