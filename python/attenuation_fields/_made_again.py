# SPDX-License-Identifier: Apache-2.0
"""Functions that pickle calls to remake objects from the arguments that first made them."""

from typing import Any, Dict

from attenuation_fields._core import Field, RayCaster, RegistrationCase, Table
from attenuation_fields.errors import FileError


def field(arguments: Dict[str, Any], payload_sha256: str) -> Field:
    found = Field.open(**arguments)
    if found.payload_sha256 != payload_sha256:
        raise FileError(
            f"{arguments['path']}: payload_sha256: expected {payload_sha256}, that of the pickled "
            f"field, found {found.payload_sha256}"
        )
    return found


def ray_caster(arguments: Dict[str, Any]) -> RayCaster:
    return RayCaster(**arguments)


def registration_case(arguments: Dict[str, Any]) -> RegistrationCase:
    options = dict(arguments)
    xrays = options.pop("xrays", {})
    case = RegistrationCase.load(**options)
    if xrays:
        case.set_xrays(xrays)
    return case


def table(arguments: Dict[str, Any]) -> Table:
    return Table.read(**arguments)
