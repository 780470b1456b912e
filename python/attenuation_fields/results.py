# SPDX-License-Identifier: Apache-2.0
"""Files that the programs write, as arrays, and tasks that take one call."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any, Dict, Mapping, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from attenuation_fields._core import (
    Camera,
    Ct,
    PoseFrame,
    RayCaster,
    Registration,
    RegistrationCase,
    Table,
)
from attenuation_fields.errors import FileError

Path = Union[str, "os.PathLike[str]"]
Column = Union[NDArray[np.float64], NDArray[np.str_]]

_TEXT_COLUMNS = frozenset(
    ["case", "renderer", "relative_to", "stop_reason", "chain", "verdict", "error"]
)


@dataclass(frozen=True)
class Result:
    """A result.json. Numbers that do not exist are NaN, poses None."""

    verdict: str
    reason: str
    case: str
    renderer: str
    room_from_ct: Optional[NDArray[np.float64]]
    """The pose that was found; None when nothing was found."""
    rejected_room_from_ct: Optional[NDArray[np.float64]]
    """Where the search ended when nothing was found."""
    tre_mm: float
    similarity: float
    contents: Mapping[str, Any]
    """All of the file."""


def _matrix(value: Any, path: str, key: str) -> Optional[NDArray[np.float64]]:
    if value is None:
        return None
    try:
        matrix = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        matrix = np.empty(0)
    if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
        raise FileError(f"{path}: {key}: expected a 4x4 matrix of numbers, found {value!r}")
    return matrix


def _number(value: Any, path: str, key: str) -> float:
    if value is None:
        return float("nan")
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise FileError(f"{path}: {key}: expected a number, found {value!r}")
    return float(value)


def read_result(path: Path) -> Result:
    """Reads a result.json of af-register, or the one in a folder. Raises FileError."""
    name = os.fspath(path)
    if os.path.isdir(name):
        name = os.path.join(name, "result.json")
    try:
        with open(name, encoding="utf-8") as file:
            contents: Dict[str, Any] = json.load(file)
    except OSError as error:
        raise FileError(f"{name}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise FileError(f"{name}: is not JSON: {error}") from error
    if not isinstance(contents, dict) or "verdict" not in contents:
        raise FileError(f"{name}: is not a result.json of af-register")
    return Result(
        verdict=str(contents["verdict"]),
        reason=str(contents.get("verdict_reason", "")),
        case=str(contents.get("case", "")),
        renderer=str(contents.get("renderer", "")),
        room_from_ct=_matrix(contents.get("room_from_ct"), name, "room_from_ct"),
        rejected_room_from_ct=_matrix(
            contents.get("rejected_room_from_ct"), name, "rejected_room_from_ct"
        ),
        tre_mm=_number(contents.get("tre_mm"), name, "tre_mm"),
        similarity=_number(contents.get("similarity"), name, "similarity"),
        contents=contents,
    )


def _columns(path: Path) -> Dict[str, Column]:
    table = Table.read(path)
    return {
        name: np.array(table.texts(name), dtype=np.str_)
        if name in _TEXT_COLUMNS
        else table.numbers(name)
        for name in table.columns
    }


def read_registrations(path: Path) -> Dict[str, Column]:
    """The columns of a registrations.csv, in its order: float64, texts as str. Raises FileError."""
    return _columns(path)


def read_image_quality(path: Path) -> Dict[str, Column]:
    """The columns of an image-quality.csv: float64. Raises FileError."""
    return _columns(path)


def ray_cast(
    ct: Ct,
    camera: Camera,
    rotation_deg: ArrayLike = (0.0, 0.0, 0.0),
    translation_mm: ArrayLike = (0.0, 0.0, 0.0),
    *,
    isocenter_point: ArrayLike = (0.0, 0.0, 0.0),
    frame: Optional[PoseFrame] = None,
    water_mu_per_mm: float = 0.0200,
    step_mm: float = 1.0,
    threads: int = 1,
    tube_kvp: float = 0.0,
    aluminium_mm: float = 3.0,
    scatter_to_primary: float = 0.0,
) -> NDArray[np.float32]:
    """One DRR cast through a CT. For several, a RayCaster keeps what they share."""
    caster = RayCaster(
        ct,
        camera,
        isocenter_point=isocenter_point,
        frame=frame,
        water_mu_per_mm=water_mu_per_mm,
        step_mm=step_mm,
        threads=threads,
        tube_kvp=tube_kvp,
        aluminium_mm=aluminium_mm,
        scatter_to_primary=scatter_to_primary,
    )
    return caster.drr(rotation_deg, translation_mm)


def register(
    study: Path,
    case_name: str = "",
    *,
    rotation_deg: Optional[ArrayLike] = None,
    translation_mm: Optional[ArrayLike] = None,
    **options: Any,
) -> Registration:
    """Registers a case of a study from one start, as af-register does.

    The start is relative to the nominal pose; without one it is the pose of the study's landmarks,
    or the nominal pose where the study has none. Options are those of RegistrationCase.load(),
    which is for several starts.
    """
    case = RegistrationCase.load(study, case_name, **options)
    if rotation_deg is None and translation_mm is None:
        return case.run()
    zero = (0.0, 0.0, 0.0)
    rotation = zero if rotation_deg is None else rotation_deg
    translation = zero if translation_mm is None else translation_mm
    return case.run(case.frame.pose(rotation, translation))
