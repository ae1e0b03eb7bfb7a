"""Which things share a card: slabs across each family's direction, then cuts where a card would be mostly empty."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.render.layout_kernels import best_place, box_around

LEVEL_GAP = 1.5  # level cards stand this much further apart than upright ones: fewer look from above


@dataclass(frozen=True, eq=False)
class Group:
    """The things of one card: M of those that one family shows."""

    family: int
    member: NDArray[np.int64]  # (M,)


def groups(
    low: NDArray[np.float64], high: NDArray[np.float64], n_slabs: int, n_cards: int, margin_px: float, side: int
) -> list[Group]:
    """Deal things with boxes (N, K, 3), along the axes of K families, into at most about `n_cards` cards.

    All families are cut into `n_slabs` slabs together, equally far apart; then the cards that waste most of the
    texture of `side` px, each with a margin of `margin_px`, are cut in two.
    """
    depth = (low[..., 2] + high[..., 2]) / 2
    extent = np.ptp(depth, axis=0) if len(depth) else np.zeros(low.shape[1])
    stretch = np.array([1.0, 1.0, LEVEL_GAP])
    gap = max(float((extent / stretch).sum()) / n_slabs, 1e-9)
    cards = []
    for k in range(low.shape[1]):
        slab = slabs(depth[:, k], gap * float(stretch[k]))
        cards += [Group(k, np.flatnonzero(slab == s)) for s in np.unique(slab).tolist()]
    area = sum(float(np.ptp(box_around(low, high, g.member, g.family)[:, :2], axis=0).prod()) for g in cards)
    margin = margin_px * float(np.sqrt(area)) / side
    return cut_wasteful(cards, low, high, n_cards, margin)


def slabs(depth: NDArray[np.float64], gap: float) -> NDArray[np.int64]:
    """The slab (N,) that each depth falls into; all are equally thick, about `gap`."""
    if not len(depth):
        return np.zeros(0, np.int64)
    n = max(1, round(float(np.ptp(depth)) / gap))
    width = max(float(np.ptp(depth)) / n, 1e-12)
    return np.asarray(np.clip(((depth - depth.min()) / width).astype(np.int64), 0, n - 1), np.int64)


def cut_wasteful(
    cards: Sequence[Group], low: NDArray[np.float64], high: NDArray[np.float64], n_cards: int, margin: float
) -> list[Group]:
    """Cut the cards in two whose halves take least area, until there are `n_cards` or no cut saves anything."""
    found = list(cards)
    near, far = (np.ascontiguousarray(corner[..., :2].swapaxes(0, 1)) for corner in (low, high))  # (K, N, 2)
    waiting = []
    for k, card in enumerate(found):
        saved, is_first = best_cut(near[card.family][card.member], far[card.family][card.member], margin)
        waiting.append((-saved, k, is_first))
    heapq.heapify(waiting)
    while waiting and len(found) < n_cards:
        saved, k, is_first = heapq.heappop(waiting)
        if saved >= 0:
            break
        whole = found[k]
        found[k] = Group(whole.family, whole.member[is_first])
        found.append(Group(whole.family, whole.member[~is_first]))
        for part in (k, len(found) - 1):
            card = found[part]
            again, is_first = best_cut(near[card.family][card.member], far[card.family][card.member], margin)
            heapq.heappush(waiting, (-again, part, is_first))
    return found


def best_cut(low: NDArray[np.float64], high: NDArray[np.float64], margin: float) -> tuple[float, NDArray[np.bool_]]:
    """The area that the best cut of a card saves, and which of its things (M,) lie on the first part.

    Their boxes have corners (M, 2); a card is `margin` metres wider and higher than what it shows.
    """
    best, is_first = 0.0, np.ones(len(low), bool)
    if len(low) < 2:
        return best, is_first
    for axis in range(2):
        order = np.argsort(low[:, axis] + high[:, axis], kind="stable")
        at, parts, whole = best_place(low, high, order, margin)
        if whole - parts > best:
            best = whole - parts
            is_first = np.zeros(len(low), bool)
            is_first[order[: at + 1]] = True
    return best, is_first
