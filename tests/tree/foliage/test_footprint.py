"""Leaves looked up in a photo, sample by sample: the kernel against numpy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from forestgen.tree.foliage_fit import Footprint, Placement, Target, footprint
from forestgen.tree.view import View
from tests.tree.foliage.crown import rotation


def plain_footprint(target: Target, leaves: Placement, samples: NDArray[np.float64]) -> Footprint:
    """The plain version: every sample of every leaf at once."""
    camera = target.view.camera
    height, width = target.is_foliage.shape
    n = len(leaves)
    axis = leaves.rotation * leaves.size[:, None, None]
    ends = leaves.position[:, None] + np.swapaxes(axis, 1, 2)
    base = camera.project(leaves.position)
    step = camera.project(ends.reshape(-1, 3)).reshape(n, 3, 2) - base[:, None]
    local = samples[leaves.prototype]
    column, row = np.moveaxis(np.floor(np.matmul(local, step) + base[:, None]).astype(np.int64), 2, 0)
    framed = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    flat = np.where(framed, row * width + column, 0)
    toward = np.einsum("lik,i->lk", axis, camera.axes[2])
    far = np.matmul(local, toward[..., None])[..., 0] + camera.depth(leaves.position)[:, None]
    hidden = far < target.wood_depth.ravel()[flat]
    return Footprint(
        (framed & (target.is_foliage.ravel()[flat] | hidden)).mean(axis=1),
        (framed & target.open.ravel()[flat] & ~hidden).mean(axis=1),
        np.where(framed & ~hidden, flat, -1),
    )


@pytest.mark.parametrize("seed", range(3))
def test_kernel_agrees_with_numpy(view: View, seed: int) -> None:
    rng = np.random.default_rng(seed)
    shape = view.mattes.foliage.shape
    wood = np.where(rng.random(shape) < 0.3, rng.normal(0, 1, shape), -np.inf).astype(np.float32)
    target = Target(view, view.mattes.is_foliage, np.isfinite(wood), wood, np.zeros(shape, bool))
    target.is_covered[rng.random(shape) < 0.5] = True
    n = 400
    turned = rng.normal(size=(n, 4))
    leaves = Placement(
        rng.uniform([-6, -1, -2], [6, 8, 2], (n, 3)),  # some of them out of the frame
        rotation(turned / np.linalg.norm(turned, axis=1, keepdims=True)),
        rng.uniform(0.05, 0.5, n),
        rng.integers(0, 3, n),
    )
    samples = rng.uniform([-0.5, 0, -0.1], [0.5, 1, 0.1], (3, 24, 3))
    found, plain = footprint(target, leaves, samples), plain_footprint(target, leaves, samples)
    assert_array_equal(found.pixel, plain.pixel)
    assert_array_equal(found.inside, plain.inside)
    assert_array_equal(found.gain, plain.gain)
    assert 0.1 < (found.pixel < 0).mean() < 0.9
    assert 0 < found.gain.mean() < found.inside.mean() < 1
