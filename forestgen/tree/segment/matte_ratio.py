"""The normalized matting criterion (Kim & Jeong 2014, eq. 3) and its minimum under scribbles and bounds.

The paper hands eq. 4 to a general SQP, whose dense Hessian ends at some thousand pixels. Here alpha
walks down the ratio r(a) = a^T L a / a^T D a itself. With lambda = r(a), Dinkelbach's function
a^T (L - lambda D) a is 0 at a, so wherever it falls below 0 the ratio is lower: each round takes some
conjugate gradient steps on L - lambda D over the pixels that no bound holds, projects onto 0..1 and keeps
what lowers the ratio. L - lambda D may be indefinite: without bounds lambda would stay below the smallest
eigenvalue of the free pixels, with them it need not. A direction of negative curvature is then followed
until bounds stop it. So the ratio falls in every round, and what is found is a local minimum.

It starts from the numerator's own minimum without bounds, which is the closed-form matte: with bounds
from the start, pixels that a rough step has laid on a bound are freed again a window a round
(measured: half the time, and a lower ratio).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from forestgen.tree.segment.laplacian import Flat, MattingLaplacian
from forestgen.tree.segment.matte_multigrid import approximate_inverse

AT_BOUND = 1e-9  # alpha nearer to 0 or 1 is there
INNER_STEPS, INNER_TOLERANCE = 25, 0.2  # conjugate gradient steps of a round, and the share of the gradient to end at
FIRST_STEPS, FIRST_TOLERANCE = 40, 0.05  # the same of the closed-form matte it starts from
SHORTEST = 2.0**-14  # step at which the search along a direction gives up
TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Criterion:
    """Eq. 3 of a picture: (a^T L a + pull |a - nearby|^2 over the unknown pixels) / a^T D a; pull 0 is the paper's."""

    laplacian: MattingLaplacian
    pixels: NDArray[np.int64]  # all places of the picture on the padded grid
    unknown: NDArray[np.int64]  # those that no scribble fixes
    nearby: Flat  # (n,) first estimate on the padded grid
    pull: float = 0.0

    def volume(self, alpha: Flat) -> float:
        """The denominator a^T D a."""
        return float(self.laplacian.degree[self.pixels] @ alpha[self.pixels] ** 2)

    def value(self, alpha: Flat) -> float:
        """The ratio at alpha (n,)."""
        cut = float(alpha[self.pixels] @ self.laplacian.times(alpha, self.pixels))
        away = alpha[self.unknown] - self.nearby[self.unknown]
        return (cut + self.pull * float(away @ away)) / max(self.volume(alpha), TINY)

    def gradient(self, alpha: Flat, ratio: float) -> Flat:
        """Half of Dinkelbach's function's gradient at the unknown pixels."""
        at = self.unknown
        here = alpha[at]
        pulled = self.pull * (here - self.nearby[at])
        return self.laplacian.times(alpha, at) + pulled - ratio * self.laplacian.degree[at] * here


@dataclass(frozen=True, eq=False)
class Minimum:
    """Where the iterations ended."""

    alpha: Flat  # (n,) on the padded grid
    ratio: float  # the criterion's value
    residual: float  # square root of what one more step promises to gain, as a share of the numerator
    steps: int  # conjugate gradient steps in all
    is_converged: bool


def minimise(criterion: Criterion, start: Flat, tolerance: float, most_steps: int) -> Minimum:
    """Walk down the ratio from the closed-form matte, solved from `start` (n,), which holds the scribbles' values."""
    alpha, steps = closed_form(criterion, start)
    ratio = criterion.value(alpha)
    while True:
        gradient, here = criterion.gradient(alpha, ratio), alpha[criterion.unknown]
        is_held = ((here <= AT_BOUND) & (gradient > 0)) | ((here >= 1 - AT_BOUND) & (gradient < 0))
        free, wanted = criterion.unknown[~is_held], -gradient[~is_held]
        if not len(free):
            return Minimum(alpha, ratio, 0.0, steps, True)
        inverse = approximate_inverse(criterion.laplacian, free, criterion.pull)
        gain = max(float(wanted @ inverse(wanted)), 0.0)
        residual = (gain / max(ratio * criterion.volume(alpha), TINY)) ** 0.5
        if residual <= tolerance or steps >= most_steps:
            return Minimum(alpha, ratio, residual, steps, residual <= tolerance)
        direction, used = descend(criterion, ratio, free, wanted, inverse)
        lower = search(criterion, alpha, ratio, free, direction)
        if lower is None:
            return Minimum(alpha, ratio, residual, steps, False)
        (alpha, ratio), steps = lower, steps + used


def closed_form(criterion: Criterion, start: Flat) -> tuple[Flat, int]:
    """Nearly the numerator's minimum, laid into 0..1, and the steps it took; `start` where that has no lower ratio."""
    free = criterion.unknown
    if not len(free):
        return start, 0
    inverse = approximate_inverse(criterion.laplacian, free, criterion.pull)
    wanted = -criterion.gradient(start, 0.0)
    direction, steps = descend(criterion, 0.0, free, wanted, inverse, FIRST_STEPS, FIRST_TOLERANCE)
    alpha = start.copy()
    alpha[free] = np.clip(start[free] + direction, 0, 1)
    return (alpha if criterion.value(alpha) < criterion.value(start) else start), steps


def descend(
    criterion: Criterion,
    ratio: float,
    free: NDArray[np.int64],
    wanted: Flat,
    inverse: Callable[[Flat], Flat],
    most_steps: int = INNER_STEPS,
    tolerance: float = INNER_TOLERANCE,
) -> tuple[Flat, int]:
    """Conjugate gradients on (L + pull - ratio D) d = wanted over the free pixels, and how many; truncated.

    Ends with a direction of negative curvature, where it meets one, one long enough to reach a bound.
    """
    laplacian = criterion.laplacian
    shift = criterion.pull - ratio * laplacian.degree[free]
    field = np.zeros(len(laplacian.degree))
    direction, rest = np.zeros(len(free)), wanted.copy()
    way = preconditioned = inverse(rest)
    size = first = float(rest @ preconditioned)
    for step in range(1, most_steps + 1):
        field[free] = way
        image = laplacian.times(field, free) + shift * way
        curvature = float(way @ image)
        if curvature <= 0:
            return direction + way / max(float(np.abs(way).max()), TINY), step
        direction = direction + size / curvature * way
        rest -= size / curvature * image
        preconditioned = inverse(rest)
        before, size = size, float(rest @ preconditioned)
        if size <= tolerance**2 * first:
            break
        way = preconditioned + size / before * way
    return direction, step


def search(
    criterion: Criterion, alpha: Flat, ratio: float, free: NDArray[np.int64], direction: Flat
) -> tuple[Flat, float] | None:
    """The first of the halved steps, projected onto 0..1, that lowers the ratio; None where rounding hides it."""
    length = 1.0
    while length >= SHORTEST:
        trial = alpha.copy()
        trial[free] = np.clip(alpha[free] + length * direction, 0, 1)
        value = criterion.value(trial)
        if value < ratio:
            return trial, value
        length /= 2
    return None
