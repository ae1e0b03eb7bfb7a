"""Leaf colour without the light of the photo: an estimate, as far as one picture allows.

What the crown's leaves have in common in lightness is taken for their own, what sets them apart for light:
 - how bright a leaf is beside the others (in the sun, in the crown's shade) goes, but for a small rest;
 - the broad light and dark across one leaf goes, its veins and grain stay;
 - the hue and saturation of each leaf stay, except that very dark ones lean on the crown's: a photo holds
   little colour there;
 - the exposure is set so that the leaves throw back as much light as such leaves do.
Nothing in one photo tells a dark leaf from a shaded one, coloured light from a coloured leaf, or a leaf's
shine from its paleness. The default stays the photo's own light, as in Tan et al. 2008.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.atlas_cells import Cells, find_cells
from forestgen.tree.atlas_packing import bleed
from forestgen.tree.leaf_colours import lab_of
from forestgen.tree.model import Atlas
from forestgen.tree.season_colours import reflectance
from forestgen.tree.srgb import LUMINANCE, bytes_from_linear, linear_from_bytes

OWN = 0.18  # share of the difference in log luminance between leaves that is theirs, not light's: ours
GRAIN = 0.75  # share of a leaf's fine contrast that is its own
BROAD = 0.12  # sigma of light across a leaf, as a share of its longer side
DARK = 0.012  # linear luminance at which half of a leaf's colour is the crown's
SHINE = 0.5  # log luminance above its leaf from which a texel is a shine and held back
LIGHTEST = 0.75  # linear light that no leaf exceeds


def delit(atlas: Atlas) -> NDArray[np.uint8]:
    """The atlas's texture (H, W, 4) with the baked light taken out: same matte, bled under the edge as before.

    Raises:
        ValueError: the atlas holds no leaf.
    """
    if not atlas.prototypes:
        raise ValueError("a bare tree has no leaf colour to take light from")
    cells = find_cells(atlas)
    rgb = atlas.rgba[cells.row, cells.column, :3]
    linear = np.maximum(linear_from_bytes(rgb), 1e-4)
    log_light = np.log(linear @ LUMINANCE.astype(np.float32)).astype(float)
    leaf = cells.mean(log_light[:, None])[:, 0]
    common = float(np.median(leaf))
    fine = log_light - _broad(cells, log_light, atlas.rgba.shape[:2])
    fine = GRAIN * np.where(fine > SHINE, SHINE + np.tanh(fine - SHINE) / 2, fine)
    light = np.exp(common + OWN * (leaf - common)[cells.of] + fine)
    albedo = reflectance(lab_of(rgb).mean(axis=0))
    light *= albedo / light.mean()
    colour = _colour(cells, linear) * light[:, None]
    most = colour.max(axis=1)
    colour *= np.minimum(1, LIGHTEST / np.maximum(most, 1e-6))[:, None]
    out = atlas.rgba.copy()
    out[cells.row, cells.column, :3] = bytes_from_linear(colour)
    return bleed(out)


def _broad(cells: Cells, log_light: NDArray[np.float64], size: tuple[int, ...]) -> NDArray[np.float64]:
    """The broad part of a log luminance (N,): a wide blur within each cell."""
    out = np.empty_like(log_light)
    order = np.argsort(cells.of, kind="stable")
    for member in np.split(order, np.cumsum(np.bincount(cells.of, minlength=cells.n))[:-1]):
        if not len(member):
            continue
        row, column = cells.row[member] - cells.row[member].min(), cells.column[member] - cells.column[member].min()
        box = np.zeros((row.max() + 1, column.max() + 1, 2), np.float32)
        box[row, column] = np.column_stack([log_light[member], np.ones(len(member))])
        near = cv2.GaussianBlur(box, (0, 0), max(1.0, BROAD * max(box.shape[:2])), borderType=cv2.BORDER_CONSTANT)
        out[member] = near[row, column, 0] / near[row, column, 1]
    return out


def _colour(cells: Cells, linear: NDArray[np.float32]) -> NDArray[np.float64]:
    """Hue and saturation of texels (N, 3), as linear RGB of luminance 1; dark leaves lean on the crown's colour."""
    light = linear @ LUMINANCE.astype(np.float32)
    total = cells.mean(linear)
    own = total[cells.of] / (total @ LUMINANCE)[cells.of, None]
    texel = linear / light[:, None]
    crown = linear.mean(axis=0) / light.mean()
    sure = light / (light + DARK)
    mixed = sure[:, None] * texel + (1 - sure)[:, None] * own
    leaf_light = (total @ LUMINANCE)[cells.of]
    sure = leaf_light / (leaf_light + DARK)
    mixed = sure[:, None] * mixed + (1 - sure)[:, None] * crown
    return np.asarray(mixed / (mixed @ LUMINANCE)[:, None])
