"""A neighbour's trunk in the outline is no wood of the tree; its own limbs and twigs are."""

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.segment.neighbours import neighbours_trunks
from forestgen.tree.segment.region import Region
from forestgen.tree.segment.wood import Limbs

SIZE = 240  # px; a round crown of radius 80 about (120, 100), its own trunk up the middle
Mask = NDArray[np.bool_]


def line(*points: tuple[int, int], width: int) -> Mask:
    drawn = cv2.polylines(np.zeros((SIZE, SIZE), np.uint8), [np.array(points, np.int32)], False, 1, width)
    return np.asarray(drawn > 0)


def scene() -> tuple[Region, Limbs, Mask]:
    crown = cv2.circle(np.zeros((SIZE, SIZE), np.uint8), (120, 100), 80, 1, -1)
    depth = cv2.distanceTransform(crown, cv2.DIST_L2, 5) - cv2.distanceTransform(1 - crown, cv2.DIST_L2, 5)
    inside = depth > -5.5
    whole = (slice(0, SIZE), slice(0, SIZE))
    region = Region(whole, np.zeros((SIZE, SIZE, 3), np.float32), depth, ~inside, inside, float(crown.sum() ** 0.5))
    trunk = line((120, 239), (120, 90), width=9)
    nothing = np.zeros((SIZE, SIZE), bool)
    return region, Limbs((), trunk.astype(np.float32), nothing, nothing, None), trunk


def found(*others: Mask) -> Mask:
    region, limbs, trunk = scene()
    wood = trunk.copy()
    for other in others:
        wood |= other & region.is_inside
    return neighbours_trunks(region, wood, limbs)


def test_a_trunk_that_comes_in_from_below_is_a_neighbours() -> None:
    region, _, trunk = scene()
    other = line((170, 239), (165, 60), width=8) & region.is_inside
    assert (found(other) == (other & ~trunk)).all()


def test_what_stands_in_its_line_belongs_to_it() -> None:
    region, _, _ = scene()
    below, above = (
        line((170, 239), (168, 110), width=8) & region.is_inside,
        line((167, 90), (166, 50), width=5),
    )
    assert (found(below, above) == (below | above)).all()
    assert not found(above).any()  # alone it may be a limb


def test_own_limbs_and_twigs_stay() -> None:
    assert not found(line((120, 120), (170, 40), width=6)).any()  # grows on the trunk
    assert not found(line((60, 90), (90, 40), width=5)).any()  # seen through leaves, ends in the crown
    assert not found(line((140, 60), (215, 70), width=4)).any()  # leaves at the side
    twig = line((150, 120), (153, 175), width=1) | line((150, 70), (150, 120), width=7)
    assert not found(twig).any()  # hangs out below, but ever thinner


def test_a_crown_without_other_wood() -> None:
    assert not found().any()
