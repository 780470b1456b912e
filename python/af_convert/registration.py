# SPDX-License-Identifier: Apache-2.0
"""DICOM Spatial Registration objects (PS3.3, A.39 and C.20.2). For each frame of reference they hold the matrix that takes
its points to the registered frame, here the room's, in mm."""
import hashlib
import io

import numpy as np
import pydicom
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.sequence import Sequence

from af_programs.errors import FileError, InputError, shown

from .dicom_header import is_dicom, items_of, numbers_of, read_header, text_of
from .geometry import inverse, rigid
from .rig import require

SOP_CLASS = "1.2.840.10008.5.1.4.1.1.66.1"


def is_registration(source):
    if not is_dicom(source):
        return False
    try:
        return text_of(read_header(source, False), "SOPClassUID") == SOP_CLASS
    except (FileError, InputError):
        return SOP_CLASS.encode() in source.head  # it is damaged, and reading it says so


def _matrix_of(item, place):
    """The product of an item's matrices, which are applied in their order. None where it has none."""
    matrix = None
    for registration in items_of(item, "MatrixRegistrationSequence"):
        for one in items_of(registration, "MatrixSequence"):
            kind = text_of(one, "FrameOfReferenceTransformationMatrixType")
            require(kind == "RIGID", f"{place}: matrix type = {shown(kind)}: must be RIGID")
            numbers = numbers_of(one, "FrameOfReferenceTransformationMatrix", place)
            if len(numbers) != 16:
                raise FileError(f"{place}: numbers of the matrix: expected 16, found {len(numbers)}")
            matrix = rigid(np.reshape(numbers, (4, 4)), place) @ (np.eye(4) if matrix is None else matrix)
    return matrix


def read_registration(source, context):
    """The room is the object's own frame of reference, or that of the item whose matrix stands for it. The CT's item is the
    one with the CT's UID if that is known, or else the only one with another frame. If the object's own frame is the CT's,
    its only other one is the room's."""
    header = read_header(source, False)
    sop_class = text_of(header, "SOPClassUID")
    require(sop_class == SOP_CLASS, f"{source.name}: SOP class = {shown(sop_class)}: must be {SOP_CLASS}, a spatial registration")
    frames = [(text_of(item, "FrameOfReferenceUID"), _matrix_of(item, source.name))
              for item in items_of(header, "RegistrationSequence")]
    if not frames:
        raise FileError(f"{source.name}: has no registration (0070,0308)")
    uids = [uid for uid, _ in frames]
    listed = "it has " + ", ".join(shown(uid) or "one without UID" for uid in uids)
    require(len(set(uids)) == len(uids), f"{source.name}: registers a frame of reference twice; {listed}")
    own_uid, ct_uid = text_of(header, "FrameOfReferenceUID"), context.ct_frame_of_reference()
    for uid, matrix in frames:
        if matrix is None and uid != own_uid:
            raise FileError(f"{source.name}: has no matrix of the frame of reference {shown(uid)}")
    matrices = {uid: np.eye(4) if matrix is None else matrix for uid, matrix in frames}
    others = [uid for uid in uids if uid not in (own_uid, ct_uid)]
    if ct_uid and ct_uid == own_uid:
        require(len(others) <= 1, f"{source.name}: its own frame of reference is the CT's ({ct_uid}); which is the room's is not "
                f"known: {listed}")
        ct, room = ct_uid, others[0] if others else None
    elif ct_uid in matrices:
        ct, room = ct_uid, own_uid
    elif len(others) == 1:
        ct, room = others[0], own_uid
    else:
        require(len(frames) == 1, f"{source.name}: which frame of reference is the CT's is not known; {listed}")
        ct, room = own_uid, None
    notes = []
    if not ct_uid or ct != ct_uid:
        of_ct = f"which is {ct_uid}" if ct_uid else "whose own is not known (--ct or --study states it)"
        notes.append(f"{source.name}: the frame of reference {ct} is taken as the CT's, {of_ct}")
    notes += [f"{source.name}: the matrix of the frame of reference {uid} is not read: it is neither the CT's nor the object's own"
              for uid in uids if uid not in (ct, room)]
    # The object's own frame need not be listed.
    return [(1, inverse(matrices.get(room, np.eye(4))) @ matrices.get(ct, np.eye(4)))], notes


def _uid_of(content):
    """A UID made from 120 bits of a hash (PS3.5, B.2), so that equal content has an equal UID."""
    return f"2.25.{int(hashlib.sha256(content.encode()).hexdigest()[:30], 16)}"


def _decimal_string(value):
    """A number in at most 16 characters (PS3.5, 6.2), which keeps 1e-9 of a rotation and 1e-7 mm or better."""
    return next((text for digits in range(17, 5, -1) if len(text := f"{value + 0.0:.{digits}g}") <= 16), "0")


def _item(uid, matrix):
    inner = Dataset()
    inner.FrameOfReferenceTransformationMatrixType = "RIGID"
    inner.FrameOfReferenceTransformationMatrix = [_decimal_string(value) for value in np.ravel(matrix)]
    registration, item = Dataset(), Dataset()
    registration.MatrixSequence = Sequence([inner])
    registration.RegistrationTypeCodeSequence = Sequence([])
    item.FrameOfReferenceUID = uid
    item.MatrixRegistrationSequence = Sequence([registration])
    return item


def write_registration(poses, context):
    """Writes two items: the room's with the identity, and the CT's with room_from_ct. UIDs that are not known are derived
    from the pose, so that the same pose gives the same file."""
    pose = poses[0]
    matrix = "\\".join(_decimal_string(value) for value in np.ravel(pose))
    ct_uid = context.ct_frame_of_reference() or _uid_of("ct " + matrix)
    room_uid = _uid_of("room " + matrix)
    dataset = Dataset()
    for keyword in """StudyDate StudyTime AccessionNumber ReferringPhysicianName PatientName PatientID PatientBirthDate PatientSex
            StudyID PositionReferenceIndicator ContentCreatorName""".split():
        setattr(dataset, keyword, "")
    for keyword, value in (("SOPClassUID", SOP_CLASS), ("SOPInstanceUID", _uid_of(f"instance {ct_uid}{matrix}")),
                           ("ContentDate", "19700101"), ("ContentTime", "000000"), ("Modality", "REG"),
                           ("Manufacturer", "attenuation fields"), ("StudyInstanceUID", _uid_of("study " + ct_uid)),
                           ("SeriesInstanceUID", _uid_of("series " + ct_uid)), ("SeriesNumber", 1), ("InstanceNumber", 1),
                           ("FrameOfReferenceUID", room_uid), ("ContentLabel", "ROOM_FROM_CT"),
                           ("ContentDescription", "x_room = M x_ct"),
                           ("RegistrationSequence", Sequence([_item(room_uid, np.eye(4)), _item(ct_uid, pose)]))):
        setattr(dataset, keyword, value)
    dataset.file_meta = FileMetaDataset()
    dataset.file_meta.TransferSyntaxUID = pydicom.uid.ExplicitVRLittleEndian
    dataset.file_meta.MediaStorageSOPClassUID = SOP_CLASS
    dataset.file_meta.MediaStorageSOPInstanceUID = dataset.SOPInstanceUID
    dataset.file_meta.ImplementationClassUID = "2.25.194378151219367187215338912740285619473"
    dataset.is_little_endian, dataset.is_implicit_VR = True, False
    memory = io.BytesIO()
    pydicom.dcmwrite(memory, dataset, write_like_original=False)
    return memory.getvalue()
