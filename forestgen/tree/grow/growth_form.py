"""Growth form: whether a tree has one stem to its top (excurrent) or divides into limbs (decurrent), by measure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.grow.crown_volume import TurnedOutline

STEM_REACH = 0.75  # share of the crown's height that one stem passes through
CONE = 0.44  # height of the outline's centre in the crown: a cone turned has 1/3, a ball 1/2


def growth_form(trunk: NDArray[np.float64], outline: TurnedOutline) -> str:
    """ "excurrent" where the trunk (P, 3) runs to near the top of a crown that narrows upward, else "decurrent"."""
    bottom, top = outline.up[0], outline.up[-1]
    reach = ((trunk @ outline.axes[1]).max() - bottom) / max(top - bottom, 1e-9)
    width = outline.left + outline.right
    centre = float((width * (outline.up - bottom)).sum() / max(width.sum() * (top - bottom), 1e-9))
    return "excurrent" if reach >= STEM_REACH and centre <= CONE else "decurrent"
