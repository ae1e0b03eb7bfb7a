"""Line search: limbs too thin or too much among leaves for their colours alone, found as lines of likely wood.

A pixel of a leaf's shade is as dark as bark, but its neighbours along no line are. So evidence is
averaged along short lines of all directions and compared with the same line moved to either side
(as for blood vessels: Ricci & Perfetti 2007; ours, for evidence instead of grey levels). A line with
nothing of the tree on either side may be coloured like the leaves, as all is in a silhouette.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

WORKING_SIZE = 500.0  # px across a crown at which the thinnest limbs are looked for
OCTAVES = 4  # of limbs' widths, each twice as wide as the last
DIRECTIONS = 12  # in half a turn
LONG, BESIDE = 17, 3  # px of an octave's picture: a line's length, and how far beside it lies what it is compared with
CLIP = 3.0  # nats: what one pixel can say at most
STANDS_OUT = 1.5  # nats by which the mean along a line exceeds those on either side
AMONG_LEAVES, ALONE = 0.5, -0.5  # nats: least mean along a line among leaves, and with nothing on either side
STUB = 8  # px of an octave's picture: shorter runs of lines' middles are dropped
NOTHING = 0.3  # of the tree, as a share of the lines on either side
POSSIBLE = -1.0  # nats: a pixel on a line that is less likely wood is a gap in it


def on_lines(evidence: NDArray[np.float32], is_tree: NDArray[np.bool_], size_px: float) -> NDArray[np.bool_]:
    """Pixels (h, w) of a tree on lines of likely wood. `evidence` (h, w) are log odds of wood against all else.

    The crown is `size_px` wide.
    """
    layers = np.dstack([np.clip(evidence, -CLIP, CLIP), is_tree]).astype(np.float32)
    shape = (is_tree.shape[1], is_tree.shape[0])
    scale = min(1.0, WORKING_SIZE / size_px)
    found = np.zeros(is_tree.shape, bool)
    for octave in range(OCTAVES):
        size = [max(1, round(side * scale / 2**octave)) for side in shape]
        if min(size) < 2 * LONG:
            break
        small = np.asarray(cv2.resize(layers, size, interpolation=cv2.INTER_AREA), np.float32)
        lines = cv2.dilate(without_stubs(is_line(small)).astype(np.uint8), np.ones((3, 3), np.uint8))
        found |= cv2.resize(lines, shape, interpolation=cv2.INTER_NEAREST) > 0
    return np.asarray(found & is_tree & (evidence > POSSIBLE))


def is_line(layers: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Whether the line that stands out most at each pixel is wood (h, w); layers (h, w, 2): evidence, tree."""
    most = np.full(layers.shape[:2], STANDS_OUT, np.float32)
    found = np.zeros(layers.shape[:2], bool)
    for angle in np.pi * np.arange(DIRECTIONS) / DIRECTIONS:
        step = np.array([np.cos(angle), np.sin(angle)])
        line = np.asarray(cv2.filter2D(layers, -1, _line_kernel(step), borderType=cv2.BORDER_REPLICATE), np.float32)
        beside = np.maximum(*(_moved(line, side * BESIDE * step[1], -side * BESIDE * step[0]) for side in (-1, 1)))
        stands_out = line[..., 0] - beside[..., 0]
        better = stands_out > most
        least = np.where(beside[..., 1] < NOTHING, ALONE, AMONG_LEAVES)
        found[better] = (line[..., 0] > least)[better]
        most[better] = stands_out[better]
    return found


def without_stubs(found: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """A mask (h, w) of lines' middles without the short ones: a lone dark leaf answers near its middle alone."""
    _, label, stats, _ = cv2.connectedComponentsWithStats(found.astype(np.uint8), connectivity=8)
    keep = stats[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1) >= STUB
    keep[0] = False
    return np.asarray(keep[label])


def _line_kernel(step: NDArray[np.float64]) -> NDArray[np.float32]:
    """Weights (LONG, LONG), adding up to 1, of a line through the middle in direction `step`."""
    middle = LONG // 2
    kernel = np.zeros((LONG, LONG), np.uint8)
    ends = np.round(middle + np.outer([-middle, middle], step)).astype(int)
    cv2.line(kernel, ends[0].tolist(), ends[1].tolist(), 255, 1, cv2.LINE_AA)
    return np.asarray(kernel / kernel.sum(), np.float32)


def _moved(image: NDArray[np.float32], dx: float, dy: float) -> NDArray[np.float32]:
    """An image (h, w, 2) moved by a fraction of pixels; its border goes on."""
    shift = np.array([[1, 0, dx], [0, 1, dy]], np.float32)
    size = (image.shape[1], image.shape[0])
    return np.asarray(
        cv2.warpAffine(image, shift, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32
    )
