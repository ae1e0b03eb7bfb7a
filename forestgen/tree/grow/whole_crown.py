"""Whole crown: what growers that fill a crown begin and end with, each with its own engine between."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.grow.axes import stem_end
from forestgen.tree.grow.boughs import boughs_of, steepness
from forestgen.tree.grow.crown_volume import CLOSE, CROSS, CrownVolume, close
from forestgen.tree.grow.densify import densify
from forestgen.tree.grow.growing_tree import GrowingTree
from forestgen.tree.grow.growth_form import growth_form, is_tiered, leader
from forestgen.tree.grow.leaf_masses import FINEST, Hull, LeafMasses, leaf_masses, lobe_sizes, tiers
from forestgen.tree.grow.turned_outline import TurnedOutline, turn_outline
from forestgen.tree.grow.twigs import grow_twigs
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.view import View

VISIBLE_SPACING = 0.02  # of the height: nodes of visible branches are no farther apart
BARE_TRUNK = 0.75  # of the trunk bears no twigs, only limbs


@dataclass(frozen=True, kw_only=True)
class Spacing:
    """How near to each other the points lie that each want a twig."""

    interval: float  # of the height
    least: int  # points at least: in a small crown they lie closer
    most: int  # and at most


def crown_tree(
    skeleton: Skeleton,
    view: View,
    volume: CrownVolume,
    *,
    has_leader: bool,
    has_masses: bool,
    rng: np.random.Generator,
) -> tuple[GrowingTree, CrownVolume, str]:
    """The visible tree ready to grow, its crown with lobes where one view leaves the depth open, and its form.

    A single stem gets the leader that carries it on, and the boughs that bear its masses.
    """
    visible, _ = densify(skeleton, VISIBLE_SPACING * volume.height)
    tree = GrowingTree(visible, stem_end(visible, view))
    outline = volume.turned or turn_outline(volume.leafy[0], volume.cameras[0], volume.height)
    form = growth_form(tree.line(0), outline)
    if form == "excurrent" and has_leader:
        tree.lead(leader(tree.line(0), outline, volume.height))
    if volume.turned is not None and has_masses:
        volume = replace(volume, masses=masses_of(tree, volume, volume.turned, form, rng=rng))
    return tree, volume, form


def with_twigs(
    grown: Skeleton, tree: GrowingTree, volume: CrownVolume, spacing: Spacing, *, rng: np.random.Generator
) -> Skeleton:
    """The grown tree with twigs wherever its crown has no wood near; the visible lower trunk bears none."""
    trunk = tree.axes[0].nodes
    bare = trunk[(np.arange(len(trunk)) < BARE_TRUNK * len(trunk)) & (trunk < tree.n_visible)]
    finest, coarsest = (volume.spacing_for(count, rng) for count in (spacing.most, spacing.least))
    apart = float(np.clip(spacing.interval * volume.height, finest, coarsest))
    return grow_twigs(grown, tree.n_visible, bare, volume, apart, rng=rng)


def masses_of(
    tree: GrowingTree, volume: CrownVolume, turned: TurnedOutline, form: str, *, rng: np.random.Generator
) -> LeafMasses:
    """The crown's leaf masses; a single stem gets the boughs that carry them."""
    leafy, camera, h = volume.leafy[0], volume.cameras[0], volume.height
    hull = Hull.of(turned, rng=rng)
    closed = close(leafy, (CROSS if volume.hides else CLOSE) * h * camera.px_per_metre)
    sizes = lobe_sizes(closed, camera.px_per_metre, h)
    outer = tree.position[outer_nodes(tree)]
    if not is_tiered(form, turned):
        return leaf_masses(closed, camera, hull, sizes, h, outer, rng=rng)
    steep = steepness(tree.position, tree.axes, turned.axes[0], h)
    boughs = boughs_of(tree.line(0), hull, volume, float(np.median(sizes)), steep, rng=rng)
    for bough in boughs:
        tree.bear(0, bough.foot, bough.points)
    nodes = np.concatenate([bough.points for bough in boughs] or [np.zeros((0, 3))])
    width = np.concatenate([bough.width for bough in boughs] or [np.zeros(0)])
    seen = np.full(len(outer), 2 * FINEST * h)
    at, wide = np.concatenate([nodes[width > 0], outer]), np.concatenate([width[width > 0], seen])
    return tiers(closed, camera, turned, h, at, wide)


def outer_nodes(tree: GrowingTree) -> NDArray[np.int64]:
    """Nodes of the visible side branches in their outer halves, tips first: these carry leaf masses."""
    found: list[int] = []
    for axis in tree.axes[1:]:
        found += axis.nodes[len(axis.nodes) // 2 :][::-1].tolist()
    return np.array(found, np.int64)
