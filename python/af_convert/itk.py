# SPDX-License-Identifier: Apache-2.0
"""ITK transforms as text and in HDF5: x' = A (x - c) + c + t, where c are the fixed parameters. A pose is stored in the
resampling direction, ct_from_room in LPS mm, so that Slicer, applying it to the CT, shows the CT in the room."""
import math

import numpy as np

from af_programs.errors import FileError, InputError, shown

from . import hdf5
from .geometry import about, inverse, quaternion_rotation, rigid, transform
from .rig import require
from .source import number_of, numbers_text

GROUP = "/TransformGroup"
KEYS = ("Transform", "Parameters", "FixedParameters")


def _versor(p, fixed, place):
    square = p[:3] @ p[:3]
    require(square <= 1 + 1e-9, f"{place}: the versor's vector part is longer than 1")
    return quaternion_rotation(math.sqrt(max(0.0, 1 - square)), *p[:3])


def _quaternion(p, fixed, place):
    require(abs(np.linalg.norm(p[:4]) - 1) <= 1e-5, f"{place}: the quaternion's norm is not 1")
    return quaternion_rotation(p[3], *p[:3])


def _euler(p, fixed, place):
    """Rz Rx Ry, or Rz Ry Rx when a fourth fixed parameter says so (itk::Euler3DTransform::ComputeZYX)."""
    x, y, z = (about(axis, p[axis]) for axis in range(3))
    return z @ y @ x if len(fixed) > 3 and fixed[3] != 0 else z @ x @ y


def _matrix(p, fixed, place):
    return p[:9].reshape(3, 3)


# Number of parameters, whether the last three are a translation, numbers of fixed parameters, A.
TYPES = {"AffineTransform": (12, True, (3,), _matrix), "MatrixOffsetTransformBase": (12, True, (3,), _matrix),
         "Rigid3DTransform": (12, True, (3,), _matrix), "VersorRigid3DTransform": (6, True, (3,), _versor),
         "VersorTransform": (3, False, (3,), _versor), "QuaternionRigidTransform": (7, True, (3,), _quaternion),
         "Euler3DTransform": (6, True, (3, 4), _euler),
         "TranslationTransform": (3, True, (0,), lambda p, fixed, place: np.eye(3))}


def _pose(kind, parameters, fixed, place):
    """room_from_ct of a transform."""
    name = kind.partition("_")[0]
    if name not in TYPES or not kind.endswith("_3_3"):
        raise InputError(f"{place}: Transform = {shown(kind)}: must be one of {', '.join(TYPES)}, in three dimensions "
                         "(_double_3_3)")
    count, has_translation, fixed_counts, linear = TYPES[name]
    for what, numbers, counts in (("Parameters", parameters, (count,)), ("FixedParameters", fixed, fixed_counts)):
        if len(numbers) not in counts:
            raise FileError(f"{place}: number of {what}: expected {' or '.join(map(str, counts))}, found {len(numbers)}")
    center = fixed[:3] if len(fixed) else np.zeros(3)
    a = linear(parameters, fixed, place)
    return inverse(rigid(transform(a, (parameters[-3:] if has_translation else 0) + center - a @ center), place))


def is_itk_text(source):
    return source.text.lstrip().startswith("#Insight")


def read_itk_text(source, context):
    fields = {}
    for line in source.lines:
        if line.text.startswith("#"):
            continue
        key, colon, value = line.text.partition(":")
        if not colon:
            raise FileError(f"{source.place(line)}: '{shown(line.text, 40)}' has no colon")
        require(key in KEYS, f"{source.place(line)}: field = '{shown(key, 40)}': must be one of {', '.join(KEYS)}")
        if key in fields:
            raise FileError(f"{source.place(line)}: '{key}' is repeated; one transform is expected")
        fields[key] = value.split()
    for key in KEYS:
        if key not in fields:
            raise FileError(f"{source.name}: has no '{key}:' line")
    numbers = [np.array([_finite(word, f"{source.name}: {key}") for word in fields[key]]) for key in KEYS[1:]]
    return [(1, _pose(" ".join(fields["Transform"]), *numbers, source.name))], []


def _finite(word, place):
    """A number, which must be finite: in a pose anything else is damage."""
    try:
        return number_of(word, place)
    except InputError as error:
        raise FileError(str(error)) from error


def _parameters(pose):
    ct_from_room = inverse(pose)
    return np.concatenate([ct_from_room[:3, :3].ravel(), ct_from_room[:3, 3]])


def write_itk_text(poses, context):
    return (f"#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\nParameters: "
            f"{numbers_text(_parameters(poses[0]))}\nFixedParameters: 0 0 0\n")


def is_itk_hdf5(source):
    if not hdf5.is_hdf5(source):
        return False
    try:
        return GROUP[1:] in hdf5.datasets(source, lambda file: [""])[""]
    except FileError:
        return True  # it is damaged, and reading it says so


def read_itk_hdf5(source, context):
    groups = hdf5.datasets(source, lambda file: [name for name in (GROUP, GROUP + "/0") if name in file])
    group = groups.get(GROUP + "/0")
    if group is None:
        raise FileError(f"{source.name}: has no {GROUP}/0: not an ITK transform")
    require("1" not in groups[GROUP], f"{source.name}: holds several transforms (a composite one); one is expected")

    def numbers(name):
        # ITK 4 wrote both lists without the s.
        value = group.pop(name, None) or group.pop(name.replace("Transform", "Tranform"), None)
        if not isinstance(value, list):
            raise FileError(f"{source.name}: has no numbers {GROUP}/0/{name}")
        require(np.all(np.isfinite(value[1])), f"{source.name}: {name}: must be finite")
        return np.array(value[1])
    kind, parameters, fixed = group.pop("TransformType", None), numbers("TransformParameters"), numbers("TransformFixedParameters")
    if not isinstance(kind, str):
        raise FileError(f"{source.name}: has no text {GROUP}/0/TransformType")
    for name in group:
        raise InputError(f"{source.name}: {GROUP}/0 = {shown(name)}: is not known in a transform")
    return [(1, _pose(kind, parameters, fixed, source.name))], []


def write_itk_hdf5(poses, context):
    def fill(file):
        for name, text in (("ITKVersion", "5.2.1"), ("HDFVersion", "HDF5"), ("OSName", "-"), ("OSVersion", "-"),
                           (GROUP + "/0/TransformType", "AffineTransform_double_3_3")):
            file.create_dataset(name, data=[text], dtype=hdf5.h5py.string_dtype("ascii"))
        file[GROUP + "/0/TransformFixedParameters"] = np.zeros(3)
        file[GROUP + "/0/TransformParameters"] = _parameters(poses[0])
    return hdf5.file_bytes(fill)
