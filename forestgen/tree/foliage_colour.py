"""Which prototype a leaf takes: the one whose colour fits the leaf's place in the photo."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.foliage_unmixing import PureFoliage
from forestgen.tree.leaf_colours import lab_of
from forestgen.tree.model import Atlas
from forestgen.tree.view import View


def foliage_colours(view: View, pure: PureFoliage, sigma_px: float) -> NDArray[np.float32]:
    """The leaves' CIELAB (H, W, 3) in the photo, averaged around each pixel; their mean where none is near."""
    weight = view.mattes.foliage * view.mattes.is_foliage * pure.share**2
    rows, columns = np.nonzero(weight)
    reach = int(np.ceil(6 * sigma_px)) + 2
    part = (
        slice(max(0, rows.min() - reach), rows.max() + reach + 1),
        slice(max(0, columns.min() - reach), columns.max() + reach + 1),
    )
    lab, share = lab_of(pure.rgb[part]), weight[part]
    layers = np.dstack([lab * share[..., None], share]).astype(np.float32)
    mean = layers.sum(axis=(0, 1)) / max(float(share.sum()), 1e-9)
    total = cv2.GaussianBlur(layers, (0, 0), sigma_px)
    total += 0.02 * cv2.GaussianBlur(layers, (0, 0), 3 * sigma_px) + 1e-6 * mean
    out = np.empty((*weight.shape, 3), np.float32)
    out[:] = mean[:3]
    out[part] = total[..., :3] / total[..., 3:]
    return out


def prototype_lab(atlas: Atlas) -> NDArray[np.float64]:
    """Mean CIELAB (P, 3) of the prototypes."""
    rgb = np.array([leaf.colour for leaf in atlas.prototypes], np.float32).reshape(1, -1, 3)
    return np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2LAB)[0], np.float64)


def colours_at(
    views: Sequence[View],
    maps: Sequence[NDArray[np.float32]],
    points: NDArray[np.float64],
    weight: NDArray[np.float64],
) -> NDArray[np.float64]:
    """CIELAB (L, 3) of the photos where points (L, 3) fall: their mean, each view's by its weight (V, L)."""
    out = np.zeros((len(points), 3))
    share = weight / weight.sum(axis=0)
    for k, (view, colour) in enumerate(zip(views, maps, strict=True)):
        pick = share[k] > 0
        column, row = np.floor(view.camera.project(points[pick])).astype(np.int64).T
        height, width = colour.shape[:2]
        out[pick] += share[k, pick, None] * colour[row.clip(0, height - 1), column.clip(0, width - 1)]
    return out


def facing(views: Sequence[View], outside: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights (V, L): 1 for the view that `outside` (L, 3) faces most, 0 for the others."""
    towards = np.stack([outside @ view.camera.axes[2] for view in views])
    return np.asarray(towards.argmax(axis=0) == np.arange(len(views))[:, None], float)


def nearest_prototype(
    wish: NDArray[np.float64],
    lab: NDArray[np.float64],
    among: NDArray[np.bool_],
    spread: float,
    *,
    rng: np.random.Generator,
) -> NDArray[np.int64]:
    """The prototype (L,) whose colour (P, 3) is nearest to the wish (L, 3), chance weighing in by `spread` CIELAB.

    `among` (L, P) says which prototypes a leaf may take.
    """
    best = np.full(len(wish), np.inf)
    which = np.zeros(len(wish), np.int64)
    lightness, green_red, blue_yellow = np.ascontiguousarray(wish.T)  # sums of whole columns are six times as fast
    for k, (light, red, yellow) in enumerate(lab):
        far = (lightness - light) ** 2 + (green_red - red) ** 2 + (blue_yellow - yellow) ** 2
        far += rng.exponential(spread**2, len(wish))
        nearer = (far < best) & among[:, k]
        best[nearer] = far[nearer]
        which[nearer] = k
    return which
