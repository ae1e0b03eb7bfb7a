"""Coarser levels of detail of a tree, from its one skeleton: thinned-out wood, fewer leaves of fewer triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forestgen.errors import InputError
from forestgen.tree.level import EMPTY_MESH, Level, full_level
from forestgen.tree.limbs import tree_size
from forestgen.tree.lod_crown import Crown, crown_of
from forestgen.tree.lod_wood import swept, thinned_out
from forestgen.tree.mesh import GeneralisedCylinders
from forestgen.tree.model import Mesh, TreeModel

STRIDE = 40.0  # allowances for straying between two rings that only follow a limb's taper
FULL_PX = 1000.0  # from that height on all leaves stay
BENT_PX, TRIMMED_PX = 600.0, 1200.0  # heights from which on leaves are bent, and as they were built
TRIMMED = 1_000_000  # triangles of a leaf that is left as it was built
COARSEST_PX, FINEST_PX = 8.0, 8000.0  # heights between which `fit_level` searches
N_TRIES = 14  # halvings of that stretch


@dataclass(frozen=True, kw_only=True)
class LodStep:
    """How coarse a level may be. Pixels are those of the tree when it is `switch_px` tall on the screen."""

    switch_px: float  # height from which down the level is drawn
    density: float  # share of the leaves that stay inside the crown; more of them stay at its outline
    leaf_triangles: int = 2  # of one leaf, at most
    max_sides: int = 10  # of a thick trunk
    stray_px: float = 0.5  # how far the wood's surface and axes may stray from the true ones
    twig_px: float = 0.6  # no twig is drawn thinner than that, but so many fewer

    def __post_init__(self) -> None:
        if not self.switch_px > 0:
            raise ValueError(f"switch_px is {self.switch_px}; expected a height above 0")
        if not 0 < self.density <= 1:
            raise ValueError(f"density is {self.density}; expected a share above 0, at most 1")
        if self.leaf_triangles < 2 or self.max_sides < 3:
            raise ValueError("a leaf has at least 2 triangles, a limb 3 sides")


def step_at(switch_px: float) -> LodStep:
    """The step that suits a tree so many pixels tall."""
    return LodStep(
        switch_px=switch_px,
        density=min(1.0, switch_px / FULL_PX),
        leaf_triangles=2 if switch_px < BENT_PX else 4 if switch_px < TRIMMED_PX else TRIMMED,
        max_sides=int(np.clip(4 + switch_px / 60, 3, GeneralisedCylinders.max_sides)),
    )


LOD_STEPS = (step_at(400.0), step_at(150.0))  # LOD1 and LOD2


def coarser_level(model: TreeModel, step: LodStep) -> Level:
    """The tree as it may be drawn from the step's switch size down; the same model gives the same level.

    The leaves of a coarser level are among those of a finer one, and so are its limbs.
    """
    crown = crown_of(model)
    return _level(model, step, coarser_wood(model, step), crown, crown.count(step.density))


def coarser_wood(model: TreeModel, step: LodStep) -> Mesh:
    """The wood with fewer limbs, sides and rings; no faces where the tree has none."""
    if not len(model.mesh.faces):
        return EMPTY_MESH
    pixel = model.height / step.switch_px
    skeleton = thinned_out(model.skeleton, step.twig_px * pixel, is_bare=not len(model.leaves))
    stray = step.stray_px * pixel / max(tree_size(skeleton.position), 1e-3)
    finest = GeneralisedCylinders()
    sweep = GeneralisedCylinders(
        max_sides=step.max_sides,
        roundness=max(stray, finest.roundness),
        straightness=max(stray, finest.straightness),
        stride=STRIDE * stray,
        roughness=0.0,
    )
    mesh = swept(skeleton, model.bark, sweep, finest)
    return mesh if len(mesh.faces) < len(model.mesh.faces) else model.mesh


def fit_level(model: TreeModel, *, max_triangles: int | None = None, max_instances: int | None = None) -> Level:
    """The finest level with at most so many triangles, leaves counted out, and so many leaves.

    Raises:
        InputError: not even the coarsest level keeps a budget; the message says which number would do.
    """
    level = full_level(model)
    if _keeps(level, max_triangles, max_instances):
        return level
    crown = crown_of(model)
    most = len(model.leaves) if max_instances is None else max_instances

    def at(px: float) -> Level:
        step = step_at(px)
        count = min(crown.count(step.density), most)
        return _level(model, step, coarser_wood(model, step), crown, count)

    _check_budgets(model, crown, max_triangles, max_instances)
    low, high = COARSEST_PX, FINEST_PX
    if max_triangles is None:
        return _level(model, step_at(high), model.mesh, crown, most)
    best = at(low)
    for _ in range(N_TRIES):
        middle = float(np.sqrt(low * high))
        if _keeps(level := at(middle), max_triangles, max_instances):
            best, low = level, middle
        else:
            high = middle
    of_leaf = max((len(prototype.faces) for prototype in best.prototypes), default=1)
    count = min(most, len(model.leaves), len(best.leaves) + (max_triangles - best.n_triangles) // of_leaf)
    return _level(model, step_at(low), best.mesh, crown, count)


def _level(model: TreeModel, step: LodStep, wood: Mesh, crown: Crown, count: int) -> Level:
    """A level of given wood and number of leaves."""
    leaves, prototypes = crown.dressed(count, step.leaf_triangles, model.atlas.rgba)
    switch_px = min(step.switch_px, FULL_PX * crown.density(count)) if count < len(model.leaves) else step.switch_px
    return Level(wood, leaves, prototypes, EMPTY_MESH, switch_px)


def _keeps(level: Level, max_triangles: int | None, max_instances: int | None) -> bool:
    """Whether a level keeps its budgets."""
    return (max_triangles is None or level.n_triangles <= max_triangles) and (
        max_instances is None or level.n_instances <= max_instances
    )


def _check_budgets(model: TreeModel, crown: Crown, max_triangles: int | None, max_instances: int | None) -> None:
    """See that the coarsest level keeps both budgets.

    Raises:
        InputError: it does not.
    """
    step = step_at(COARSEST_PX)
    fewest = crown.count(step.density)
    if max_instances is not None and max_instances < fewest:
        raise InputError(
            f"max_instances is {max_instances}, but the coarsest level of {model.name!r} has {fewest} leaves:"
            f" give at least {fewest}"
        )
    least = _level(model, step, coarser_wood(model, step), crown, fewest).n_triangles
    if max_triangles is not None and max_triangles < least:
        raise InputError(
            f"max_triangles is {max_triangles}, but the coarsest level of {model.name!r} has {least}:"
            f" give at least {least}"
        )
