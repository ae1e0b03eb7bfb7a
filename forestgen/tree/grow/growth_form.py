"""Growth form: whether a tree has one stem to its top (excurrent) or divides into limbs (decurrent), by measure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.grow.turned_outline import TurnedOutline

STEM_REACH = 0.85  # share of the crown's height: a trunk drawn so far up is a single stem
STEM_HINT = 0.6  # so far, in a crown that narrows upward, it is one too
CONE = 0.44  # height of the outline's centre in the crown: a cone turned has 1/3, a ball 1/2
SLENDER = 1.4  # height over width of a crown that narrows upward: the stem is there though leaves hide it


def growth_form(trunk: NDArray[np.float64], outline: TurnedOutline) -> str:
    """ "excurrent" where one stem, the trunk (P, 3), runs through the crown, else "decurrent"."""
    bottom, top = outline.up[0], outline.up[-1]
    reach = ((trunk @ outline.axes[1]).max() - bottom) / max(top - bottom, 1e-9)
    width = outline.left + outline.right
    centre = float((width * (outline.up - bottom)).sum() / max(width.sum() * (top - bottom), 1e-9))
    slender = (top - bottom) / max(float(width.max()), 1e-9)
    is_cone = centre <= CONE and (reach >= STEM_HINT or slender >= SLENDER)
    return "excurrent" if is_cone or reach >= STEM_REACH else "decurrent"


def is_tiered(form: str, outline: TurnedOutline) -> bool:
    """Whether a single stem bears its foliage in tiers of boughs: a crown as wide as tall has limbs of many kinds."""
    tall = outline.up[-1] - outline.up[0]
    return form == "excurrent" and tall >= SLENDER * float((outline.left + outline.right).max())


def leader(trunk: NDArray[np.float64], outline: TurnedOutline, height: float) -> NDArray[np.float64]:
    """Points (P, 3) that carry a trunk (P, 3) on without a bend to just under the crown's top; none if it is there."""
    foot = trunk[-1]
    apex = outline.centre[-1] + 0.5 * (outline.right[-1] - outline.left[-1])
    _, up, toward = foot @ outline.axes.T
    goal = np.array([apex, outline.up[-1] - 0.01 * height, toward]) @ outline.axes
    rise = outline.up[-1] - 0.01 * height - up
    if rise < 0.03 * height:
        return np.zeros((0, 3))
    heading = foot - trunk[max(0, len(trunk) - 4)]
    heading *= rise / max(float(np.linalg.norm(heading)), 1e-9)
    t = np.linspace(0, 1, 2 + int(rise / (0.03 * height)))[1:, None]
    return np.asarray((1 - t) ** 2 * foot + 2 * t * (1 - t) * (foot + 0.5 * heading) + t * t * goal)
