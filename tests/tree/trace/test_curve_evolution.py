"""Curve evolution: relevance by hand, the least relevant goes first, fast = plain."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from forestgen.tree.trace.curve_evolution import Contours, evolve, outlines_of, relevance


def one_ring(points: list[list[float]]) -> Contours:
    return Contours(np.array(points, float), np.zeros(len(points), np.int64))


def plain(contours: Contours, whole: float, fewest: int, least: float) -> list[int]:
    """Weigh all vertices anew each time and drop the one of least relevance."""
    kept = list(range(len(contours)))
    while len(kept) > fewest:
        worth = {}
        for ring in sorted(set(contours.ring[kept].tolist())):
            own = [v for v in kept if contours.ring[v] == ring]
            if len(own) <= 3:
                continue
            for (a, b), c in zip(pairwise([own[-1], *own]), [*own[1:], own[0]], strict=True):
                worth[b] = relevance(*(tuple(contours.xy[v]) for v in (a, b, c)), whole)
        if not worth or min(worth.values()) >= least:
            break
        kept.remove(min(worth, key=lambda v: (worth[v], v)))
    return kept


def test_relevance_is_the_papers() -> None:
    # a right angle between lengths 3 and 4 of a polygon of length 10: beta l1 l2 / (l1 + l2)
    assert_allclose(relevance((0, 0), (3, 0), (3, 4), 10.0), np.pi / 2 * 0.3 * 0.4 / 0.7)
    assert relevance((0, 0), (1, 0), (2, 0), 10.0) == 0
    assert relevance((0, 0), (0, 0), (0, 0), 10.0) == 0


def test_the_vertex_of_least_relevance_goes_first() -> None:
    #  a square with a dent in the middle of one side, and a point on a straight side
    square = one_ring([[0, 0], [5, 0], [10, 0], [10, 10], [5, 9], [0, 10]])
    assert_array_equal(evolve(square, whole=40.0, fewest=5), [0, 2, 3, 4, 5])  # straight: R = 0
    assert_array_equal(evolve(square, whole=40.0, fewest=4), [0, 2, 3, 5])  # then the dent
    assert_array_equal(evolve(square, whole=40.0, least=0.1), [0, 2, 3, 5])  # corners: pi/2 * 5/40


@pytest.mark.parametrize(("fewest", "least"), [(3, np.inf), (12, np.inf), (25, np.inf), (3, 0.01), (3, 0.05)])
def test_fast_is_plain(fewest: int, least: float) -> None:
    rng = np.random.default_rng(5)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 40))
    size = rng.uniform(5, 12, 40)
    star = np.column_stack([size * np.cos(angle), size * np.sin(angle)])
    two = Contours(np.concatenate([star, star[:20] + 40]), np.repeat([0, 1], [40, 20]))
    assert_array_equal(evolve(two, whole=60.0, fewest=fewest, least=least), plain(two, 60.0, fewest, least))


def test_a_polygon_keeps_its_last_three() -> None:
    many = Contours(np.random.default_rng(1).random((24, 2)), np.repeat(np.arange(4), 6))
    kept = evolve(many, whole=1.0, fewest=3)
    assert_array_equal(np.bincount(many.ring[kept]), [3, 3, 3, 3])
    assert_array_equal(evolve(many, whole=1.0, fewest=1000), np.arange(24))  # more than there are: all stay


def test_outlines_have_two_sides_and_holes() -> None:
    mask = np.zeros((9, 11), bool)
    mask[2:7, 3:9] = True
    mask[4, 5] = False
    mask[8, 1:6] = True  # a line of single pixels at the frame
    contours = outlines_of(mask)
    assert_array_equal(np.sort(np.bincount(contours.ring)), [4, 12, 22])  # edges of the hole, the line, the block
    corners = evolve(contours, whole=1.0, fewest=11)
    around = contours.turns(corners)
    hole = np.bincount(contours.ring).argmin()
    assert (around[contours.ring[corners] == hole] < 0).all()  # of the wood, a hole's corners are hollow
    assert (around[contours.ring[corners] != hole] > 0).all()
    assert len(outlines_of(np.zeros((5, 5), bool))) == 0
    assert_array_equal(evolve(outlines_of(np.zeros((5, 5), bool)), whole=1.0), [])
