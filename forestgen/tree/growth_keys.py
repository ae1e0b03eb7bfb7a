"""Key samples: as few frames of a growing tree as readers need who interpolate between them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.growth import Anchors, GrowingTree
from forestgen.tree.growth_leaves import opened, width

COUNTS = (6, 8, 10, 12, 14, 16, 18, 20, 24, 28, 32, 40, 48, 60, 80, 100, 120)  # keys that are tried, fewest first
BIRTHS = 500  # times of birth for which leaves are followed
MOST_PROBES = 187  # frames at which the error is measured


def key_frames(
    tree: GrowingTree, longest_leaf: float, frames: int, tolerance: float, most: int
) -> tuple[NDArray[np.int64], float]:
    """Evenly spaced frames (K,) of 1 .. `frames` and how far, in metres, a reader between them strays.

    The fewest by which axes with their radii, and the length of leaves of at most `longest_leaf` metres,
    stay within `tolerance` metres of what they are in every frame, or `most` of them, if that is not enough.
    """
    probe = spread(frames, min(frames, MOST_PROBES))
    track = node_tracks(tree, probe / frames)
    keys, error = np.array([1, frames]), np.inf
    for count in [n for n in (2, *COUNTS) if n < min(most, len(probe))] + [min(most, len(probe))]:
        keys = probe[spread(len(probe), count) - 1]
        error = max(wood_error(track, probe, keys), longest_leaf * leaf_error(tree, probe / frames, keys / frames))
        if error <= tolerance:
            break
    return keys, error


def spread(n: int, count: int) -> NDArray[np.int64]:
    """`count` of the numbers 1 .. n, first and last among them, evenly."""
    return np.unique(np.round(np.linspace(1, n, max(count, 2))).astype(np.int64))


def gap(keys: NDArray[np.int64], frames: int) -> float:
    """The longest time between two key frames (K,): how far ahead of its tips wood has to be laid out.

    Then wood that gets its thickness between two keys does not move, and readers thicken it where it is.
    """
    return float(np.diff(keys).max()) / frames


def node_tracks(tree: GrowingTree, times: NDArray[np.float64]) -> NDArray[np.float32]:
    """Place and radius (T, N, 4) in metres of each node at times (T,); all ways are laid out."""
    n = len(tree.skeleton)
    nodes = Anchors(np.arange(n), np.ones(n), np.zeros((n, 3)))
    wood = tree.wood(nodes)
    track = np.empty((len(times), n, 4), np.float32)
    for k, time in enumerate(times):
        track[k, :, :3] = tree.carried(nodes, tree.pose(float(time), ahead=1.0), np.zeros(n))
        track[k, :, 3] = tree.skeleton.radius * tree.thickness(wood, float(time))
    return track


def wood_error(track: NDArray[np.float32], probe: NDArray[np.int64], keys: NDArray[np.int64]) -> float:
    """How far tracks (T, N, 4) at frames (T,) stray from straight lines between key frames (K,), metres.

    Only where there is wood at the later key: before, nothing is to be seen.
    """
    worst = 0.0
    at = np.searchsorted(probe, keys)
    for low, high in pairwise(at):
        seen = np.flatnonzero(track[high, :, 3] > 0)
        if not len(seen):
            continue
        path = track[low : high + 1, seen]
        share = (probe[low : high + 1] - probe[low]) / (probe[high] - probe[low])
        line = path[0] + np.asarray(share, np.float32)[:, None, None] * (path[-1] - path[0])
        off = np.abs(path - line)
        worst = max(worst, float((np.linalg.norm(off[..., :3], axis=-1) + off[..., 3]).max()))
    return worst


def leaf_error(tree: GrowingTree, times: NDArray[np.float64], keys: NDArray[np.float64]) -> float:
    """How far a leaf's length and width stray, in shares of their last, from straight lines between key times (K,)."""
    born = np.linspace(0, float(tree.birth.max()), BIRTHS)
    length = np.array([opened(tree, born, float(time)) for time in times])
    size = np.concatenate([length, width(length)], axis=1)
    between = np.array([np.interp(times, keys, np.interp(keys, times, one)) for one in size.T]).T
    return float(np.abs(size - between).max())
