# SPDX-License-Identifier: Apache-2.0
"""Registration by automatic differentiation, written here after the description of DiffDRR (Gopalakrishnan and Golland,
Clinical Image-Based Procedures 2022): DRRs by trilinear samples along rays in PyTorch, normalised cross-correlation of
the whole region and of patches (multi-scale NCC), Adam. It is not DiffDRR's code. Needs torch and numpy.

    python3 evaluate/peers/autodiff_registration.py --study study.toml --case NAME --starts starts.csv -o poses.csv
"""
import numpy as np
import torch

from peer_case import PeerCase, options_of, run

SAMPLES = 128  # along a ray, over the CT's sphere
PATCH = 13
# Coarse to fine: pixels so many times as wide, steps, learning rates of rad and mm at the start; they fall by 0.97.
STAGES = ((8, 80, 0.02, 2.0), (4, 60, 0.004, 0.4))
DECAY = 0.97


def turn(angles):
    """Rz Ry Rx of a tensor of three angles."""
    s, c = torch.sin(angles), torch.cos(angles)
    one, zero = torch.ones(()), torch.zeros(())
    rx = torch.stack([one, zero, zero, zero, c[0], -s[0], zero, s[0], c[0]]).reshape(3, 3)
    ry = torch.stack([c[1], zero, s[1], zero, one, zero, -s[1], zero, c[1]]).reshape(3, 3)
    rz = torch.stack([c[2], -s[2], zero, s[2], c[2], zero, zero, zero, one]).reshape(3, 3)
    return rz @ ry @ rx


class Projector:
    """DRRs of a case's CT for one view's region, differentiable by the pose."""

    def __init__(self, case, view, factor):
        image, columns, rows = view.region(factor)
        self.xray = torch.tensor(image, dtype=torch.float32)
        room = view.camera.points(*np.meshgrid(columns, rows)).reshape(-1, 3)
        self.source = torch.tensor(view.camera.source, dtype=torch.float32)
        self.pixels = torch.tensor(room, dtype=torch.float32)
        self.volume = torch.tensor(case.mu_per_mm)[None, None]
        depth, height, width = case.mu_per_mm.shape
        self.last = torch.tensor([width - 1, height - 1, depth - 1], dtype=torch.float32)
        self.index_from_ct = torch.tensor(np.linalg.inv(case.ct_from_index), dtype=torch.float32)
        corners = np.array([[x, y, z, 1] for x in (0, width) for y in (0, height) for z in (0, depth)], float)
        corners = (corners @ case.ct_from_index.T)[:, :3]
        self.middle_ct = torch.tensor(corners.mean(axis=0), dtype=torch.float32)
        self.radius = float(np.linalg.norm(corners - corners.mean(axis=0), axis=1).max())

    def __call__(self, rotation, translation):
        """(h, w) of the pose room = rotation ct + translation."""
        source = rotation.T @ (self.source - translation)
        rays = (self.pixels - translation) @ rotation - source
        rays = rays / rays.norm(dim=1, keepdim=True)
        middle = float((self.middle_ct - source.detach()).norm())
        steps = torch.linspace(middle - self.radius, middle + self.radius, SAMPLES)
        points = source + steps[:, None, None] * rays
        index = points @ self.index_from_ct[:3, :3].T + self.index_from_ct[:3, 3]
        grid = (2.0 * index / self.last - 1.0)[None]
        values = torch.nn.functional.grid_sample(self.volume, grid[:, :, :, None], align_corners=True)
        return (values.reshape(SAMPLES, -1).sum(dim=0) * float(steps[1] - steps[0])).reshape(self.xray.shape)


def correlation(a, b):
    a, b = a - a.mean(dim=-1, keepdim=True), b - b.mean(dim=-1, keepdim=True)
    return ((a * b).sum(dim=-1) / ((a * a).sum(dim=-1) * (b * b).sum(dim=-1) + 1e-6).sqrt()).mean()


def patches(image):
    return torch.nn.functional.unfold(image[None, None], PATCH, stride=PATCH // 2)[0].T


def multiscale_correlation(drr, xray):
    whole = correlation(drr.reshape(1, -1), xray.reshape(1, -1))
    return 0.5 * (whole + correlation(patches(drr), patches(xray)))


def main():
    options = options_of(__doc__).parse_args()
    torch.set_num_threads(1)  # as our registrations are timed
    case = PeerCase(options.study, options.case)
    stages = [([Projector(case, view, factor) for view in case.views], *rest) for factor, *rest in STAGES]

    def register(start):
        start_rotation = torch.tensor(start[:3, :3], dtype=torch.float32)
        center = torch.tensor(case.center_ct, dtype=torch.float32)
        pivot = start_rotation @ center + torch.tensor(start[:3, 3], dtype=torch.float32)
        angles = torch.zeros(3, requires_grad=True)
        shift = torch.zeros(3, requires_grad=True)

        def pose():
            rotation = turn(angles) @ start_rotation
            return rotation, pivot + shift - rotation @ center

        for projectors, steps, rate_rad, rate_mm in stages:
            adam = torch.optim.Adam([{"params": [angles], "lr": rate_rad}, {"params": [shift], "lr": rate_mm}])
            schedule = torch.optim.lr_scheduler.ExponentialLR(adam, DECAY)
            for _ in range(steps):
                adam.zero_grad()
                rotation, translation = pose()
                loss = -sum(multiscale_correlation(p(rotation, translation), p.xray) for p in projectors)
                loss.backward()
                adam.step()
                schedule.step()
        with torch.no_grad():
            rotation, translation = pose()
        result = np.eye(4)
        result[:3, :3], result[:3, 3] = rotation.numpy(), translation.numpy()
        u, _, v = np.linalg.svd(result[:3, :3])  # single precision: rigid again
        result[:3, :3] = u @ v
        return result

    run(options, register)


if __name__ == "__main__":
    main()
