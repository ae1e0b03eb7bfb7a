"""Leaf or background by the paper's rule: of ten clusters the four most green or red are leaves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.colour_model import Mixture, fit_mixture
from forestgen.tree.segment.contrast import FAINT, Evidence
from forestgen.tree.segment.region import Region


def most_green_or_red(mean: NDArray[np.float64]) -> NDArray[np.float64]:
    """How green or red each colour (K, 3) is (K,): the larger of G - (R + B) / 2 and R - (G + B) / 2."""
    red, green, blue = mean.T
    return np.asarray(np.maximum(green - (red + blue) / 2, red - (green + blue) / 2))


def split_clusters(clusters: Mixture, n_leaf: int) -> tuple[Mixture, Mixture]:
    """The leaf clusters and the background clusters of the crown's colours, one of each at least."""
    order = np.argsort(-most_green_or_red(clusters.mean), kind="stable")
    n_leaf = min(n_leaf, len(clusters) - 1)
    return clusters.subset(order[:n_leaf]), clusters.subset(order[n_leaf:])


def green_or_red_clusters(region: Region, components: int, n_leaf: int, *, rng: np.random.Generator) -> Evidence:
    """Fit the mixture inside the widened crown and compare its leaf clusters with the others (sec. 2)."""
    inside = region.is_inside
    clusters = fit_mixture(region.rgb[inside], max(components, 2), rng=rng)
    log_ratio = np.full(inside.shape, FAINT, np.float32)
    if len(clusters) < 2:  # fewer than twenty pixels: one colour, all of it leaf
        log_ratio[inside] = 1
        return Evidence(log_ratio, clusters.log_density(region.rgb))
    leaf, rest = split_clusters(clusters, n_leaf)
    log_background = rest.log_density(region.rgb)
    log_ratio[inside] = leaf.log_density(region.rgb[inside]) - log_background[inside]
    return Evidence(log_ratio, log_background)
