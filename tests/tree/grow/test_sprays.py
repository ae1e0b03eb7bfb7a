"""Sprays reach tufts by the way over the least sky, and twigs step aside from small gaps."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.testing import assert_array_equal
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from forestgen.tree.grow.aside import step_aside
from forestgen.tree.grow.crown_volume import CrownVolume, crown_volume
from forestgen.tree.grow.sprays import grow_sprays
from forestgen.tree.grow.ways import DIAGONAL, FAR, STRAIGHT, cheapest_ways
from tests.tree.grow.crowns import PX, ROOT, SIZE, trunk_matte, view_of

NONE = np.zeros(0, np.int64)


def plain_prices(cost: np.ndarray, is_source: np.ndarray) -> np.ndarray:
    """The same by Dijkstra's algorithm over all pairs of neighbours."""
    h, w = cost.shape
    index = np.arange(h * w).reshape(h, w)
    start, end, price = [], [], []
    for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
        a = index[: h - dy, max(0, -dx) : w - max(0, dx)].ravel()
        b = index[dy:, max(0, dx) : w - max(0, -dx)].ravel()
        for here, there in ((a, b), (b, a)):
            opens = cost.ravel()[there] > 0
            start.append(here[opens])
            end.append(there[opens])
            price.append((DIAGONAL if dy and dx else STRAIGHT) * cost.ravel()[there[opens]].astype(float))
    graph = coo_array((np.concatenate(price), (np.concatenate(start), np.concatenate(end))), (h * w, h * w)).tocsr()
    found = dijkstra(graph, indices=np.flatnonzero(is_source), min_only=True)
    return np.where(np.isfinite(found), found, FAR).reshape(h, w)


def test_ways_cost_what_dijkstra_finds() -> None:
    rng = np.random.default_rng(3)
    cost = rng.choice([0, 1, 4, 40], (40, 57), p=[0.3, 0.4, 0.1, 0.2]).astype(np.uint8)
    source = rng.random(cost.shape) < 0.01
    price, following = cheapest_ways(cost, source)
    assert_array_equal(price, plain_prices(cost, source))
    assert_array_equal(following >= 0, (price > 0) & (price < FAR))
    onward = price.ravel()[following[following >= 0]]
    assert (onward < price[following >= 0]).all()  # every way comes nearer to its source


def volume_of(leaves: np.ndarray) -> CrownVolume:
    return crown_volume([view_of(leaves, trunk_matte())])


def pixels(volume: CrownVolume, points: np.ndarray) -> np.ndarray:
    return np.floor(volume.cameras[0].project(points)).astype(int)


@pytest.fixture
def tuft() -> np.ndarray:
    """A ball of leaves with a bent tuft 3 px wide and 90 px long."""
    leaves = cv2.circle(np.zeros(SIZE[::-1], np.uint8), (150, 110), 60, 1, -1)
    cv2.polylines(leaves, [np.array([[205, 110], [240, 90], [280, 105]])], False, 1, 3)
    return leaves


def stem(volume: CrownVolume) -> tuple[np.ndarray, np.ndarray]:
    """A trunk into the ball, a limb to its right rim; its nodes stand 10 px apart."""
    trunk = np.column_stack([np.full(22, ROOT[0]), np.linspace(ROOT[1], 110, 22)])
    limb = np.column_stack([np.linspace(160, 200, 5), np.full(5, 110.0)])
    return volume.cameras[0].unproject(np.vstack([trunk, limb]), 0.4), np.arange(-1, 26)


def test_a_spray_follows_a_tuft_to_its_tip(tuft: np.ndarray) -> None:
    volume = volume_of(tuft)
    before, parent = stem(volume)
    position, parent = grow_sprays(before, parent, NONE, volume, 0.3, rng=np.random.default_rng(0))
    assert_array_equal(position[:27], before)
    assert (parent[1:] < np.arange(1, len(parent))).all()
    xy = pixels(volume, position[27:])
    assert np.abs(xy - [281, 105]).sum(axis=1).min() <= 4
    assert tuft[xy[:, 1], xy[:, 0]].all()  # every bend lies on foliage
    assert np.linalg.norm(position[27:] - position[parent[27:]], axis=1).max() < 20 / PX


def test_sprays_serve_all_foliage_and_start_from_no_bare_wood(tuft: np.ndarray) -> None:
    volume = volume_of(tuft)
    start, above = stem(volume)
    bare = np.arange(1, 22)
    position, parent = grow_sprays(start, above, bare, volume, 0.3, rng=np.random.default_rng(0))
    assert not np.isin(parent[27:], bare).any()
    near = cv2.distanceTransform(_without(position, parent, volume), cv2.DIST_L2, 5)
    assert (near[tuft > 0] <= 0.3 * PX + 2).mean() > 0.98


def _without(position: np.ndarray, parent: np.ndarray, volume: CrownVolume) -> np.ndarray:
    drawn = np.ones(SIZE[::-1], np.uint8)
    xy = pixels(volume, position)
    for node in range(1, len(parent)):
        cv2.line(drawn, xy[parent[node]].tolist(), xy[node].tolist(), 0)
    return drawn


def test_a_spray_crosses_little_sky_for_much_foliage_and_none_for_a_speck() -> None:
    leaves = cv2.circle(np.zeros(SIZE[::-1], np.uint8), (150, 110), 60, 1, -1)
    cv2.circle(leaves, (227, 110), 12, 1, -1)  # 5 px of sky before it
    leaves[108:110, 84:86] = 1  # a speck behind 5 px of sky
    volume = volume_of(leaves)
    position, _ = grow_sprays(*stem(volume), NONE, volume, 0.15, rng=np.random.default_rng(0))
    xy = pixels(volume, position[27:])
    assert (np.linalg.norm(xy - [227, 110], axis=1) <= 12).any()
    assert not (xy[:, 0] < 88).any()


def test_a_spray_keeps_to_the_foliage_of_the_other_view(tuft: np.ndarray) -> None:
    ball = cv2.circle(np.zeros(SIZE[::-1], np.uint8), (150, 110), 60, 1, -1)
    volume = crown_volume([view_of(tuft, trunk_matte()), view_of(ball, trunk_matte(), np.pi / 2)])
    position, _ = grow_sprays(*stem(volume), NONE, volume, 0.3, rng=np.random.default_rng(0))
    assert (np.abs(pixels(volume, position[27:]) - [281, 105]).sum(axis=1) <= 4).any()
    for camera, shown in zip(volume.cameras, volume.shown, strict=True):
        column, row = np.floor(camera.project(position[27:])).astype(int).T
        assert shown[row, column].all()


def test_twigs_step_aside_from_a_gap_and_keep_their_depth() -> None:
    leaves = cv2.circle(np.zeros(SIZE[::-1], np.uint8), (150, 110), 60, 1, -1)
    leaves[106:109, 160:190] = 0  # a slit under the lower half of which the twig runs
    volume = volume_of(leaves)
    xy = np.array([ROOT, (150.0, 107.5), (156.0, 107.5), (168.0, 107.5), (180.0, 107.5), (195.0, 107.5)])
    depth = np.array([0, 0, 0.1, 0.2, 0.3, 0.4])
    start = volume.cameras[0].unproject(xy, depth)
    position, parent = step_aside(start.copy(), np.arange(6) - 1, 2, volume)
    assert_array_equal(position[:2], start[:2])
    assert len(parent) > 6
    column, row = pixels(volume, position[2:]).T
    assert leaves[row, column].all()
    far = volume.cameras[0].depth(position)
    assert (np.diff(far[1:]) > 0).all()  # along the twig as before
    assert far[-1] == pytest.approx(0.4)


def test_wood_beside_no_foliage_stays() -> None:
    leaves = cv2.circle(np.zeros(SIZE[::-1], np.uint8), (150, 110), 60, 1, -1)
    volume = volume_of(leaves)
    start = volume.cameras[0].unproject(np.array([ROOT, (150.0, 110.0), (250.0, 110.0)]), 0.0)
    position, _ = step_aside(start.copy(), np.arange(3) - 1, 2, volume)
    assert_array_equal(position[-1], start[-1])
