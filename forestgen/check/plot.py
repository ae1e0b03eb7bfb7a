"""Small line plots of the growth costs, as coordinates for inline SVG."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

WIDTH, HEIGHT = 300, 110  # of the plot's inside, in SVG units
MOST = 300  # points of a line: more than the plot has columns


@dataclass(frozen=True)
class Panel:
    """One cost over the iterations, each panel with its own scale: the costs have different units."""

    name: str
    points: str  # "x,y x,y ..." of a polyline
    top: str  # label of the greatest value
    bottom: str  # label of the least value
    last: str  # label of the last iteration
    width: int = WIDTH
    height: int = HEIGHT


def cost_panels(costs: Mapping[str, Sequence[float]]) -> list[Panel]:
    """A panel for each cost that has two or more finite values."""
    return [panel for name, values in costs.items() if (panel := _panel(name, np.asarray(values, float)))]


def _panel(name: str, values: np.ndarray) -> Panel | None:
    iteration = np.flatnonzero(np.isfinite(values))
    if len(iteration) < 2:
        return None
    shown = iteration[np.unique(np.linspace(0, len(iteration) - 1, MOST).round().astype(int))]
    low, high = float(values[shown].min()), float(values[shown].max())
    x = (shown - iteration[0]) / (iteration[-1] - iteration[0]) * WIDTH
    y = HEIGHT - (values[shown] - low) / (high - low if high > low else 1.0) * HEIGHT
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    return Panel(name.replace("_", " "), points, _label(high), _label(low), str(int(iteration[-1]) + 1))


def _label(value: float) -> str:
    """A value in few signs, without powers of ten where it is large."""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
