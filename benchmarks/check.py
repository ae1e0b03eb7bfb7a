"""How fast one view is drawn and measured, against plain ways of doing the same, and how it grows.

python benchmarks/check.py
"""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any

import cv2
import numpy as np

from forestgen.camera import Camera
from forestgen.check import metrics
from forestgen.render import Drawable, Studio


def seconds(work: Callable[[], Any], repeats: int = 3) -> float:
    """The best of a few runs."""
    spent = []
    for _ in range(repeats):
        start = perf_counter()
        work()
        spent.append(perf_counter() - start)
    return min(spent)


def crown(n_leaves: int, seed: int = 0) -> list[Drawable]:
    """A ball of cut-out leaves of 16 prototypes, 3 m around (0, 7, 0), and a post."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(n_leaves, 3, 3)))[0]
    away = rng.normal(size=(n_leaves, 3))
    away *= 3 * rng.random((n_leaves, 1)) ** (1 / 3) / np.linalg.norm(away, axis=1, keepdims=True)
    places = np.zeros((n_leaves, 4, 4))
    places[:, :3, :3] = 0.12 * turn
    places[:, :3, 3] = away + np.array([0.0, 7.0, 0.0])
    places[:, 3, 3] = 1
    texture = np.full((256, 256, 4), (60, 130, 50, 0), np.uint8)
    cv2.ellipse(texture, (128, 128), (60, 124), 0, 0, 360, (60, 130, 50, 255), -1)
    square = np.array([[-0.5, 0, 0], [0.5, 0, 0], [0.5, 1, 0], [-0.5, 1, 0]])
    uv, faces = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]]), np.array([[0, 1, 2], [0, 2, 3]])
    leaves = [
        Drawable(name="leaf", points=square, faces=faces, uv=uv, texture=texture, is_leaf=True, transforms=some)
        for some in np.array_split(places, 16)
    ]
    return [*leaves, Drawable(name="wood", points=square * [0.5, 7, 1], faces=faces, colour=[0.4, 0.3, 0.2, 1])]


def plain_shifts(reference: np.ndarray, render: np.ndarray, reach: int) -> float:
    """The best IoU over shifts, one whole picture a shift."""
    return max(
        metrics.iou(reference, np.roll(render, (dy, dx), (0, 1)))
        for dy in range(-reach, reach + 1)
        for dx in range(-reach, reach + 1)
    )


def main() -> None:
    camera = Camera((1125, 1500), (560.0, 1450.0), 135.0)
    height_px = 10 * camera.px_per_metre
    times = {}
    for n_leaves in (25_000, 50_000, 100_000):
        with Studio(crown(n_leaves)) as studio:
            picture = studio.colour(camera)
            times[n_leaves] = seconds(lambda studio=studio: studio.colour(camera), 2)
            front = studio.classes(camera)
        print(f"draw {n_leaves:7,d} leaves at 1500 px, 4 samples: {times[n_leaves]:.2f} s")
    print(f"four times the leaves: {times[100_000] / times[25_000]:.1f} times the seconds")
    with Studio(crown(100_000, seed=1)) as studio:
        other = studio.colour(camera)
    render, reference = picture[..., 3] >= 0.495, other[..., 3] >= 0.495
    reach = int(np.ceil(metrics.SHIFT * height_px))
    ours = seconds(lambda: metrics.best_shifted_iou(reference, render, reach))
    plain = seconds(lambda: plain_shifts(reference, render, reach), 1)
    print(f"shifts for the skill: {ours:.3f} s, plain {plain:.3f} s: {plain / ours:.0f} times")

    outer = metrics.envelope(reference, height_px)
    trunk = np.column_stack([np.full(900, 560.5), np.arange(550, 1450)])
    parts: dict[str, Callable[[], Any]] = {
        "envelope (two)": lambda: (metrics.envelope(reference, height_px), metrics.envelope(render, height_px)),
        "boundary_f": lambda: metrics.boundary_f(outer, outer, height_px),
        "skill": lambda: metrics.skill(reference, render, outer, height_px),
        "gap_recall": lambda: metrics.gap_recall(reference, render, outer),
        "density_correlation": lambda: metrics.density_correlation(reference, render, (150.0, 100.0, 950.0, 900.0)),
        "branch_chamfer": lambda: metrics.branch_chamfer(
            trunk, reference, front[..., 1] >= 0.495, front[..., 0] >= 0.495, height_px
        ),
        "colour_delta_e": lambda: metrics.colour_delta_e(
            other[..., :3], reference, picture[..., :3], render, outer, height_px
        ),
    }
    spent = {name: seconds(work, 2) for name, work in parts.items()}
    for name, s in spent.items():
        print(f"  {name:20s} {s:.3f} s")
    print(f"all measures of a 1500 px view: {sum(spent.values()):.2f} s; budget 2 s")


if __name__ == "__main__":
    main()
