"""A twiggy drawn tree, green on its left and red on its right, with its atlas and leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from forestgen.tree.atlas import LeafAtlasFromPhoto
from forestgen.tree.model import Atlas, Leaves
from forestgen.tree.photo import Photo
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.view import View
from tests.synthetic import DrawnTree, drawn_tree
from tests.tree.foliage.crown import grow, twiggy


@pytest.fixture(scope="module")
def tree() -> DrawnTree:
    return drawn_tree(px_per_metre=120.0)


@pytest.fixture(scope="module")
def view(tree: DrawnTree) -> View:
    """Leaves are green on the left half of the crown and red on the right."""
    rgb = tree.photo.rgb.copy()
    right = tree.mattes.is_foliage & (np.arange(rgb.shape[1]) > tree.camera.root_px[0])
    rgb[right] = (170, 60, 40)
    return replace(tree.view, photo=Photo(rgb, "half.png"))


@pytest.fixture(scope="module")
def skeleton(tree: DrawnTree) -> Skeleton:
    return twiggy(tree.skeleton)


@pytest.fixture(scope="module")
def atlas(view: View) -> Atlas:
    return LeafAtlasFromPhoto()([view], rng=np.random.default_rng(0))


@pytest.fixture(scope="module")
def leaves(skeleton: Skeleton, view: View, atlas: Atlas) -> Leaves:
    return grow(skeleton, view, atlas)
