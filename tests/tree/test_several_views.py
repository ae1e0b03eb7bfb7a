"""neubert2007 from one, two and three photos of the drawn tree: from photos and strokes to a whole tree."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from forestgen.errors import StageError
from forestgen.tree.build import Source, build_tree
from forestgen.tree.methods import METHODS, Method
from forestgen.tree.model import TreeModel
from forestgen.tree.strokes import DensityStroke
from tests.synthetic import drawn_tree

HEIGHT = 5.5  # m


def quick() -> Method:
    method = METHODS["neubert2007"]
    return replace(
        method,
        lift=replace(method.lift, particles=200, density_resolution=32),
        grow=replace(method.grow, most=800, density_resolution=32),
        leaves=replace(method.leaves, most=3000, density_resolution=32),
    )


def source(azimuth_deg: float, *, leaves: bool = True, painted: bool = False, focal_px: float | None = None) -> Source:
    drawn = drawn_tree(px_per_metre=40.0, azimuth=np.deg2rad(azimuth_deg), leaves=leaves)
    strokes = drawn.strokes
    if painted:
        middle = strokes.crown.mean(axis=0)
        dabs = [[-40.0, 0], [40.0, -10], [0.0, -40]]
        strokes = replace(
            strokes, density=tuple(DensityStroke(True, 25.0, np.array([middle + np.array(dab)])) for dab in dabs)
        )
    return Source(drawn.photo, strokes, azimuth=np.deg2rad(azimuth_deg), focal_px=focal_px)


def build(sources: Sequence[Source], seed: int = 3, *, bare: bool = False) -> TreeModel:
    method = quick()
    if bare:
        method = replace(method, segment=replace(method.segment, bare="yes"))
    return build_tree(sources, method, height=HEIGHT, seed=seed)


def covered(model: TreeModel) -> list[float]:
    """For each view, the share of the leaves whose middle falls on the tree."""
    w, x, y, z = model.leaves.orientation.T
    along = np.column_stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)])
    middle = model.leaves.position + 0.6 * model.leaves.size[:, None] * along
    shares = []
    for view in model.views:
        column, row = np.floor(view.camera.project(middle)).astype(int).T
        height, width = view.mattes.foliage.shape
        near = np.pad(view.mattes.is_tree, 2)  # behind wood that shows there may be leaves
        grown = np.lib.stride_tricks.sliding_window_view(near, (5, 5)).any(axis=(2, 3))
        shares.append(float(grown[row.clip(0, height - 1), column.clip(0, width - 1)].mean()))
    return shares


@pytest.mark.parametrize("azimuths", [[0], [0, 90], [0, 60, 130]])
def test_leaves_lie_within_the_tree_of_every_view(azimuths: list[float]) -> None:
    model = build([source(azimuth) for azimuth in azimuths])
    assert len(model.views) == len(azimuths)
    assert len(model.leaves) > 100
    assert min(covered(model)) > 0.95
    assert np.ptp(model.skeleton.position[:, 2]) > 1.0


def test_a_bare_tree_in_three_photos_bears_the_leaves_that_were_painted() -> None:
    """The paper's winter oak (sec. 9): three photos and painted density."""
    azimuths = (0, 70, 140)
    bare = build([source(azimuth, leaves=False) for azimuth in azimuths], bare=True)
    painted = build([source(azimuth, leaves=False, painted=True) for azimuth in azimuths], bare=True)
    assert len(bare.leaves) == 0
    assert len(painted.leaves) > 100
    assert min(covered(painted)) > 0.95


def test_perspective_cameras_are_heeded() -> None:
    model = build([source(azimuth, focal_px=1500.0) for azimuth in (0, 90)])
    assert all(view.camera.focal_px == 1500.0 for view in model.views)
    assert min(covered(model)) > 0.95


def test_another_seed_grows_a_similar_tree() -> None:
    sources = [source(azimuth) for azimuth in (0, 90)]
    one, same, other = build(sources), build(sources), build(sources, seed=4)
    assert one.skeleton.position.tobytes() == same.skeleton.position.tobytes()
    assert one.leaves.position.tobytes() == same.leaves.position.tobytes()
    assert one.skeleton.position.tobytes() != other.skeleton.position.tobytes()
    low, high = sorted([len(one.skeleton), len(other.skeleton)])
    assert low > 0.7 * high
    assert np.abs(np.ptp(one.skeleton.position, axis=0) - np.ptp(other.skeleton.position, axis=0)).max() < 1.0


def test_views_that_contradict_each_other_are_named() -> None:
    """The second photo's tree stands beside where the first one's can be: nothing survives the minimum."""
    upright, sunk = source(0), source(90)
    low = replace(sunk, root=(sunk.strokes.root[0], float(sunk.photo.size[1]) * 0.2), scale=0.05)
    with pytest.raises(StageError, match=r"drawn\.png"):
        build([upright, low])
