"""Branch colours: which pixels of a photo look like the wood under the strokes (Tan et al. 2008, sec. 2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.arrays import freeze
from forestgen.tree.colour_model import Mixture, component_distance, fit_mixture
from forestgen.tree.mattes import Mattes
from forestgen.tree.photo import Photo
from forestgen.tree.strokes import Strokes, draw_polyline

BITS = 6  # of each channel are classified: 262,144 colours once, instead of each pixel


@dataclass(frozen=True, eq=False)
class BranchColours:
    """The two appearance models, and the photo's pixels classified by them."""

    branch: Mixture
    other: Mixture
    is_branch: NDArray[np.bool_]  # (H, W) the branch model explains this pixel better

    def __post_init__(self) -> None:
        freeze(self, is_branch=(np.bool_, "H", "W"))


def fit_branch_colours(
    photo: Photo,
    strokes: Strokes,
    mattes: Mattes,
    *,
    n_branch: int,
    n_other: int,
    too_close: float,
    rng: np.random.Generator,
) -> BranchColours:
    """Fit a mixture to the pixels under the branch strokes and one to all others; classify by likelihood.

    Components of the branch mixture nearer than `too_close` (Bhattacharyya) to a component of the
    foliage's are dropped: a stroke runs over leaves. The one farthest from the foliage always stays.
    """
    is_stroke = np.zeros(photo.rgb.shape[:2], bool)
    for path in strokes.branches:
        is_stroke |= draw_polyline(path, photo.size, 3)
    branch = fit_mixture(photo.rgb[is_stroke] / 255.0, n_branch, rng=rng)
    other = fit_mixture(_some(photo.rgb[~is_stroke], rng) / 255.0, n_other, rng=rng)
    leaves = photo.rgb[mattes.is_foliage & ~is_stroke]
    if len(leaves):
        foliage = fit_mixture(_some(leaves, rng) / 255.0, n_other, rng=rng)
        branch = drop_close(branch, foliage, too_close)
    return BranchColours(branch, other, classify(photo.rgb, branch, other))


def _some(rgb: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    """At most 20,000 of the colours (N, 3): enough for five Gaussians."""
    return rgb if len(rgb) <= 20_000 else rgb[rng.integers(len(rgb), size=20_000)]


def drop_close(branch: Mixture, foliage: Mixture, too_close: float) -> Mixture:
    """The branch mixture without the components that lie too near a foliage component."""
    distance = component_distance(branch, foliage).min(axis=1)
    return branch.subset((distance >= too_close) | (distance == distance.max()))


def classify(rgb: NDArray[np.uint8], branch: Mixture, other: Mixture) -> NDArray[np.bool_]:
    """Pixels (H, W) likelier under the branch model; colours are rounded to 6 bits a channel."""
    step = 256 >> BITS
    level = (np.arange(1 << BITS) * step + (step - 1) / 2) / 255.0
    red, green, blue = np.meshgrid(level, level, level, indexing="ij")
    colour = np.stack([red, green, blue], axis=-1).reshape(-1, 3).astype(np.float32)
    table = branch.log_density(colour) > other.log_density(colour)
    index = rgb.astype(np.int32) >> (8 - BITS)
    return np.asarray(table[(index[..., 0] << 2 * BITS) + (index[..., 1] << BITS) + index[..., 2]])
