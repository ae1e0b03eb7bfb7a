"""Whole crown: what growers that fill a crown begin and end with, each with its own engine between."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.closing import close
from forestgen.tree.grow.axes import stem_end
from forestgen.tree.grow.boughs import boughs_of, spray_width, steepness
from forestgen.tree.grow.crown_volume import CLOSE, CROSS, CrownVolume
from forestgen.tree.grow.densify import densify
from forestgen.tree.grow.drawn_in import drawn_in
from forestgen.tree.grow.growing_tree import GrowingTree
from forestgen.tree.grow.growth_form import growth_form, is_tiered, leader
from forestgen.tree.grow.leaf_masses import EVEN, Hull, LeafMasses, leaf_masses, lobe_sizes, tiers
from forestgen.tree.grow.rising import Boughs
from forestgen.tree.grow.turned_outline import TurnedOutline, as_deep_as_wide, turn_outline
from forestgen.tree.grow.twigs import grow_twigs
from forestgen.tree.skeleton import Skeleton
from forestgen.tree.view import View

VISIBLE_SPACING = 0.02  # of the height: nodes of visible branches are no farther apart
SMOOTHER = 0.14  # of the crown's height: the depth of crowns whose outline is rougher than their sides, see `Hull`
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
    stem = stem_end(visible, view)
    if volume.turned is not None:
        visible = drawn_in(visible, volume.cameras[0], volume.turned, stem)
    tree = GrowingTree(visible, stem)
    outline = volume.turned or turn_outline(volume.leafy[0], volume.cameras[0], volume.height)
    form = growth_form(tree.line(0), outline)
    if form == "excurrent" and has_leader:
        tree.lead(leader(tree.line(0), outline, volume.height))
    if volume.turned is not None and has_masses:
        volume = replace(volume, masses=masses_of(tree, volume, volume.turned, form, rng=rng))
    return tree, volume, form


def with_twigs(
    grown: Skeleton, tree: GrowingTree, volume: CrownVolume, form: str, spacing: Spacing, *, rng: np.random.Generator
) -> Skeleton:
    """The grown tree with twigs wherever its crown has no wood near; the visible lower trunk bears none."""
    trunk = tree.axes[0].nodes
    bare = trunk[(np.arange(len(trunk)) < BARE_TRUNK * len(trunk)) & (trunk < tree.n_visible)]
    finest, coarsest = (volume.spacing_for(count, rng) for count in (spacing.most, spacing.least))
    apart = float(np.clip(spacing.interval * volume.height, finest, coarsest))
    boughs = None
    if volume.turned is not None and not is_tiered(form, volume.turned):
        boughs = Boughs(trunk, steepness(tree.position, tree.axes, volume.cameras[0].axes[0], volume.height))
    return grow_twigs(grown, tree.n_visible, bare, volume, apart, boughs=boughs, rng=rng)


def masses_of(
    tree: GrowingTree, volume: CrownVolume, turned: TurnedOutline, form: str, *, rng: np.random.Generator
) -> LeafMasses:
    """The crown's leaf masses; a single stem gets the boughs that carry them."""
    leafy, camera, h = volume.leafy[0], volume.cameras[0], volume.height
    closed = close(leafy, (CROSS if volume.hides else CLOSE) * h * camera.px_per_metre)
    sizes = lobe_sizes(closed, camera.px_per_metre, h)
    if not is_tiered(form, turned):
        deeper = as_deep_as_wide(turned, leafy, camera)
        hull = Hull.of(deeper, EVEN if deeper is turned else SMOOTHER, rng=rng)
        outer = tree.position[outer_nodes(tree)]
        return leaf_masses(closed, camera, hull, sizes, h, outer, rng=rng)
    hull = Hull.of(turned, SMOOTHER, rng=rng)
    steep = steepness(tree.position, tree.axes, turned.axes[0], h)
    at, wide = seen_sprays(tree, h)
    boughs = boughs_of(tree.line(0), hull, volume, float(np.median(sizes)), steep, at, rng=rng)
    for bough in boughs:
        tree.bear(0, bough.foot, bough.points)
        leafy_part = bough.width > 0
        at = np.concatenate([bough.points[leafy_part], at])
        wide = np.concatenate([bough.width[leafy_part], wide])
    return tiers(closed, camera, turned, h, at, wide)


def seen_sprays(tree: GrowingTree, height: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Nodes (K, 3) of the visible side branches and the half-widths (K,) of the foliage about them, metres."""
    places, widths = [np.zeros((0, 3))], [np.zeros(0)]
    for axis in tree.axes[1:]:
        line = tree.position[axis.nodes]
        reach = float(np.linalg.norm(line[-1] - line[0]))
        along = np.linspace(0, 1, len(line))
        outer = along >= 0.25
        places.append(line[outer])
        widths.append(spray_width(along[outer], reach, height))
    return np.concatenate(places), np.concatenate(widths)


def outer_nodes(tree: GrowingTree) -> NDArray[np.int64]:
    """Nodes of the visible side branches in their outer halves, tips first: these carry leaf masses."""
    found: list[int] = []
    for axis in tree.axes[1:]:
        found += axis.nodes[len(axis.nodes) // 2 :][::-1].tolist()
    return np.array(found, np.int64)
