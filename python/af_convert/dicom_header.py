# SPDX-License-Identifier: Apache-2.0
"""DICOM headers, read by pydicom and not trusted."""
import math
import warnings

import pydicom
from pydicom.dataelem import RawDataElement
from pydicom.uid import DeflatedExplicitVRLittleEndian

from af_programs.errors import FileError, InputError, shown

MOST_BYTES = 64 << 20  # before the pixels
PIXELS = (0x7fe00010, 0x7fe00008, 0x7fe00009)


def is_dicom(source):
    return source.head[128:132] == b"DICM"


def read_header(source, ends_with_pixels):
    """The data set without its pixels. pydicom reads a truncated file as far as it goes. So this checks that every element
    is complete, and that an image reaches its pixels."""
    reached = []

    def stop(tag, vr, length):
        if tag in PIXELS:
            reached.append(tag)
        return tag in PIXELS
    try:
        with open(source.path, "rb") as file, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            meta = pydicom.filereader.read_file_meta_info(source.path)
            if meta.get("TransferSyntaxUID", "") == DeflatedExplicitVRLittleEndian:
                raise InputError(f"{source.name}: transfer syntax: deflated files are not read")
            dataset = pydicom.filereader.read_partial(file, stop, defer_size=1 << 16)
            _require_complete(dataset, source, 0)
    except (FileError, InputError):
        raise
    except Exception as error:  # pydicom raises any kind on damaged files
        raise FileError(f"{source.name}: broken DICOM: {shown(str(error), 100)}") from error
    if ends_with_pixels and not reached:
        raise FileError(f"{source.name}: broken DICOM: truncated before the pixels")
    return dataset


def _require_complete(dataset, source, depth):
    if depth > 16:
        raise FileError(f"{source.name}: broken DICOM: sequences are nested too deeply")
    for tag in list(dataset.keys()):
        element = dataset.get_item(tag)
        if isinstance(element, RawDataElement) and element.value is not None and element.length != 0xffffffff and \
                len(element.value) != element.length:
            raise FileError(f"{source.name}: broken DICOM: truncated in {tag}")
        if element.VR == "SQ" or (element.VR in (None, "UN") and pydicom.datadict.dictionary_has_tag(tag) and
                                  pydicom.datadict.dictionary_VR(tag) == "SQ"):
            for item in dataset[tag].value or []:
                _require_complete(item, source, depth + 1)


def text_of(dataset, keyword):
    value = _value(dataset, keyword)
    return "" if value is None else str(value).strip(" \0")


def _value(dataset, keyword):
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return dataset.get(keyword)
    except Exception as error:
        raise FileError(f"broken DICOM: {keyword}: {shown(str(error), 100)}") from error


def numbers_of(dataset, keyword, place):
    """Finite numbers. The list is empty where the element is absent or empty."""
    value = _value(dataset, keyword)
    if value is None or value == "":
        return []
    values = [value] if isinstance(value, (str, int, float)) or not hasattr(value, "__iter__") else list(value)
    try:
        numbers = [float(one) for one in values if one != ""]
    except (TypeError, ValueError) as error:
        raise InputError(f"{place}: {keyword} = '{shown(str(value))}': must be numbers") from error
    if not all(math.isfinite(number) for number in numbers):
        raise InputError(f"{place}: {keyword} = '{shown(str(value))}': must be finite")
    return numbers


def items_of(dataset, keyword):
    value = _value(dataset, keyword)
    return list(value) if isinstance(value, pydicom.sequence.Sequence) else []
