# SPDX-License-Identifier: Apache-2.0
"""Transform parameters of elastix with (FocalPoint x y z), which its ray-casting interpolators read. The fixed image is the
X-ray, a slice of one voxel in the CT's physical space (LPS, mm). Rays run from its pixels to the focal point."""
import numpy as np

from af_programs.errors import FileError, InputError, shown

from .geometry import Camera, camera_problems
from .rig import one_camera, require, unread_note
from .source import lines_of, numbers_of, numbers_text, size_of

KNOWN = set("""FocalPoint Size Index Spacing Origin Direction PreParameters UseDirectionCosines Transform NumberOfParameters
TransformParameters InitialTransformParametersFileName InitialTransformParameterFileName HowToCombineTransforms
CenterOfRotationPoint ComputeZYX FixedImageDimension MovingImageDimension FixedInternalImagePixelType
MovingInternalImagePixelType ResampleInterpolator FinalBSplineInterpolationOrder Threshold Resampler DefaultPixelValue
ResultImageFormat ResultImagePixelType CompressResultImage""".split())


def is_elastix(source):
    return source.has_line("(FocalPoint")


def _parameters(source):
    """(line, words) by key, from lines "(Key value ...)". Comments begin with "//"."""
    found = {}
    for line in source.lines:
        place = source.place(line)
        if line.text.startswith("//"):
            continue
        if not line.text.startswith("("):
            raise FileError(f"{place}: '{shown(line.text)}' is no parameter in brackets")
        inside, bracket, _ = line.text[1:].partition(")")
        if not bracket:
            raise FileError(f"{place}: truncated: a parameter is not closed")
        key, _, values = inside.replace("\t", " ").partition(" ")
        require(key not in found, f"{place}: ({shown(key)} ...) is there twice")
        found[key] = line, [word for part in lines_of(values) for word in part.words]
    return found


def read_elastix(source, options):
    parameters = _parameters(source)

    def numbers(key, count=None):
        if key not in parameters:
            raise InputError(f"{source.name}: ({key} ...) is missing; transform parameters of elastix hold it")
        line, words = parameters[key]
        if count is not None and len(words) != count:
            raise FileError(f"{source.place(line)}: expected {count} numbers, found '{shown(line.text)}'")
        return numbers_of(words, source.place(line))

    def is_zero(key):
        return key not in parameters or not numbers(key).any()
    require(is_zero("PreParameters"), f"{source.name}: PreParameters must be 0: they turn the CT, not the camera")
    size, spacing, direction = numbers("Size", 3), numbers("Spacing", 3), numbers("Direction", 9)
    require(size[2] == 1, f"{source.name}: Size: the X-ray must be a single slice")
    require(is_zero("Index"), f"{source.name}: Index must be 0 0 0")
    require(parameters.get("UseDirectionCosines", (None, []))[1] != ['"false"'],
            f'{source.name}: UseDirectionCosines must be "true": Direction is read')
    require(spacing.min() > 0, f"{source.name}: Spacing must be above 0")
    # elastix lists the matrix column by column, so the first three numbers are the direction of columns.
    camera = Camera("of the file", numbers("FocalPoint", 3), numbers("Origin", 3), direction[:3], direction[3:6], spacing[:2],
                    size_of(size[:2], f"{source.name}: Size"))
    for problem in camera_problems(camera):
        raise InputError(f"{source.name}: {problem}")
    stated = one_camera(source, camera)
    if not is_zero("TransformParameters"):
        stated.notes.append(f"{source.name}: TransformParameters are a pose of the CT and are not read")
    stated.notes += unread_note(source, [shown(key) for key in sorted(parameters) if key not in KNOWN])
    return stated


def write_elastix(rig):
    """Parameters for transformix. With the CT as the moving image they give the DRR at the identity."""
    camera = rig.cameras[0]
    direction = np.array([camera.column_direction, camera.row_direction, np.cross(camera.column_direction, camera.row_direction)])
    return f"// Camera {camera.name}\n" + "".join(f"({key} {values})\n" for key, values in (
        ("Transform", '"EulerTransform"'), ("NumberOfParameters", "6"), ("TransformParameters", "0 0 0 0 0 0"),
        ("InitialTransformParametersFileName", '"NoInitialTransform"'), ("HowToCombineTransforms", '"Compose"'),
        ("CenterOfRotationPoint", numbers_text(rig.isocenter_point)), ("ComputeZYX", '"false"'), ("FixedImageDimension", "3"),
        ("MovingImageDimension", "3"), ("FixedInternalImagePixelType", '"float"'), ("MovingInternalImagePixelType", '"float"'),
        ("Size", f"{camera.size_px[0]} {camera.size_px[1]} 1"), ("Index", "0 0 0"),
        ("Spacing", numbers_text(camera.pixel_spacing_mm) + " 1"), ("Origin", numbers_text(camera.detector_origin_point)),
        ("Direction", numbers_text(direction)), ("UseDirectionCosines", '"true"'),
        ("ResampleInterpolator", '"FinalRayCastInterpolator"'), ("FocalPoint", numbers_text(camera.source_point)),
        ("PreParameters", "0 0 0 0 0 0"), ("Threshold", "0"), ("Resampler", '"DefaultResampler"'), ("DefaultPixelValue", "0"),
        ("ResultImageFormat", '"mha"'), ("ResultImagePixelType", '"float"'), ("CompressResultImage", '"false"')))
