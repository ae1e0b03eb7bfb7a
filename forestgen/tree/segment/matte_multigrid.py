"""Multigrid: an approximate inverse of the matting Laplacian over some of a picture's pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numba as nb
import numpy as np
from numpy.typing import NDArray

from forestgen.tree.segment.laplacian import Flat, MattingLaplacian, half_stencil

SMALLEST = 4  # places along the shorter side of the last grid
LAST_SWEEPS = 10  # down and up, which all but solve that grid
TWICE_FROM = 1  # grids from here on are visited twice (a W-cycle): plain blocks alone converge slowly


@dataclass(frozen=True, eq=False)
class Level:
    """One grid: the affinities between its free places."""

    affinity: NDArray[np.float64]  # (n, m)
    offset: NDArray[np.int64]  # (m,)
    diagonal: Flat  # (n,) sum of all affinities and the ground
    at: NDArray[np.int64]  # (k,) the free places
    block: NDArray[np.int64]  # (k,) their places on the next grid; empty on the last


def approximate_inverse(
    laplacian: MattingLaplacian, free: NDArray[np.int64], pull: float = 0.0
) -> Callable[[Flat], Flat]:
    """A function that takes b (k,) to roughly x (k,) with (L + pull)_FF x = b, F the free places (k,).

    Symmetric and positive, as conjugate gradients want it.
    """
    levels = build_levels(laplacian, free, pull)

    def inverse(wanted: Flat) -> Flat:
        field = np.zeros(len(laplacian.degree))
        field[free] = wanted
        return cycle(levels, field)[free]

    return inverse


def build_levels(laplacian: MattingLaplacian, free: NDArray[np.int64], pull: float) -> list[Level]:
    """Grids of blocks of 2 x 2 pixels, blocks of these, ...: the affinity of two blocks is the sum of their pixels'."""
    (h, w), reach = laplacian.shape, 2 * laplacian.radius
    affinity, offset, at = laplacian.affinity, laplacian.offset, free
    diagonal = np.ones(len(laplacian.degree))
    diagonal[at] = laplacian.diagonal(at) + pull
    levels: list[Level] = []
    while True:
        row, column = at // (w + reach) - reach, at % (w + reach)
        is_last = min(h, w) <= SMALLEST
        h, w, reach = (h + 1) // 2, (w + 1) // 2, (reach + 1) // 2
        block = (row // 2 + reach) * (w + reach) + column // 2
        levels.append(Level(affinity, offset, diagonal, at, block))
        if is_last:
            return levels
        block_of = np.full(len(diagonal), -1)
        block_of[at] = block
        n, blocks = (h + 2 * reach) * (w + reach), half_stencil(reach, w + reach)
        affinity, diagonal = _gather_blocks(affinity, offset, at, block_of, diagonal, blocks, n)
        offset, at = blocks, np.unique(block)


@nb.njit(cache=True)
def _gather_blocks(
    affinity: NDArray[Any],
    offset: NDArray[Any],
    at: NDArray[Any],
    block_of: NDArray[Any],
    diagonal: NDArray[Any],
    next_offset: NDArray[Any],
    n: int,
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Affinities (n, m) and diagonal (n,) of the blocks; `block_of` is -1 where a place is not free."""
    out = np.zeros((n, len(next_offset)))
    diag = np.zeros(n)
    for k in range(len(at)):
        i = at[k]
        b = block_of[i]
        diag[b] += diagonal[i]
        for m in range(len(offset)):
            j = i + offset[m]
            c = block_of[j]
            if c < 0:
                continue
            if c == b:
                diag[b] -= 2 * affinity[i, m]
                continue
            first = min(b, c)
            gap = max(b, c) - first
            for s in range(len(next_offset)):
                if next_offset[s] == gap:
                    out[first, s] += affinity[i, m]
                    break
    return out, diag


@nb.njit(cache=True)
def _sweep(
    affinity: NDArray[Any],
    offset: NDArray[Any],
    diagonal: NDArray[Any],
    at: NDArray[Any],
    wanted: NDArray[Any],
    x: NDArray[Any],
    is_down: bool,
) -> None:
    """One Gauss-Seidel sweep over x (n,), in place, down the picture or up. x is 0 off the places `at`."""
    n = len(at)
    for t in range(n):
        i = at[t] if is_down else at[n - 1 - t]
        total = wanted[i]
        for m in range(len(offset)):
            o = offset[m]
            total += affinity[i, m] * x[i + o] + affinity[i - o, m] * x[i - o]
        x[i] = total / diagonal[i]


@nb.njit(cache=True)
def _restrict(
    affinity: NDArray[Any],
    offset: NDArray[Any],
    diagonal: NDArray[Any],
    at: NDArray[Any],
    block: NDArray[Any],
    wanted: NDArray[Any],
    x: NDArray[Any],
    n: int,
) -> NDArray[Any]:
    """What x (n,) leaves of `wanted`, summed by block."""
    out = np.zeros(n)
    for t in range(len(at)):
        i = at[t]
        total = wanted[i] - diagonal[i] * x[i]
        for m in range(len(offset)):
            o = offset[m]
            total += affinity[i, m] * x[i + o] + affinity[i - o, m] * x[i - o]
        out[block[t]] += total
    return out


def cycle(levels: list[Level], wanted: Flat, depth: int = 0) -> Flat:
    """x (n,) with roughly L x = wanted at the free places: sweeps, and the next grid's answer to what they leave."""
    level, x = levels[depth], np.zeros(len(wanted))
    grid = (level.affinity, level.offset, level.diagonal, level.at)
    if depth == len(levels) - 1:
        for is_down in (True, False) * LAST_SWEEPS:
            _sweep(*grid, wanted, x, is_down)
        return x
    _sweep(*grid, wanted, x, True)
    for _ in range(2 if depth >= TWICE_FROM else 1):
        left = _restrict(*grid, level.block, wanted, x, len(levels[depth + 1].diagonal))
        x[level.at] += cycle(levels, left, depth + 1)[level.block]
    _sweep(*grid, wanted, x, False)
    return x
